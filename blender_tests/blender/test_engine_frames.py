# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames before the rendered one: read in order, left as found, and no picture depends on what came before it."""

import bpy
import numpy as np
import OpenEXR
import pytest

from addon.engine import sessions, statistics
from addon.render import Renderer
from addon.scene import Variant, snapshot
from addon.sync import Mirror
from blender_tests.blender.engine_fixtures import (  # noqa: F401 - fixtures
    add_object,
    animate,
    intercept_fixture,
    moving_scene_fixture,
    plane_scene_fixture,
    read_multilayer,
    registered_fixture,
    render,
    use_multilayer,
)

FRAME = 4
FRAMES_BEFORE = {"TWO_PASS": 0, "PREPASS": 0, "DELAY": 0, "PREVIOUS": 1, "REPROJECT": 1, "PREDICT": 2}
CAMERA_STEP, BOX_STEP, SAIL_STEP = 0.125, -0.25, 0.125


@pytest.fixture(name="begun")
def begun_fixture(monkeypatch):
    """The arguments of every `Renderer.begin`: scene, camera, settings, sequence."""
    calls, original = [], Renderer.begin

    def begin(self, *arguments):
        calls.append(arguments)
        return original(self, *arguments)

    monkeypatch.setattr(Renderer, "begin", begin)
    return calls


@pytest.fixture(name="synced")
def synced_fixture(monkeypatch):
    """The frames of every `Mirror.sync`, with their fractions."""
    frames, original = [], Mirror.sync

    def sync(self, depsgraph):
        frames.append(depsgraph.scene.frame_current + depsgraph.scene.frame_subframe)
        return original(self, depsgraph)

    monkeypatch.setattr(Mirror, "sync", sync)
    return frames


def choose(scene, variant, frame=FRAME, subframe=0.0):
    """Choose a variant, without what else reads other frames, and go to a frame."""
    scene.deep_gbuffer.variant = variant
    scene.deep_gbuffer.save_motion = False
    scene.frame_set(frame, subframe=subframe)


def assert_shows(scene, camera, frame):
    """A mirrored scene and its camera show the moving scene at a frame."""
    assert camera.position[0] == pytest.approx(CAMERA_STEP * frame)
    batches = {scene.meshes[batch.mesh].name: batch for batch in scene.batches}
    assert batches["Box"].matrices[0, 0, 3] == pytest.approx(BOX_STEP * frame)
    heights = scene.meshes[batches["Sail"].mesh].positions[:, 2]
    np.testing.assert_allclose(heights, SAIL_STEP * frame, atol=1e-6)


@pytest.mark.parametrize("subframe", [0.0, 0.5])
@pytest.mark.parametrize(("variant", "count"), FRAMES_BEFORE.items())
def test_the_frames_that_a_variant_needs_come_oldest_first(moving_scene, begun, synced, variant, count, subframe):
    choose(moving_scene, variant, subframe=subframe)
    bpy.ops.render.render()
    now = FRAME + subframe
    assert synced == [now - distance for distance in range(count, -1, -1)]
    scene, camera, _settings, sequence = begun[0]
    assert_shows(scene, camera, now)
    assert not sequence.continuous
    assert sequence.following is None
    moments = (sequence.previous, sequence.earlier)
    assert [moment is not None for moment in moments] == [count > 0, count > 1]
    for distance, moment in enumerate(moments[:count], 1):
        assert_shows(moment.scene, moment.camera, now - distance)


def test_blender_is_at_the_frame_afterwards(moving_scene):
    choose(moving_scene, "PREDICT", subframe=0.25)
    bpy.ops.render.render()
    assert (moving_scene.frame_current, moving_scene.frame_subframe) == (FRAME, 0.25)
    assert bpy.data.objects["Box"].matrix_world.translation.x == pytest.approx(BOX_STEP * (FRAME + 0.25))


def test_motion_alone_needs_one_frame_before(moving_scene, synced):
    moving_scene.frame_set(FRAME)
    bpy.ops.render.render()
    assert synced == [FRAME - 1, FRAME]


def test_a_variant_whose_layers_nothing_reads_needs_no_other_frame(moving_scene, synced):
    choose(moving_scene, "PREDICT")
    moving_scene.deep_gbuffer.save_layers = False
    bpy.ops.render.render()
    assert synced == [FRAME]


