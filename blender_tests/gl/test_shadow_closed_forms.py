# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadows of straight edges against closed forms: a pixel gets the light of the part of the lamp that it sees."""

from dataclasses import replace

import numpy as np
import pytest
from closed_forms import clipped, disk_share, polygon_irradiance, rectangle_corners

from addon.scene import AreaShape, Channel, LightKind
from blender_tests import builders

RHO = 0.5
SAMPLES = 256
WIDTH = 64
HALF_VIEW = 1.5
"""Half the width (m) of the floor that the camera sees."""

LAMP_HEIGHT, SCREEN_HEIGHT = 4.0, 1.0

PENUMBRA = 0.02
"""Of the whole light: V jumps at the edge's image on the lamp, so 256 points are off by their discrepancy across one
direction, a few of 256, and by what half a texel of the shadow map is worth, below 1/256 of the penumbra."""

UP = np.array([0.0, 0.0, 1.0])


def floor_and_screen(light, specular=0.0):
    """A floor, and above it a screen that covers x < 0 and reaches far beyond the picture; seen by no camera."""
    floor = builders.quad("floor", half=50.0)
    screen = builders.mesh(
        "screen",
        [(-40, -40, SCREEN_HEIGHT), (0, -40, SCREEN_HEIGHT), (0, 40, SCREEN_HEIGHT), (-40, 40, SCREEN_HEIGHT)],
        [(0, 1, 2), (0, 2, 3)],
    )
    batches = [builders.batch("floor"), replace(builders.batch("screen"), seen_by_camera=False)]
    surface = builders.material(specular=specular)
    return builders.scene(floor, screen, materials=(surface,), lights=(light,), batches=batches)


