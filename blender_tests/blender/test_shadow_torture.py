# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes that shadow maps fail on, against Cycles; where a test fails, both pictures and their difference are kept."""

from pathlib import Path

import numpy as np
import pytest
from agreement_fixtures import DIRECT_PASSES, render_pair
from agreement_torture import TORTURE
from engine_fixtures import registered_fixture  # noqa: F401

GRAZING = "grazing sun over curved meshes"

OUR_SAMPLES, CYCLES_SAMPLES = 256, 512
FEW_SAMPLES = 64
SHARP = (GRAZING, "sun over a kilometre")
"""Their suns are as small as the real one: fewer samples show its penumbrae as well."""

LEAK = 1e-3
"""Of the picture's mean light: what may shine where it is dark in Cycles' picture, a pixel around included."""

BRIGHTEST_LEAKS = {
    # Faces of these waves are up to 3° from the smooth surface: at its terminator either of the two may be lit, at
    # sin 3° = 0.05 of the sun's 3 W/m². That is 0.9 of the mean of a picture that is hardly lit at all.
    GRAZING: 0.9,
}
"""What the brightest such pixel may be instead, where faces and smooth normals differ."""


MEAN_LIMIT, OFF_LIMIT = 0.01, 0.02
"""Of `Difference`, as in all direct light."""

DIM = 0.2
DIM_OFF = 0.25
"""Where less than a fifth of the light arrives, an error of 1 % of the light, two standard errors of 256 points at a
straight edge, is above 5 % of what arrives. A quarter of such pixels may be off besides."""

TERMINATOR = (0.005, 0.025)
"""Cycles lifts shadow rays off smooth meshes (Geometry Offset, 0.1 by default), so that their faces do not show in
the terminator. Under the grazing sun that is worth so much light and so many pixels, measured with and without: whoever
shadows the true faces may differ by so much more."""


@pytest.mark.usefixtures("registered")
@pytest.mark.parametrize("name", TORTURE)
def test_shadows_are_cycles(name: str, tmp_path: Path) -> None:
    pair = render_pair(
        TORTURE[name](),
        tmp_path,
        cycles_samples=CYCLES_SAMPLES,
        our_samples=FEW_SAMPLES if name in SHARP else OUR_SAMPLES,
        passes=DIRECT_PASSES,
    )
    ours, theirs = pair.reflected()
    dark = surrounded((theirs == 0.0).all(axis=-1)) & pair.covered
    found = pair.difference()
    arriving = theirs.mean(axis=-1)[pair.covered] / np.percentile(theirs.mean(axis=-1)[pair.covered], 98.0)
    mean, off = MEAN_LIMIT, OFF_LIMIT + DIM_OFF * float(((arriving > LEAK) & (arriving < DIM)).mean())
    if name == GRAZING:
        mean, off = mean + TERMINATOR[0], off + TERMINATOR[1]
    assert 0.01 < dark.mean() < 0.9, "the case must have a shadow"
    assert found.mean <= mean, pair.report(tmp_path)
    assert found.off <= off, pair.report(tmp_path)
    leaks = ours[dark].max(axis=-1) / theirs[pair.covered].mean()
    assert leaks.mean() <= LEAK, f"light leaks into shadows, {leaks.mean():.1e} of the mean; {pair.report(tmp_path)}"
    brightest = leaks.max()
    assert brightest <= BRIGHTEST_LEAKS.get(name, LEAK), f"{brightest:.1e} at the worst; {pair.report(tmp_path)}"


def surrounded(mask: np.ndarray) -> np.ndarray:
    """Where `mask` (H, W) is true in the pixel and all eight around it; those outside the picture count as true."""
    padded = np.pad(mask, 1, constant_values=True)
    height, width = mask.shape
    return np.all([padded[y : y + height, x : x + width] for y in range(3) for x in range(3)], axis=0)
