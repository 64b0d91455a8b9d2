# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes that shadow maps fail on, against Cycles; where a test fails, both pictures and their difference are kept."""

from pathlib import Path

import numpy as np
import pytest
from agreement_fixtures import DIRECT_PASSES, render_pair
from agreement_torture import TORTURE
from engine_fixtures import registered_fixture  # noqa: F401

OUR_SAMPLES, CYCLES_SAMPLES = 256, 512
FEW_SAMPLES = 64
SHARP = ("grazing sun over curved meshes", "sun over a kilometre")
"""Their suns are as small as the real one: fewer samples show its penumbrae as well."""

LEAK = 1e-3
"""Of the picture's mean light: what may shine where it is dark in Cycles' picture, a pixel around included."""

BRIGHTEST_LEAKS = {
    # Faces of these waves are up to 3° from the smooth surface: at its terminator either of the two may be lit, at
    # sin 3° = 0.05 of the sun's 3 W/m². That is 0.9 of the mean of a picture that is hardly lit at all.
    "grazing sun over curved meshes": 0.9,
}
"""What the brightest such pixel may be instead, where faces and smooth normals differ."""


MEAN_LIMIT, OFF_LIMIT = 0.01, 0.02
"""Of `Difference`, as in all direct light."""

LIMITS = {
    # Cycles lifts shadow rays off smooth meshes (Geometry Offset, 0.1 as Blender has it), so that their faces do not
    # show in the terminator. In this scene that is worth 0.5 % of the light and 2.5 % of the pixels, measured with and
    # without; whoever shadows the true faces may differ by so much more.
    "grazing sun over curved meshes": (MEAN_LIMIT + 0.005, OFF_LIMIT + 0.025),
}


@pytest.mark.usefixtures("registered")
@pytest.mark.parametrize("name", TORTURE)
def test_shadows_are_cycles(name: str, tmp_path: Path) -> None:
    mean, off = LIMITS.get(name, (MEAN_LIMIT, OFF_LIMIT))
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
