# SPDX-License-Identifier: GPL-3.0-or-later
"""The disc of a sky's sun in the background against the formulas of `SunDisc` in float64."""

from dataclasses import replace

import numpy as np
import pytest

from addon.scene import Channel, SunDisc, World
from blender_tests import builders

SIDE, HALF_WIDTH = 64, 0.02
SKY = (0.25, 0.5, 1.0)
SUN = SunDisc(
    direction=(0.0, 0.0, -1.0),
    zenith=(0.0, 0.6, 0.8),
    half_angle=0.01,
    lowest=(1000.0, 100.0, 10.0),
    highest=(3000.0, 2000.0, 1000.0),
    lowest_elevation=-0.008,
    horizon=-0.006,
    limb_darkening=0.6,
)


def sky_behind(*meshes, disc=SUN, **seen):
    """A scene of meshes before a blue sky with a sun, straight ahead of `builders.camera`."""
    return replace(builders.scene(*meshes), world=World(SKY, sun_disc=disc, **seen))


def shown(render, scene, side=SIDE, **settings):
    """(side, side, 3) of the picture, row 0 at the bottom, and all its images."""
    view = render(scene, builders.camera(half_width=HALF_WIDTH), width=side, height=side, **settings)
    return view.channels[Channel.COMBINED][..., :3], view.channels


def angles():
    """(SIDE, SIDE) angle from the disc's centre and elevation above it (rad) through the centres of pixels."""
    across = ((np.arange(SIDE) + 0.5) / SIDE * 2.0 - 1.0) * HALF_WIDTH
    x, y = np.meshgrid(across, across)
    directions = np.stack([x, y, -np.ones_like(x)], axis=-1) / np.sqrt(1.0 + x * x + y * y)[..., None]
    return np.arctan(np.hypot(x, y)), np.arcsin(directions @ SUN.zenith) - np.arcsin(np.dot(SUN.direction, SUN.zenith))


def test_the_disc_darkens_to_its_limb_brightens_upwards_and_ends_at_the_horizon(render):
    angle, elevation = angles()
    height = (elevation - SUN.lowest_elevation) / (SUN.half_angle - SUN.lowest_elevation)
    limb = 1.0 - 0.6 * (1.0 - np.sqrt(np.maximum(1.0 - (angle / SUN.half_angle) ** 2, 0.0)))
    disc = (np.array(SUN.lowest) + (np.array(SUN.highest) - SUN.lowest) * height[..., None]) * limb[..., None]
    inside = (angle < SUN.half_angle) & (elevation > SUN.horizon)
    picture, _ = shown(render, sky_behind())
    # Directions are float32, so angles are known to 1e-7, which is 1e-5 of the disc; √ makes more of it at the limb.
    edge = (np.abs(angle - SUN.half_angle) < 1e-4) | (np.abs(elevation - SUN.horizon) < 1e-6)
    assert 500 < inside.sum() < (angle < SUN.half_angle).sum(), "the horizon must cut it"
    expected = np.where(inside[..., None], disc, 0.0) + SKY
    np.testing.assert_allclose(picture[~edge], expected[~edge], rtol=1e-3)


def test_pixels_that_the_limb_crosses_hold_their_share(render):
    """8 × 8 pixels, each filtered over many samples: together they hold π (half angle)² of radiance."""
    flat = replace(SUN, lowest=(100.0,) * 3, highest=(100.0,) * 3, horizon=-1.5, limb_darkening=0.0)
    picture, _ = shown(render, sky_behind(disc=flat), side=8, samples=64, filter_radius=1.5)
    share = np.pi * np.tan(SUN.half_angle) ** 2 / (2.0 * HALF_WIDTH) ** 2
    # 64 samples of a pixel: the limb passes through at most 24 pixels, each then known to about 1/64 of its value.
    assert (picture - SKY).mean() == pytest.approx(100.0 * share, rel=0.02)
    assert ((picture[..., 0] > 5.0) & (picture[..., 0] < 95.0)).sum() > 8, "the limb must be smooth"


def test_surfaces_hide_it_and_its_pass_is_the_environments(render):
    half = builders.quad("wall", half=1.0, center=(-1.0, 0.0))
    picture, channels = shown(render, sky_behind(half), channels=(Channel.ENVIRONMENT,))
    assert picture[:, : SIDE // 2].max() <= max(SKY) * 0.5, "what is seen is the wall, lit by the sky alone"
    assert picture[:, SIDE // 2 :].max() > 1000.0
    environment = channels[Channel.ENVIRONMENT][..., :3]
    assert not environment[:, : SIDE // 2].any()
    np.testing.assert_array_equal(environment[:, SIDE // 2 :], picture[:, SIDE // 2 :])


def test_a_camera_that_does_not_see_the_world_does_not_see_it(render):
    assert not shown(render, sky_behind(seen_by_camera=False))[0].any()
    assert not shown(render, sky_behind(), transparent_film=True)[0].any()
