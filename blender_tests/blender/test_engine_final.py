# SPDX-License-Identifier: GPL-3.0-or-later
"""Final renders through Blender's own operator."""

import json

import bpy
import numpy as np
import pytest

from addon.engine import sessions, statistics
from addon.render import Renderer, device
from blender_tests.blender.engine_fixtures import (  # noqa: F401 - fixtures
    BASE_COLOR,
    OBJECT_INDEX,
    PLANE_DISTANCE,
    add_object,
    add_plane,
    intercept_fixture,
    plane_scene_fixture,
    read_multilayer,
    read_result,
    registered_fixture,
    render,
    use_multilayer,
)

OLD = bpy.app.version < (5, 0, 0)
DIFFUSE_COLOR, INDEX = ("DiffCol", "IndexOB") if OLD else ("Diffuse Color", "Object Index")
INSIDE = (15, 5)
"""A pixel of the plane; its mirror image is background."""
OUTSIDE = (15, 34)


def ask_for_every_pass():
    layer = bpy.context.view_layer
    for flag in ("z", "normal", "position", "diffuse_color", "object_index"):
        setattr(layer, f"use_pass_{flag}", True)


def test_passes_arrive_under_this_versions_names(plane_scene, tmp_path):
    ask_for_every_pass()
    passes = render(plane_scene, tmp_path)
    assert {name.removeprefix("ViewLayer.") for name in passes} >= {
        "Combined",
        "Depth",
        "Normal",
        "Position",
        DIFFUSE_COLOR,
        INDEX,
    }
    np.testing.assert_allclose(passes["ViewLayer.Depth"][INSIDE], PLANE_DISTANCE, rtol=1e-5)
    assert passes["ViewLayer.Depth"][OUTSIDE] > 1e9
    np.testing.assert_allclose(passes["ViewLayer.Normal"][INSIDE], (0, 0, 1), atol=2e-3)
    np.testing.assert_allclose(passes["ViewLayer.Position"][INSIDE][2], 0.0, atol=1e-4)
    assert passes["ViewLayer.Position"][INSIDE][0] < 0
    np.testing.assert_allclose(passes[f"ViewLayer.{DIFFUSE_COLOR}"][INSIDE], BASE_COLOR, atol=5e-3)
    assert passes[f"ViewLayer.{INDEX}"][INSIDE] == OBJECT_INDEX
    np.testing.assert_allclose(passes["ViewLayer.Combined"][INSIDE][:3], BASE_COLOR, rtol=2e-2)


def test_passes_nobody_asked_for_are_not_there(plane_scene, tmp_path):
    layer = bpy.context.view_layer
    for name in layer.bl_rna.properties.keys():  # noqa: SIM118 - Blender's collection iterates values
        if name.startswith("use_pass_") and name != "use_pass_combined" and not name.endswith("accurate"):
            setattr(layer, name, False)
    assert set(render(plane_scene, tmp_path)) == {"ViewLayer.Combined"}


@pytest.mark.parametrize("crop", [True, False])
@pytest.mark.parametrize("border", [(0.3, 0.77, 0.11, 0.52), (0.0, 0.5, 0.5, 1.0), (0.49, 0.52, 0.2, 0.9)])
def test_a_border_shows_the_same_pixels_as_the_whole_frame(plane_scene, tmp_path, border, crop):
    bpy.context.view_layer.use_pass_position = True
    bpy.context.view_layer.use_pass_z = True
    whole = render(plane_scene, tmp_path)
    settings = plane_scene.render
    settings.use_border, settings.use_crop_to_border = True, crop
    settings.border_min_x, settings.border_max_x, settings.border_min_y, settings.border_max_y = border
    part = render(plane_scene, tmp_path)
    height, width = whole["ViewLayer.Depth"].shape[:2]
    left, right, bottom, top = (
        int(np.float32(edge) * np.float32(size))
        for edge, size in zip(border, (width, width, height, height), strict=True)
    )
    rows, columns = slice(height - top, height - bottom), slice(left, right)
    covered = whole["ViewLayer.Depth"][rows, columns, 0] < 1e9
    assert covered.any()
    for name in ("ViewLayer.Position", "ViewLayer.Depth"):
        shown = part[name] if crop else part[name][rows, columns]
        np.testing.assert_allclose(shown[covered], whole[name][rows, columns][covered], rtol=1e-4, atol=1e-4)


def test_a_percentage_scales_the_frame(plane_scene, tmp_path):
    plane_scene.render.resolution_percentage = 50
    assert render(plane_scene, tmp_path)["ViewLayer.Combined"].shape[:2] == (15, 20)


def test_film_transparency(plane_scene, tmp_path):
    assert render(plane_scene, tmp_path)["ViewLayer.Combined"][OUTSIDE][3] == 1.0
    plane_scene.render.film_transparent = True
    combined = render(plane_scene, tmp_path)["ViewLayer.Combined"]
    assert combined[OUTSIDE][3] == 0.0
    assert combined[INSIDE][3] == 1.0


