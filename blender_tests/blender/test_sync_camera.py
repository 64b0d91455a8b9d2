# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras project points where Blender does."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mathutils import Euler, Matrix, Vector
from sync_scenes import depsgraph, link, sync

from addon.scene import Camera
from addon.sync import render_camera, viewport_camera


def project(camera: Camera, point: Vector) -> np.ndarray:
    """Image position of a world point in fractions 0…1 of the picture, and its view depth."""
    local = np.linalg.inv(camera.world_from_camera) @ np.array([*point, 1.0])
    clip = camera.projection(zero_to_one_depth=True) @ local
    return np.array([*(clip[:2] / clip[3] * 0.5 + 0.5), -local[2]])


def add_camera(scene: bpy.types.Scene) -> bpy.types.Object:
    scene.camera = link("Camera", bpy.data.cameras.new("Camera"))
    return scene.camera


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    kind=st.sampled_from(["PERSP", "ORTHO"]),
    fit=st.sampled_from(["AUTO", "HORIZONTAL", "VERTICAL"]),
    resolution=st.tuples(st.integers(8, 400), st.integers(8, 400)),
    aspect=st.tuples(st.floats(1, 3), st.floats(1, 3)),
    shift=st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    lens=st.floats(10, 200),
    sensor=st.tuples(st.floats(10, 60), st.floats(10, 60)),
    pose=st.tuples(*[st.floats(-3, 3)] * 6),
    scale=st.tuples(*[st.floats(0.2, 5)] * 3),
)
def test_projection_equals_blenders(empty_scene, kind, fit, resolution, aspect, shift, lens, sensor, pose, scale):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    camera = add_camera(scene)
    data = camera.data
    data.type, data.sensor_fit, data.lens, data.ortho_scale = kind, fit, lens, lens / 20.0
    data.sensor_width, data.sensor_height = sensor
    data.shift_x, data.shift_y = shift
    camera.location, camera.rotation_euler, camera.scale = pose[:3], pose[3:], scale
    scene.render.resolution_x, scene.render.resolution_y = resolution
    scene.render.resolution_percentage = 100
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect
    mirrored = render_camera(depsgraph(), *resolution)
    np.testing.assert_allclose(mirrored.rotation @ mirrored.rotation.T, np.eye(3), atol=1e-6)
    rigid = Matrix.LocRotScale(camera.location, Euler(pose[3:]), None)
    for offset in ((0.3, 0.1, -2.0), (-1.0, 0.7, -5.0), (0.0, -0.4, -30.0)):
        point = rigid @ Vector(offset)
        expected = np.array(world_to_camera_view(scene, camera, point))
        np.testing.assert_allclose(project(mirrored, point), expected, rtol=2e-4, atol=2e-4)


@pytest.mark.parametrize("scale", [(-1, 1, 1), (1, -2, 1), (1, 1, -1), (-1, -1, 1), (-1, -1, -3)])
@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_a_camera_that_is_mirrored_mirrors_the_picture(empty_scene, scale, kind):
    """As in Blender and Cycles, which normalise the matrix's columns and keep their signs."""
    camera = add_camera(empty_scene)
    camera.data.type, camera.data.shift_x, camera.data.shift_y = kind, 0.2, -0.1
    camera.location, camera.rotation_euler, camera.scale = (1, 2, 3), (0.5, 0.1, 0.7), scale
    graph = depsgraph()
    mirrored = render_camera(graph, 300, 200)
    assert np.linalg.det(mirrored.rotation) == pytest.approx(1.0)
    frame = camera.matrix_world.copy()
    for column in range(3):
        frame.col[column] = frame.col[column].normalized()
    projection = camera.calc_matrix_camera(graph, x=300, y=200)
    space, region_3d = viewport(projection, frame.inverted(), "CAMERA")
    for offset in ((0.3, 0.1, -2.0), (-1.0, 0.7, -5.0)):
        point = frame @ Vector(offset)
        clip = projection @ Vector((*offset, 1.0))
        expected = [clip.x / clip.w * 0.5 + 0.5, clip.y / clip.w * 0.5 + 0.5, -offset[2]]
        np.testing.assert_allclose(project(mirrored, point), expected, atol=1e-5)
        np.testing.assert_allclose(project(viewport_camera(graph, space, region_3d), point), expected, atol=1e-5)
        left = project(mirrored.cropped(0.0, 0.5, 0.0, 1.0), point)
        np.testing.assert_allclose(left, (2 * expected[0], *expected[1:]), atol=1e-5)


