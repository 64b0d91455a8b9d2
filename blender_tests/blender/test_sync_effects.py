# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects that are not rendered yet are told in final renders, each once."""

import bpy
import pytest
from engine_fixtures import plane_scene_fixture, registered_fixture  # noqa: F401 - fixtures
from sync_scenes import assert_texts, sync

from addon.engine import statistics


def rendered_warnings(scene: bpy.types.Scene) -> list[str]:
    """What a final render tells."""
    bpy.ops.render.render(scene=scene.name)
    return statistics.last(scene.name)["warnings"]


def ask_for_depth_of_field(scene: bpy.types.Scene) -> None:
    scene.camera.data.dof.use_dof = True


def ask_for_motion_blur(scene: bpy.types.Scene) -> None:
    scene.render.use_motion_blur = True


def ask_for_lights_seen(scene: bpy.types.Scene) -> None:
    for name in ("One", "Two"):
        light = bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT"))
        light.visible_camera = True
        scene.collection.objects.link(light)


@pytest.mark.parametrize(
    ("ask", "text"),
    [
        (ask_for_depth_of_field, "depth of field, which is not rendered yet"),
        (ask_for_motion_blur, "Motion blur is not rendered yet"),
        (ask_for_lights_seen, "Lights are not shown to the camera yet; only what they light is seen of: “One”, “Two”."),
    ],
)
def test_an_effect_is_told_once_and_only_by_final_renders(plane_scene, ask, text):
    assert not bpy.data.objects["Sun"].visible_camera
    assert rendered_warnings(plane_scene) == []
    ask(plane_scene)
    warnings = rendered_warnings(plane_scene)
    assert_texts(warnings, text)
    assert len(warnings) == 1
    assert sync().warnings == ()