def test_each_view_layer_shows_its_own_collections(plane_scene, tmp_path):
    collection = bpy.data.collections.new("Right")
    plane_scene.collection.children.link(collection)
    other = add_plane("Other", 0.0, 20.0, 1.0)
    plane_scene.collection.objects.unlink(other)
    collection.objects.link(other)
    second = plane_scene.view_layers.new("Second")
    bpy.context.view_layer.layer_collection.children["Right"].exclude = True
    for layer in (bpy.context.view_layer, second):
        layer.use_pass_z = True
    passes = render(plane_scene, tmp_path)
    assert passes["ViewLayer.Depth"][OUTSIDE] > 1e9
    np.testing.assert_allclose(passes["Second.Depth"][OUTSIDE], PLANE_DISTANCE - 1.0, rtol=1e-5)
    assert len(statistics.last(plane_scene.name)["passes"]) > 0


def test_a_frame_of_an_animation_equals_the_frame_alone(plane_scene, tmp_path):
    plane = bpy.data.objects["Plane"]
    for frame, height in ((1, 0.0), (2, 1.0), (3, 2.0)):
        plane.location.z = height
        plane.keyframe_insert("location", index=2, frame=frame)
    bpy.context.view_layer.use_pass_z = True
    plane_scene.frame_start, plane_scene.frame_end = 1, 3
    use_multilayer(plane_scene)
    bpy.ops.render.render(animation=True)
    frames = [read_multilayer(tmp_path / f"frame_{frame:04}.exr") for frame in (1, 2, 3)]
    depths = [frame["ViewLayer.Depth"][INSIDE][0] for frame in frames]
    np.testing.assert_allclose(depths, (5.0, 4.0, 3.0), rtol=1e-5)
    plane_scene.frame_set(2)
    alone = render(plane_scene, tmp_path)
    np.testing.assert_array_equal(alone["ViewLayer.Combined"], frames[1]["ViewLayer.Combined"])


def test_statistics_have_the_documented_keys(plane_scene, tmp_path):
    render(plane_scene, tmp_path)
    last = statistics.last(plane_scene.name)
    assert set(last) == {
        "sync_s",
        "upload_s",
        "first_picture_s",
        "sample_s",
        "total_s",
        "samples",
        "ended_by",
        "passes",
        "left_out",
        "triangles",
        "draws",
        "instances",
        "bytes",
        "warnings",
        "files",
        "engine",
        "device",
        "blender",
    }
    assert json.loads(json.dumps(last)) == last
    assert (last["samples"], last["ended_by"]) == (2, "samples")
    assert last["triangles"] == 2
    assert 0 < last["sync_s"] < last["first_picture_s"] <= last["total_s"]
    names = [item["name"] for item in last["passes"]]
    assert names == ["gbuffer", "depth_tiles", "shadow_maps", "direct", "composite"]


def test_a_time_limit_ends_after_the_first_sample_at_least(plane_scene, tmp_path):
    plane_scene.deep_gbuffer.samples = 1000
    plane_scene.deep_gbuffer.time_limit = 1e-4
    passes = render(plane_scene, tmp_path)
    last = statistics.last(plane_scene.name)
    assert (last["samples"], last["ended_by"]) == (1, "time limit")
    assert passes["ViewLayer.Combined"][INSIDE][0] > 0.1


def test_a_debug_view_replaces_the_picture(plane_scene, tmp_path):
    beauty = render(plane_scene, tmp_path)["ViewLayer.Combined"]
    plane_scene.deep_gbuffer.debug_view = "ALBEDO"
    shown = render(plane_scene, tmp_path)["ViewLayer.Combined"]
    np.testing.assert_allclose(shown[INSIDE][:3], BASE_COLOR, atol=5e-3)
    assert not np.array_equal(shown, beauty)


@pytest.fixture(name="rendered_samples")
def rendered_samples_fixture(monkeypatch):
    """A list that grows with every sample that is rendered, by whomever."""
    samples, original = [], Renderer.render_sample
    monkeypatch.setattr(Renderer, "render_sample", lambda self: samples.append(self) or original(self))
    return samples


def drain():
    """Let the GL thread do whatever it was given."""
    device.gl_thread().submit(lambda _device: None).result(timeout=60)


def test_cancelling_before_the_first_sample_leaves_no_job(plane_scene, intercept, rendered_samples):
    intercept(test_break=lambda: True)
    bpy.ops.render.render()
    assert statistics.last(plane_scene.name)["samples"] == 0
    drain()
    assert not rendered_samples


def test_cancelling_keeps_the_samples_there_are(plane_scene, tmp_path, intercept, rendered_samples):
    progress = []
    intercept(update_progress=progress.append, test_break=lambda: len(progress) >= 3)
    plane_scene.deep_gbuffer.samples = 500
    bpy.ops.render.render()
    assert 3 <= statistics.last(plane_scene.name)["samples"] < 10
    combined = read_result(plane_scene, tmp_path)["ViewLayer.Combined"]
    np.testing.assert_allclose(combined[INSIDE][:3], BASE_COLOR, rtol=2e-2)
    count = len(rendered_samples)
    drain()
    assert len(rendered_samples) == count


