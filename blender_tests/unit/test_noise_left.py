# SPDX-License-Identifier: GPL-3.0-or-later
"""Known noise has a known estimate, and the noisiest part of a picture decides."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from addon.render.noise import BLOCK, noise_left

PICTURES = hnp.arrays(
    np.float32,
    st.tuples(st.integers(1, 70), st.integers(1, 70), st.just(3)),
    elements=st.sampled_from([0.0, 0.25, 1.0, 1e6]),
)
TROUBLED = hnp.arrays(np.float32, (40, 50, 3), elements=st.floats(width=32))


def flat(value, height=64, width=96):
    """A picture of one grey."""
    return np.full((height, width, 3), value, np.float32)


@given(PICTURES)
def test_equal_pictures_have_no_noise(picture):
    assert noise_left(picture, picture) == 0.0


@pytest.mark.parametrize(
    ("brightness", "expected"),
    [
        (0.12, 3 * 0.015 / (1e-4 + 0.6)),  # the sum is 0.36: over its square root
        (3.0, 3 * 0.015 / (1e-4 + 9.0)),  # the sum is 9: over itself
        (0.0, 3 * 0.015 / 1e-4),
    ],
)
def test_a_constant_difference_is_judged_by_the_brightness(brightness, expected):
    assert noise_left(flat(brightness + 0.015), flat(brightness)) == pytest.approx(expected, rel=1e-5)


def test_the_estimate_is_the_noise_that_is_left():
    """Normal noise of deviation σ in one grey sample: the mean of 2n has σ/√(2n), whose mean absolute value is
    √(2/π) of that. Over 96 x 64 pixels in six equal blocks, each known to 0.755/√1024 of it, the greatest is less than
    four such deviations away."""
    generator = np.random.default_rng(1)
    deviation, n, brightness = 0.05, 8, 0.2
    samples = brightness + deviation * generator.standard_normal((2 * n, 64, 96, 1)).repeat(3, axis=-1)
    estimate = noise_left(samples[:n].mean(axis=0).astype(np.float32), samples.mean(axis=0).astype(np.float32))
    left = 3 * np.sqrt(2 / np.pi) * deviation / np.sqrt(2 * n) / np.sqrt(3 * brightness)
    assert estimate == pytest.approx(left, rel=4 * 0.755 / np.sqrt(BLOCK**2))


@pytest.mark.parametrize(("row", "column"), [(0, 0), (BLOCK, 2 * BLOCK), (5, 17)])
def test_one_noisy_block_is_not_lost_among_quiet_ones(row, column):
    """A block that lies elsewhere than the ones that are judged is a quarter of one of them at least."""
    whole, half = flat(0.12, 4 * BLOCK, 4 * BLOCK), flat(0.12, 4 * BLOCK, 4 * BLOCK)
    half[row : row + BLOCK, column : column + BLOCK] += 0.015
    noisy = noise_left(flat(0.135), flat(0.12))
    aligned = row % BLOCK == 0 and column % BLOCK == 0
    found = noise_left(half, whole)
    assert found == pytest.approx(noisy, rel=1e-5) if aligned else 0.25 * noisy <= found <= noisy


def test_one_bright_pixel_counts_as_part_of_its_block():
    half, whole = flat(0.12, BLOCK, BLOCK), flat(0.12, BLOCK, BLOCK)
    half[3, 4] += 0.015
    assert noise_left(half, whole) == pytest.approx(noise_left(half[3:4, 4:5], whole[3:4, 4:5]) / BLOCK**2, rel=1e-5)


@given(TROUBLED, TROUBLED)
def test_whatever_the_pixels_the_estimate_is_no_noise_only_where_there_is_none(half, whole):
    found = noise_left(half, whole)
    finite = np.isfinite(half).all() and np.isfinite(whole).all()
    assert found >= 0.0 if finite else not found <= 1e-3


@pytest.mark.parametrize("shapes", [((4, 4, 3), (4, 5, 3)), ((0, 4, 3), (0, 4, 3))])
def test_pictures_that_cannot_be_compared_are_refused(shapes):
    with pytest.raises(ValueError, match="cannot be compared"):
        noise_left(*(np.zeros(shape, np.float32) for shape in shapes))
