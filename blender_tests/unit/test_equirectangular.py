# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of directions: their layout, areas, interpolation and coarsening."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from addon.scene.equirectangular import (
    box_sums,
    coarsened,
    look_up,
    texel_coordinates,
    texel_directions,
    texel_solid_angles,
)

SIZES = st.tuples(st.integers(1, 12), st.integers(1, 12))


def test_layout_is_blenders():
    """+X is in the middle, +Y a quarter to its left, the zenith in the last row."""
    directions = texel_directions(180, 360)
    np.testing.assert_allclose(directions[90, 180], (1.0, 0.0, 0.0), atol=0.02)
    np.testing.assert_allclose(directions[90, 90], (0.0, 1.0, 0.0), atol=0.02)
    np.testing.assert_allclose(directions[179, 0], (0.0, 0.0, 1.0), atol=0.02)


@given(SIZES)
def test_directions_and_coordinates_are_inverse(size):
    height, width = size
    column, row = texel_coordinates(texel_directions(height, width), height, width)
    np.testing.assert_allclose(row, np.broadcast_to(np.arange(height)[:, None], (height, width)), atol=1e-6)
    np.testing.assert_allclose(column, np.broadcast_to(np.arange(width), (height, width)), atol=1e-6)


@given(SIZES)
def test_texels_cover_the_sphere(size):
    height, width = size
    assert texel_solid_angles(height, width).sum() * width == pytest.approx(4.0 * np.pi)


@given(
    hnp.arrays(
        np.float32, st.tuples(st.integers(1, 6), st.integers(1, 6), st.just(3)), elements=st.floats(0, 9, width=32)
    )
)
def test_texels_are_found_again(pixels):
    height, width = pixels.shape[:2]
    np.testing.assert_allclose(look_up(pixels, texel_directions(height, width)), pixels, atol=1e-4)


def test_interpolation_has_no_seam():
    pixels = np.random.default_rng(1).random((8, 16, 3))
    angles = np.pi + np.array([-1e-9, 1e-9])
    both = look_up(pixels, np.stack([np.cos(angles), np.sin(angles), np.full(2, 0.3)], axis=-1) / np.hypot(1.0, 0.3))
    np.testing.assert_allclose(both[0], both[1], atol=1e-7)


@given(hnp.arrays(np.float64, 12, elements=st.floats(0, 1)), st.integers(1, 12))
def test_box_sums_lose_nothing(values, count):
    sums = box_sums(values, np.linspace(0.0, 12.0, count + 1))
    assert sums.sum() == pytest.approx(values.sum())
    if 12 % count == 0:
        np.testing.assert_allclose(sums, values.reshape(count, -1).sum(axis=1), atol=1e-12)


def test_coarser_maps_keep_the_light():
    pixels = np.random.default_rng(2).random((24, 48, 3)).astype(np.float32)
    coarse = coarsened(pixels, 5, 10)
    assert coarse.shape == (6, 12, 3)
    before, after = (
        (image * texel_solid_angles(*image.shape[:2])[:, None, None]).sum(axis=(0, 1)) for image in (pixels, coarse)
    )
    np.testing.assert_allclose(after, before, rtol=1e-6)
    assert coarsened(pixels, 13, 10) is pixels