def test_what_rests_is_the_same_object_in_every_frame(moving_scene, begun):
    choose(moving_scene, "PREDICT")
    bpy.ops.render.render()
    scene, _camera, _settings, sequence = begun[0]
    plane = next(key for key, mesh in scene.meshes.items() if mesh.name == "Plane")
    sail = next(key for key, mesh in scene.meshes.items() if mesh.name == "Sail")
    for moment in (sequence.previous, sequence.earlier):
        assert moment.scene.meshes[plane] is scene.meshes[plane]
        assert moment.scene.meshes[sail] is not scene.meshes[sail]


def test_a_border_shows_the_same_part_of_every_frame(moving_scene, begun):
    choose(moving_scene, "PREDICT")
    settings = moving_scene.render
    settings.use_border, settings.use_crop_to_border = True, True
    settings.border_min_x, settings.border_max_x, settings.border_min_y, settings.border_max_y = 0.25, 0.75, 0.5, 1.0
    bpy.ops.render.render()
    _scene, camera, render_settings, sequence = begun[0]
    assert (render_settings.width, render_settings.height) == (32, 18)
    assert sequence.previous.camera.window == sequence.earlier.camera.window == camera.window


def test_markers_switch_the_camera_of_each_frame(moving_scene, begun):
    other = add_object("Other", bpy.data.cameras.new("Other"), (7.0, 0.0, 5.0))
    for frame, camera in ((0, other), (FRAME, moving_scene.camera)):
        moving_scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    choose(moving_scene, "PREVIOUS")
    bpy.ops.render.render()
    _scene, camera, _settings, sequence = begun[0]
    assert camera.position[0] == pytest.approx(CAMERA_STEP * FRAME)
    assert sequence.previous.camera.position[0] == 7.0
    assert moving_scene.camera.name == "Camera"


def test_a_frame_without_a_camera_is_no_frame_before(moving_scene, begun):
    empty = add_object("Empty", None, (0.0, 0.0, 5.0))
    for frame, camera in ((0, moving_scene.camera), (FRAME - 1, empty), (FRAME, moving_scene.camera)):
        moving_scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    choose(moving_scene, "PREDICT")
    bpy.ops.render.render()
    sequence = begun[0][3]
    assert sequence.previous is None
    assert sequence.earlier is None


def test_warnings_of_other_frames_are_not_reported(moving_scene):
    bare = add_object("Bare", bpy.data.meshes.new("Bare"), (0.0, 0.0, 0.0))
    for frame, hidden in ((FRAME - 1, False), (FRAME, True)):
        bare.hide_render = hidden
        bare.keyframe_insert("hide_render", frame=frame)
    choose(moving_scene, "PREVIOUS")
    bpy.ops.render.render()
    assert not any("Bare" in text for text in statistics.last("Scene")["warnings"])
    choose(moving_scene, "PREVIOUS", FRAME - 1)
    bpy.ops.render.render()
    assert any("Bare" in text for text in statistics.last("Scene")["warnings"])


@pytest.mark.parametrize("frames", [0, 1, 2])
def test_cancelling_while_frames_are_read_leaves_blender_at_its_frame(moving_scene, begun, synced, intercept, frames):
    intercept(test_break=lambda: len(synced) >= frames)
    choose(moving_scene, "PREDICT")
    bpy.ops.render.render()
    assert len(synced) == frames
    assert not begun
    assert statistics.last("Scene")["samples"] == 0
    assert moving_scene.frame_current == FRAME
    assert bpy.data.objects["Box"].matrix_world.translation.x == pytest.approx(BOX_STEP * FRAME)


def test_a_fault_while_frames_are_read_leaves_blender_at_its_frame(moving_scene, monkeypatch):
    def broken(_mirror, _depsgraph):
        raise ValueError("impossible")

    choose(moving_scene, "PREDICT")
    with monkeypatch.context() as patch:
        patch.setattr(Mirror, "sync", broken)
        with pytest.raises(RuntimeError, match="failed unexpectedly.*impossible"):
            bpy.ops.render.render()
    assert moving_scene.frame_current == FRAME
    assert bpy.data.objects["Box"].matrix_world.translation.x == pytest.approx(BOX_STEP * FRAME)


