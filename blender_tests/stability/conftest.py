# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on and a good scene, for tests that put trouble into it."""

from collections.abc import Iterator

import bpy
import pytest
from troubled_scenes import GOOD, add

import addon


@pytest.fixture(scope="module", autouse=True)
def registered() -> Iterator[None]:
    """The add-on, for all tests of the module."""
    addon.register()
    yield
    addon.unregister()


@pytest.fixture
def scene() -> bpy.types.Scene:
    """A lit plane that fills the lower half of a small picture."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    result = bpy.context.scene
    result.render.engine = "DEEP_GBUFFER"
    result.render.resolution_x, result.render.resolution_y, result.render.resolution_percentage = 32, 24, 100
    result.deep_gbuffer.samples = 2
    layer = result.view_layers[0]
    for name in ("z", "normal", "position", "diffuse_color"):
        setattr(layer, f"use_pass_{name}", True)
    add(GOOD, [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [(0, 1, 2, 3)])
    light = bpy.data.lights.new("Sun", "SUN")
    result.collection.objects.link(bpy.data.objects.new("Sun", light))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -4.0, 1.0), (1.57, 0.0, 0.0)
    result.collection.objects.link(camera)
    result.camera = camera
    return result
