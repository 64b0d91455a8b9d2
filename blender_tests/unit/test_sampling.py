# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.render.sampling import film_sample, filter_offset, sequence_point


@given(st.integers(0, 1 << 20), st.integers(0, 1 << 31))
def test_points_lie_in_the_unit_cube_and_repeat(index, seed):
    point = sequence_point(index, seed)
    assert all(0.0 <= value < 1.0 for value in point)
    assert point == sequence_point(index, seed)


@pytest.mark.parametrize("seed", [0, 7])
def test_points_are_spread_more_evenly_than_random_ones(seed):
    """The largest deviation over 8×8 boxes of 256 points stays below random's 3 σ."""
    points = np.array([sequence_point(index, seed) for index in range(1, 257)])
    counts = np.histogram2d(points[:, 0], points[:, 1], bins=8, range=[[0, 1], [0, 1]])[0]
    assert np.abs(counts - 4).max() < 6


def test_sample_zero_goes_through_centres_whatever_the_seed():
    for seed in (0, 5):
        sample = film_sample(0, 1.5, seed)
        assert sample.pixel_offset == pytest.approx((0.0, 0.0), abs=1e-12)


def test_filter_offsets_have_the_moments_of_blackman_harris():
    offsets = np.array([filter_offset(u, 1.5) for u in (np.arange(4096) + 0.5) / 4096])
    x = np.linspace(-1.5, 1.5, 20001)
    phase = 2 * np.pi * (x / 3 + 0.5)
    w = 0.35875 - 0.48829 * np.cos(phase) + 0.14128 * np.cos(2 * phase) - 0.01168 * np.cos(3 * phase)
    assert offsets.mean() == pytest.approx(0.0, abs=1e-6)
    assert offsets.var() == pytest.approx((w * x * x).sum() / w.sum(), rel=1e-3)
    assert np.abs(offsets).max() <= 1.5


def test_a_filter_of_no_width_samples_the_centre():
    assert film_sample(9, 0.0, 0).pixel_offset == (0.0, 0.0)