def row_of_light(session, light, samples=SAMPLES):
    """x (W,) of the middle row's pixels, and what it receives there, W/m² (W,)."""
    camera = builders.camera(z=3.0, half_width=HALF_VIEW, orthographic=True)
    view = session.show(floor_and_screen(light), camera, width=WIDTH, height=WIDTH, samples=samples)
    x = ((np.arange(WIDTH) + 0.5) / WIDTH * 2.0 - 1.0) * HALF_VIEW
    return x, view.channels[Channel.COMBINED][WIDTH // 2, :, 0].astype(np.float64) * np.pi / RHO


def assert_shadow(found, expected, whole):
    """Penumbra within tolerance, umbra exactly dark, full light as without a screen."""
    shares = expected / whole
    assert (shares == 0.0).sum() >= 4, "the case must have an umbra"
    assert ((shares > 0.1) & (shares < 0.9)).sum() >= 3, "the case must have a penumbra"
    # A shadow map's texels may be as large as pixels: then the pixel beside an edge has its neighbour's shadow.
    umbra = (shares == 0.0) & (np.roll(shares, -1) == 0.0)
    lit = (shares > 1.0 - 1e-9) & (np.roll(shares, 1) > 1.0 - 1e-9)
    leak = found[umbra] / whole[umbra]
    assert not leak.any(), f"light leaks into the umbra: {leak}"
    np.testing.assert_allclose(found / whole, shares, atol=PENUMBRA)
    np.testing.assert_allclose(found[lit], whole[lit], rtol=2e-3)


@pytest.mark.parametrize("size", [(1.2, 1.2), (0.8, 2.4)])
def test_rectangle_behind_an_edge(shared_session, size):
    """The plane through a pixel and the screen's edge cuts the rectangle; Lambert's sum over what is left."""
    light = builders.light(LightKind.AREA, (0.2, 0.0, LAMP_HEIGHT), (5, 5, 5), size=size)
    x, found = row_of_light(shared_session, light)
    y = HALF_VIEW / WIDTH  # of the row's centre
    expected, whole = [], []
    for place in x:
        corners = rectangle_corners(
            (0.2 - place, -y, LAMP_HEIGHT), (0.5 * size[0], 0.0, 0.0), (0.0, 0.5 * size[1], 0.0)
        )
        open_side = np.array([SCREEN_HEIGHT, 0.0, place])  # normal of the plane through pixel and edge
        whole.append(polygon_irradiance(corners, UP, 5.0))
        expected.append(polygon_irradiance(clipped(corners, open_side), UP, 5.0))
    assert_shadow(found, np.array(expected), np.array(whole))


def test_sun_behind_an_edge(shared_session):
    """Share of the sun's disc beyond the edge, each part with its own elevation; by the midpoint rule over the disc."""
    angle = 0.3
    light = builders.light(LightKind.SUN, emission=(3, 3, 3), angle=angle)
    x, found = row_of_light(shared_session, light)
    # Directions uniform in solid angle: z uniform from the cone's cosine to 1.
    z = 1.0 - (1.0 - np.cos(0.5 * angle)) * (np.arange(400) + 0.5) / 400
    around = np.cos(2.0 * np.pi * (np.arange(400) + 0.5) / 400)
    slope = (np.sqrt(1.0 - z * z) / z)[:, None] * around
    weight = z[:, None] / z.mean()
    seen = x[:, None, None] + SCREEN_HEIGHT * slope > 0.0
    expected = 3.0 * (seen * weight).mean(axis=(1, 2))
    assert_shadow(found, expected, np.full(WIDTH, 3.0))


@pytest.mark.parametrize("soft", [False, True])
def test_small_sphere_behind_an_edge(shared_session, soft):
    """A lamp far off for its size: the share of its disk. Over it, cosine and distance vary by (r/d)² = 1.6 %, of which
    the part that is not even in the offset changes the penumbra."""
    radius = 0.5
    light = builders.light(position=(0.0, 0.0, LAMP_HEIGHT), emission=(8, 8, 8), radius=radius, soft_falloff=soft)
    x, found = row_of_light(shared_session, light)
    distance = np.sqrt(x**2 + LAMP_HEIGHT**2)
    whole = 8.0 * LAMP_HEIGHT / distance**3
    if soft:
        whole = 8.0 * LAMP_HEIGHT / distance / (distance**2 + radius**2)
    # The plane through pixel and edge, and how far from it the lamp's centre is.
    away = (-x * (LAMP_HEIGHT - SCREEN_HEIGHT)) / np.sqrt(SCREEN_HEIGHT**2 + x**2)
    expected = whole * disk_share(away / radius)
    expected[away >= radius] = 0.0
    expected[away <= -radius] = whole[away <= -radius]
    edge = np.abs(np.abs(away) - radius) < 0.02 * radius  # a sphere and its disk end at angles that differ by (r/d)²
    found[edge], expected[edge] = whole[edge], whole[edge]
    assert_shadow(found, expected, whole)


def test_lamp_without_size_has_a_hard_edge(shared_session):
    """Dark or wholly lit, but for the pixel that the edge is in."""
    light = builders.light(position=(0.0, 0.0, LAMP_HEIGHT), emission=(8, 8, 8))
    x, found = row_of_light(shared_session, light, samples=4)
    whole = 8.0 * LAMP_HEIGHT / np.sqrt(x**2 + LAMP_HEIGHT**2) ** 3
    clear = np.abs(x) > 1.5 * HALF_VIEW * 2.0 / WIDTH
    np.testing.assert_allclose(found[clear], np.where(x < 0.0, 0.0, whole)[clear], rtol=2e-3)
    assert (found[clear & (x < 0.0)] == 0.0).all()


@pytest.mark.parametrize(
    "arguments",
    [
        {"kind": LightKind.POINT, "radius": 0.2},
        {"kind": LightKind.SUN, "angle": 0.2},
        {"kind": LightKind.AREA, "size": (0.5, 0.5), "shape": AreaShape.ELLIPSE},
    ],
)
def test_what_casts_no_shadow_is_not_there(shared_session, arguments):
    """A lamp without shadows, and a screen that casts none, give equal pictures: those without the screen."""
    light = builders.light(position=(0.0, 0.0, LAMP_HEIGHT), **arguments)
    camera = builders.camera(z=3.0, half_width=HALF_VIEW, orthographic=True)
    scene = floor_and_screen(light)
    floor, screen = scene.batches
    pictures = [
        shared_session.show(changed, camera, samples=4).channels[Channel.COMBINED]
        for changed in (
            replace(scene, batches=(floor,)),
            replace(scene, batches=(floor, replace(screen, casts_shadow=False))),
            replace(scene, lights=(replace(light, casts_shadow=False),)),
            scene,
        )
    ]
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=1e-5)
    np.testing.assert_allclose(pictures[2], pictures[0], rtol=1e-5)
    assert not np.allclose(pictures[3], pictures[0], rtol=0.1)


def test_linked_lights(shared_session):
    """A lamp lights only the groups that receive it, and only the groups that block it shadow it."""
    light = builders.light(position=(0.0, 0.0, LAMP_HEIGHT))
    camera = builders.camera(z=3.0, half_width=HALF_VIEW, orthographic=True)
    scene = floor_and_screen(light)
    floor, screen = scene.batches

    def picture(light, floor_group=0, screen_group=0):
        batches = (
            replace(floor, link_group=floor_group, version=1 + floor_group),
            replace(screen, link_group=screen_group, version=1 + screen_group),
        )
        changed = replace(scene, lights=(light,), batches=batches)
        return shared_session.show(changed, camera, samples=2).channels[Channel.COMBINED][..., :3]

    shadowed, whole = picture(light), picture(replace(light, casts_shadow=False))
    assert not picture(replace(light, receiver_groups=0b10)).any(), "group 0 receives nothing"
    np.testing.assert_array_equal(picture(replace(light, receiver_groups=0b10), 1, 0), shadowed)
    np.testing.assert_allclose(picture(replace(light, blocker_groups=0b01), 0, 1), whole, rtol=1e-5)
    np.testing.assert_array_equal(picture(replace(light, blocker_groups=0b10), 0, 1), shadowed)
