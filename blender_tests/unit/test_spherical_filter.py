# SPDX-License-Identifier: GPL-3.0-or-later
"""Blurs over the sphere against closed forms."""

import numpy as np
import pytest

from addon.render.spherical_filter import COLUMNS, ROWS, blurred, cosine_lobe, harmonics, lobe
from addon.scene.equirectangular import texel_directions, texel_solid_angles


def nodes():
    """(ROWS, COLUMNS + 1, 3) directions of a blurred map's nodes."""
    elevation = (np.arange(ROWS) / (ROWS - 1) - 0.5)[:, None] * np.pi
    azimuth = (0.5 - np.arange(COLUMNS + 1) / COLUMNS) * 2.0 * np.pi
    return np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation) + 0.0 * azimuth],
        axis=-1,
    )


def one_texel(height, width, row, column):
    """A map of one bright texel, the direction to it and its flux."""
    pixels = np.zeros((height, width, 3), np.float32)
    pixels[row, column] = (1e5, 1.0, 0.0)
    return pixels, texel_directions(height, width)[row, column], 1e5 * texel_solid_angles(height, width)[row]


@pytest.mark.parametrize("size", [(8, 16), (160, 320), (512, 1024), (500, 1000), (1024, 2048)])
def test_irradiance_of_a_gradient(size):
    """L = 1 + a · d gives E(n) = π (1 + ⅔ a · n). A map of 8 rows is itself a gradient only to (π/8)²/8, 2 %."""
    slope = np.array([0.3, -0.2, 0.5])
    pixels = np.repeat((1.0 + texel_directions(*size) @ slope)[..., None], 3, axis=2).astype(np.float32)
    expected = np.pi * (1.0 + 2.0 / 3.0 * nodes() @ slope)
    shown = blurred(harmonics(pixels), cosine_lobe())[..., 1]
    np.testing.assert_allclose(shown, expected, rtol=0.02 if size[0] == 8 else 1e-3)


def test_irradiance_of_a_point():
    """E = flux · max(cos, 0); degrees above 159 round the crease at the horizon, by 0.3 % of the largest."""
    pixels, direction, flux = one_texel(512, 1024, 400, 300)
    shown = blurred(harmonics(pixels), cosine_lobe())
    expected = flux * np.maximum(nodes() @ direction, 0.0)
    np.testing.assert_allclose(shown[..., 0], expected, atol=4e-3 * flux)
    np.testing.assert_allclose(shown[..., 1], expected * 1e-5, atol=4e-8 * flux)
    assert not shown[..., 2].any()


@pytest.mark.parametrize("alpha", [0.05, 0.1, 0.4, 1.0])
def test_lobes_of_a_point(alpha):
    """Flux times the lobe D cos / ∫ D cos. Rows are shared between nodes h = π/160 apart, which adds a variance of at
    most h²/4 to a lobe whose curvature at its peak is 4/(2α)²: up to 2 % of the peak at α = 0.05."""
    pixels, direction, flux = one_texel(512, 1024, 350, 777)

    def unscaled(cosine):
        half_squared = 0.5 * (1.0 + cosine)
        return alpha**2 / (half_squared * (alpha**2 - 1.0) + 1.0) ** 2 * np.maximum(cosine, 0.0)

    angle = (np.arange(400000) + 0.5) / 400000 * 0.5 * np.pi
    integral = 2.0 * np.pi * (unscaled(np.cos(angle)) * np.sin(angle)).sum() * 0.5 * np.pi / 400000
    expected = flux * unscaled(nodes() @ direction) / integral
    np.testing.assert_allclose(blurred(harmonics(pixels), lobe(alpha))[..., 0], expected, atol=0.02 * expected.max())


def test_poles_and_seam_agree_with_themselves():
    pixels = np.random.default_rng(8).random((64, 128, 3)).astype(np.float32)
    shown = blurred(harmonics(pixels), lobe(0.1))
    np.testing.assert_array_equal(shown[:, 0], shown[:, -1])
    np.testing.assert_allclose(np.ptp(shown[[0, -1]], axis=1), 0.0, atol=1e-6)
