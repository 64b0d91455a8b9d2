# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed rooms with light outside: no crease, corner or thin wall lets any of it in; and no surface shadows itself."""

from dataclasses import replace

import numpy as np
import pytest
from closed_forms import facing
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.scene import Camera, Channel, Light, LightKind
from blender_tests import builders


def looking(position, toward, half_width=0.8):
    """A perspective camera at a place in a direction."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = facing(toward), position
    return Camera(matrix, (-half_width, half_width, -half_width, half_width), 0.01, 100.0)


def closed_room():
    """A room of 4×4×4 m of sheets without thickness, in it ledges and a beam that touch walls and ceiling."""
    boxes = [
        scaled((0.0, 0.0, 0.0), (2.0, 2.0, 2.0)),
        scaled((0.0, 1.85, 1.85), (2.0, 0.15, 0.15)),
        scaled((-1.9, 0.0, 0.3), (0.1, 2.0, 0.05)),
        scaled((0.5, 1.7, 0.0), (0.1, 0.3, 2.0)),
    ]
    return builders.scene(builders.box("box"), batches=[builders.batch("box", boxes)])


def scaled(center, halves):
    """A box's matrix."""
    matrix = builders.translation(*center)
    matrix[:3, :3] = np.diag(halves)
    return matrix


def sun(direction, angle=0.01):
    """A bright sun that shines along a direction."""
    matrix = np.eye(4)
    matrix[:3, :3] = facing(direction)
    return Light(f"sun {direction}", "sun", LightKind.SUN, matrix, (10.0, 10.0, 10.0), angle=angle)


SIDE = 48
LEAK = 1.0 / SIDE**2
"""Of what the light does without shadows, mean over the picture: one pixel of it, whose surface is within 1/256 of a
pixel of a crease, so that it may as well be outside."""

CORNERS = [(0.2, 1.0, 0.8), (-1.0, 0.6, 0.1), (1.0, 1.0, -0.6)]
"""Directions in which a camera in the room looks."""


def leaked(session, light, look, samples):
    """Mean radiance in the closed room, as a share of a wall's that faces the light at 2 m in the open."""
    scene = replace(closed_room(), lights=(light,))
    view = session.show(scene, looking((-0.3, -0.5, 0.2), look), width=SIDE, height=SIDE, samples=samples)
    facing_it = max(light.emission) / (1.0 if light.kind is LightKind.SUN else 4.0)
    return view.channels[Channel.COMBINED][..., :3].mean() / (0.5 / np.pi * facing_it)


@settings(max_examples=15)
@given(
    azimuth=st.floats(0.1, 0.5 * np.pi - 0.1),
    quarter=st.integers(0, 3),
    elevation=st.floats(0.1, 1.4),
    below=st.booleans(),
    look=st.sampled_from(CORNERS),
)
def test_no_sun_shines_into_a_closed_room(shared_session, azimuth, quarter, elevation, below, look):
    """From anywhere but along a wall: a sheet seen edge on covers nothing, nor the half texel beside it."""
    azimuth, elevation = azimuth + 0.5 * np.pi * quarter, -elevation if below else elevation
    direction = (np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), -np.sin(elevation))
    assert leaked(shared_session, sun(direction), look, samples=4) <= LEAK


@pytest.mark.parametrize("samples", [1, 8])
@pytest.mark.parametrize("look", CORNERS)
@pytest.mark.parametrize("position", [(0.0, 0.0, 3.0), (3.0, 2.5, 2.2), (-2.1, 0.3, 0.4)])
def test_no_lamp_shines_into_a_closed_room(shared_session, position, look, samples):
    light = builders.light(position=position, emission=(50.0, 50.0, 50.0), radius=0.05)
    assert leaked(shared_session, light, look, samples) <= LEAK


@settings(max_examples=15)
@given(azimuth=st.floats(0.0, 2.0 * np.pi), elevation=st.floats(0.01, 1.5))
def test_a_plane_does_not_shadow_itself(shared_session, azimuth, elevation):
    """Light at any angle, down to half a degree: the same as without shadows."""
    direction = (np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), -np.sin(elevation))
    light = sun(direction, angle=0.001)
    scene = builders.scene(builders.quad("floor", half=20.0), lights=(light,))
    camera = looking((0.0, -3.0, 1.0), (0.0, 1.0, -0.4))
    pictures = [
        shared_session.show(replace(scene, lights=(each,)), camera, samples=4).channels[Channel.COMBINED]
        for each in (light, replace(light, casts_shadow=False))
    ]
    np.testing.assert_allclose(pictures[0], pictures[1], rtol=1e-4)