def test_control_c_fails_the_operator_and_leaves_no_job(plane_scene, intercept, rendered_samples):
    def interrupted():
        if rendered_samples:
            raise KeyboardInterrupt
        return False

    intercept(test_break=interrupted)
    plane_scene.deep_gbuffer.samples = 500
    with pytest.raises(RuntimeError, match="interrupted") as raised:
        bpy.ops.render.render()
    assert str(raised.value).count("interrupted") == 1
    count = len(rendered_samples)
    drain()
    assert len(rendered_samples) == count


def test_the_picture_refines_while_samples_come_in(plane_scene, intercept):
    updates = []
    intercept(update_result=lambda result: updates.append(result.resolution_x))
    bpy.ops.render.render()
    assert updates[0] == 40


def test_a_scene_whose_camera_is_no_camera_is_an_error_that_says_so(plane_scene):
    plane_scene.camera = add_object("Empty", None, (0, 0, 5))
    with pytest.raises(RuntimeError, match="has no camera"):
        bpy.ops.render.render()


def test_no_opengl_is_an_error_that_says_so(plane_scene, monkeypatch):
    def broken():
        raise device.DeviceError("Deep G-Buffer needs OpenGL 4.1")

    device.stop_gl_thread()
    bpy.ops.wm.read_homefile(use_factory_startup=True)  # forgets the renderers that lived on the thread
    bpy.context.scene.render.engine = "DEEP_GBUFFER"
    monkeypatch.setattr(device, "_create_context", broken)
    with pytest.raises(RuntimeError, match=r"needs OpenGL 4\.1"):
        bpy.ops.render.render()
    device.stop_gl_thread()


def test_a_picture_that_is_too_large_is_an_error_that_says_so(plane_scene, monkeypatch):
    monkeypatch.setattr("addon.render.device.Device.maximum_size", 16, raising=False)
    plane_scene.render.resolution_x, plane_scene.render.resolution_y = 65536, 4
    with pytest.raises(RuntimeError, match="65536"):
        bpy.ops.render.render()


def test_a_fault_of_our_own_is_an_error_too(plane_scene, monkeypatch):
    def broken(_mirror, _depsgraph):
        raise ValueError("impossible")

    monkeypatch.setattr("addon.sync.Mirror.sync", broken)
    with pytest.raises(RuntimeError, match="failed unexpectedly.*impossible"):
        bpy.ops.render.render()


def test_stereo_is_reported_and_fills_every_view(plane_scene, tmp_path, capfd):
    plane_scene.render.use_multiview = True
    use_multilayer(plane_scene)
    plane_scene.render.image_settings.views_format = "MULTIVIEW"
    bpy.ops.render.render(write_still=True)
    passes = read_multilayer(tmp_path / "frame_.exr")
    assert capfd.readouterr().out.count("Stereoscopy is not supported") == 1
    views = [pixels for name, pixels in passes.items() if "Combined" in name]
    assert len(views) == 2
    np.testing.assert_array_equal(*views)


def test_each_warning_is_reported_once_a_job(plane_scene, capfd):
    plane_scene.render.use_multiview = True
    plane_scene.view_layers.new("Second")
    plane_scene.frame_start, plane_scene.frame_end = 1, 3
    bpy.ops.render.render(animation=True)
    assert capfd.readouterr().out.count("Stereoscopy") == 1
    bpy.ops.render.render()
    assert capfd.readouterr().out.count("Stereoscopy") == 1


def test_loading_another_file_frees_what_was_kept(plane_scene, tmp_path):
    render(plane_scene, tmp_path)
    assert sessions._final
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    assert not sessions._final
    assert statistics.last("Scene") is None


def test_what_could_not_be_written_is_in_the_statistics(plane_scene, tmp_path):
    (tmp_path / "file").write_text("in the way")
    ours = plane_scene.deep_gbuffer
    ours.save_deep = True
    ours.layers_path = str(tmp_path / "file" / "shot_")
    render(plane_scene, tmp_path)
    last = statistics.last(plane_scene.name)
    assert last["files"] == []
    assert any("deep samples were not written" in text for text in last["warnings"])
    ours.layers_path = str(tmp_path / "shot_")
    render(plane_scene, tmp_path)
    last = statistics.last(plane_scene.name)
    assert last["files"] == [str(tmp_path / "shot_0001_deep.exr")]
    assert not any("not written" in text for text in last["warnings"])


def test_a_render_that_fails_has_no_statistics_of_the_one_before(plane_scene, tmp_path):
    render(plane_scene, tmp_path)
    assert statistics.last(plane_scene.name) is not None
    plane_scene.render.resolution_x = 60_000
    with pytest.raises(RuntimeError, match="60000"):
        bpy.ops.render.render()
    assert statistics.last(plane_scene.name) is None


@pytest.mark.parametrize("persistent", [False, True])
def test_gpu_data_is_kept_only_with_persistent_data(plane_scene, tmp_path, persistent):
    plane_scene.render.use_persistent_data = persistent
    render(plane_scene, tmp_path)
    kept = [session.renderer is not None for session in sessions._final.values()]
    assert any(kept) == persistent
