# SPDX-License-Identifier: GPL-3.0-or-later
"""Emissive surfaces as lights."""

from dataclasses import replace

import numpy as np
import pytest

from addon.scene import Channel
from blender_tests import builders


def panel(offset):
    """A tilted square of 50 cm, 1.5 m above the floor, whose vertices are `offset` (3,) from its object's origin.

    It shines down; with its batch, which places it where it would be without.
    """
    turn = np.deg2rad(37.0)
    tilted = np.array([[np.cos(turn), 0.0, np.sin(turn)], [0.0, -1.0, 0.0], [np.sin(turn), 0.0, -np.cos(turn)]])
    quad = builders.quad("panel", half=0.25)
    positions = (quad.positions @ tilted.T + np.array([0.0, 0.0, 1.5]) + offset).astype(np.float32)
    normals = np.tile(tilted[:, 2], (4, 1)).astype(np.float32)
    version = 1 + sum(offset)  # of the same key, so that the same points are drawn from it
    batch = builders.batch("panel", [builders.translation(*(-axis for axis in offset))], materials=("glow",))
    return (
        replace(quad, positions=positions, normals=normals, version=version),
        replace(batch, version=version, seen_by_camera=False),
    )


def floor_light(session, offset):
    """Mean radiance of the floor below a panel."""
    quad, batch = panel(offset)
    glow = builders.material("glow", emission=(10.0, 10.0, 10.0))
    scene = builders.scene(
        builders.quad("floor", half=3.0),
        quad,
        materials=(builders.DIFFUSE, glow),
        batches=[builders.batch("floor"), batch],
    )
    view = session.show(scene, builders.camera(z=4.0, half_width=0.5), width=32, height=32, samples=16)
    return view.channels[Channel.COMBINED][..., :3].mean()


@pytest.mark.parametrize("offset", [(30, 20, 0), (300, 200, 0), (3000, 2000, 0), (-40000, 9000, 7000)])
def test_a_surface_far_from_its_objects_origin_does_not_shadow_itself(shared_session, offset):
    """Its triangles are where float32 puts them, which is not where the light's points are."""
    assert floor_light(shared_session, offset) == pytest.approx(floor_light(shared_session, (0, 0, 0)), rel=0.01)