@pytest.mark.parametrize("variant", ["TWO_PASS", "PREVIOUS", "PREDICT"])
def test_a_snapshot_holds_the_frames_that_its_picture_needs(moving_scene, tmp_path, variant):
    choose(moving_scene, variant)
    moving_scene.deep_gbuffer.save_snapshot = True
    moving_scene.deep_gbuffer.layers_path = f"{tmp_path}/shot_"
    bpy.ops.render.render()
    saved = snapshot.load(tmp_path / f"shot_{FRAME:04}_snapshot.npz")
    scenes = (saved.scene, saved.previous, saved.earlier)
    count = FRAMES_BEFORE[variant]
    assert [scene is not None for scene in scenes] == [True, count > 0, count > 1]
    for distance, scene in enumerate(scenes[: count + 1]):
        assert_shows(scene, scene.camera, FRAME - distance)


def files(folder, frame):
    """Every channel of the layer file of a frame."""
    with OpenEXR.File(str(folder / f"shot_{frame:04}_layers.exr"), separate_channels=True) as file:
        return {name: np.array(channel.pixels) for name, channel in file.channels().items()}


@pytest.mark.parametrize("persistent", [False, True])
@pytest.mark.parametrize("variant", list(Variant))
def test_a_frame_alone_equals_the_frame_in_an_animation(moving_scene, tmp_path, variant, persistent):
    """Every bit of the picture, its passes and every channel of every layer."""
    ours = moving_scene.deep_gbuffer
    ours.variant, ours.layers_path, ours.layers = variant.value, f"{tmp_path}/animated/shot_", 3
    ours.use_guard_band, ours.guard_band_pixels = True, 4
    moving_scene.render.use_persistent_data = persistent
    moving_scene.frame_start, moving_scene.frame_end = FRAME - 1, FRAME + 1
    use_multilayer(moving_scene)
    bpy.ops.render.render(animation=True)
    sessions.release()
    ours.layers_path = f"{tmp_path}/alone/shot_"
    for frame in (FRAME + 1, FRAME):
        moving_scene.frame_set(frame)
        alone = render(moving_scene, tmp_path)
        animated = read_multilayer(tmp_path / f"frame_{frame:04}.exr")
        assert alone.keys() == animated.keys()
        for name, pixels in alone.items():
            np.testing.assert_array_equal(pixels, animated[name], name)
        layers, others = files(tmp_path / "alone", frame), files(tmp_path / "animated", frame)
        assert layers.keys() == others.keys()
        for name, pixels in layers.items():
            np.testing.assert_array_equal(pixels, others[name], name)
    assert (layers["layer1.Depth.Z"] < 1e10).mean() > 0.05


def test_a_layer_file_holds_motion_and_exit_surfaces(moving_scene, tmp_path):
    """Of the box, 1 m deep and nearest in the middle, and the plane below it, which nothing closes."""
    moving_scene.deep_gbuffer.layers_path = f"{tmp_path}/shot_"
    moving_scene.deep_gbuffer.save_deep = True
    moving_scene.frame_set(1)
    render(moving_scene, tmp_path)
    layers = files(tmp_path, 1)
    row, column = 18, 32
    assert layers["layer0.Depth.Z"][row, column] == pytest.approx(2.5, rel=1e-5)
    assert layers["layer0.ExitDepth.Z"][row, column] == pytest.approx(3.5, rel=1e-5)
    normal = [layers[f"layer0.ExitNormal.{axis}"][row, column] for axis in "XYZ"]
    np.testing.assert_allclose(normal, (0.0, 0.0, 1.0), atol=1.01 / 255)  # octahedral, in steps of 2/255
    window = moving_scene.camera.data.sensor_width / moving_scene.camera.data.lens
    expected = (BOX_STEP - CAMERA_STEP) / 2.5 / window * 64
    assert layers["layer0.Motion.X"][row, column] == pytest.approx(expected, rel=2e-3)
    assert layers["layer0.Motion.Y"][row, column] == pytest.approx(0.0, abs=1e-3)
    assert layers["layer1.ExitDepth.Z"][row, column - 1] == np.float32(1e10)
    with OpenEXR.File(str(tmp_path / "shot_0001_deep.exr"), separate_channels=True) as file:
        channels = file.channels()
        np.testing.assert_allclose(channels["Z"].pixels[row, column], (2.5, 3.5), rtol=1e-5)
        np.testing.assert_allclose(channels["ZBack"].pixels[row, column], (3.5, 3.5), rtol=1e-5)