def test_synced_camera_has_the_scenes_resolution(empty_scene):
    camera = add_camera(empty_scene)
    camera.data.clip_start, camera.data.clip_end = 0.25, 77.0
    empty_scene.render.resolution_x, empty_scene.render.resolution_y = 400, 100
    left, right, bottom, top = sync().scene.camera.window
    assert (right - left) / (top - bottom) == pytest.approx(4.0)
    assert (sync().scene.camera.clip_start, sync().scene.camera.clip_end) == (0.25, 77.0)


def test_no_camera(empty_scene):
    assert sync().scene.camera is None
    assert render_camera(depsgraph(), 10, 10) is None


def test_panoramic_camera_is_told_and_shown_in_perspective(empty_scene):
    add_camera(empty_scene).data.type = "PANO"
    result = sync()
    assert not result.scene.camera.orthographic
    assert any("“Camera”" in text and "panoramic" in text for text in result.warnings)


def viewport(window: Matrix, view: Matrix, perspective: str) -> tuple[SimpleNamespace, SimpleNamespace]:
    space = SimpleNamespace(clip_start=0.01, clip_end=1000.0, camera=None, use_local_camera=False)
    return space, SimpleNamespace(window_matrix=window, view_matrix=view, view_perspective=perspective)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_viewport_camera_view_follows_zoom_and_offset(empty_scene, kind):
    """A camera view that is zoomed and moved: the image Blender would draw, whatever the region's shape."""
    camera = add_camera(empty_scene)
    camera.data.type, camera.data.shift_x = kind, 0.2
    camera.location, camera.rotation_euler = (1, 2, 3), (0.5, 0.1, 0.7)
    graph = depsgraph()
    zoom = Matrix.Translation((0.3, -0.2, 0)) @ Matrix.Diagonal((0.5, 0.6, 1, 1))
    window = zoom @ camera.calc_matrix_camera(graph, x=300, y=200)
    space, region_3d = viewport(window, camera.matrix_world.inverted(), "CAMERA")
    mirrored = viewport_camera(graph, space, region_3d)
    assert mirrored.clip_start == pytest.approx(camera.data.clip_start, rel=1e-4)
    assert mirrored.orthographic == (kind == "ORTHO")
    for offset in ((0.3, 0.1, -2.0), (-1.0, 0.7, -5.0)):
        point = camera.matrix_world @ Vector(offset)
        clip = window @ camera.matrix_world.inverted() @ point.to_4d()
        expected = [clip.x / clip.w * 0.5 + 0.5, clip.y / clip.w * 0.5 + 0.5]
        np.testing.assert_allclose(project(mirrored, point)[:2], expected, atol=1e-5)


def test_free_orthographic_view_sees_behind_itself(empty_scene):
    window = Matrix(((0.2, 0, 0, 0.1), (0, 0.3, 0, -0.1), (0, 0, -2 / 1000, 0), (0, 0, 0, 1)))
    view = Matrix.LocRotScale(Vector((1, 2, -9)), Euler((0.4, 0.2, 0.9)), None)
    space, region_3d = viewport(window, view, "ORTHO")
    mirrored = viewport_camera(depsgraph(), space, region_3d)
    behind = view.inverted() @ Vector((0.5, -0.5, 400.0))
    x, y, depth = project(mirrored, behind)
    assert mirrored.clip_start < depth < mirrored.clip_end
    np.testing.assert_allclose((x, y), ((0.2 * 0.5 + 0.1) * 0.5 + 0.5, (0.3 * -0.5 - 0.1) * 0.5 + 0.5), atol=1e-5)


def test_free_perspective_takes_the_spaces_clip_range(empty_scene):
    window = Matrix(((1.5, 0, 0, 0), (0, 2, 0, 0), (0, 0, -1.00002, -0.020002), (0, 0, -1, 0)))
    space, region_3d = viewport(window, Matrix.Identity(4), "PERSP")
    mirrored = viewport_camera(depsgraph(), space, region_3d)
    assert (mirrored.clip_start, mirrored.clip_end) == (0.01, 1000.0)
    np.testing.assert_allclose(mirrored.window, (-1 / 1.5, 1 / 1.5, -0.5, 0.5))
