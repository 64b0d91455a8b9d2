# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare with Cycles, in background: the pictures, the numbers, and that nothing else is touched."""

import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import bmesh
import bpy
import numpy as np
import pytest

from addon.report import comparison, metrics
from addon.ui import comparing
from addon.ui.compare_panels import DEEP_GBUFFER_PT_compare, DEEP_GBUFFER_PT_compared, tables
from blender_tests.blender.engine_fixtures import plane_scene_fixture, registered_fixture  # noqa: F401 - fixtures
from blender_tests.blender.test_engine_panels import Layout

SAMPLES = 4
DEAF = "import signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); print('ready', flush=True); time.sleep(600)"


@pytest.fixture(name="scene")
def scene_fixture(plane_scene, tmp_path):
    """The plane below a camera in a file that was saved, and 64 × 36 pixels that were not."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "plane.blend"))
    plane_scene.render.resolution_x, plane_scene.render.resolution_y = 64, 36
    yield plane_scene
    comparing.clear()


@pytest.fixture(name="children")
def children_fixture(monkeypatch):
    """Every process that a comparison started."""
    started = []

    class Recorded(subprocess.Popen):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            started.append(self)

    monkeypatch.setattr(comparison.subprocess, "Popen", Recorded)
    return started


@pytest.fixture(name="broken")
def broken_fixture(monkeypatch):
    """broken(program): the other Blender is a Python that runs this instead."""

    def broken(program):
        monkeypatch.setattr(comparing, "_command", lambda: [sys.executable, "-c", program])

    return broken


def compare(**options):
    return bpy.ops.deep_gbuffer.compare_with_cycles(**{"samples": SAMPLES, "percent": 100, **options})


def folders():
    return list(Path(bpy.app.tempdir).glob("comparison_*"))


def pixels(attribute):
    """An image of the comparison as (H, W, 3), top row first."""
    image = bpy.data.images[comparing.IMAGES[attribute]]
    flat = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(flat)
    return flat.reshape(image.size[1], image.size[0], -1)[::-1, :, :3]


def values(group):
    """Every property of a Blender struct that holds a value of its own, as text."""
    found = {}
    for prop in group.bl_rna.properties:
        if prop.type not in {"POINTER", "COLLECTION"}:
            value = getattr(group, prop.identifier)
            found[prop.identifier] = str(list(value) if getattr(prop, "is_array", False) else value)
    return found


def state():
    """What a user would notice if it changed."""
    scene = bpy.context.scene
    groups = [scene, scene.render, scene.render.image_settings, scene.view_settings, scene.cycles, scene.deep_gbuffer]
    return {
        "settings": [values(group) for group in (*groups, *scene.view_layers)],
        "scenes": [(item.name, item.frame_current, item.camera) for item in bpy.data.scenes],
        "file": (bpy.data.filepath, bpy.data.is_dirty, bpy.data.is_saved, bpy.data.use_autopack),
        "objects": [(item.name, item.mode, item.select_get()) for item in scene.objects],
    }


def test_the_pictures_are_images_and_the_numbers_are_theirs(scene):
    assert compare() == {"FINISHED"}
    ours, cycles, difference = (pixels(name) for name in comparing.IMAGES)
    for attribute, name in comparing.IMAGES.items():
        image = bpy.data.images[name]
        assert tuple(image.size) == (64, 36), attribute
        assert image.is_float
        assert image.use_view_as_render
        assert not image.is_dirty
    np.testing.assert_array_equal(difference, np.abs(ours.astype(np.float64) - cycles).astype(np.float32))
    numbers = comparing.numbers()
    assert numbers.errors == metrics.errors(ours, cycles)
    assert (numbers.resolution, numbers.samples) == ((64, 36), SAMPLES)
    assert min(numbers.our_seconds, numbers.cycles_seconds, numbers.noise_rmse) > 0.0
    assert ours[:, :24].mean() > 0.1  # the plane, by a sun of radiance 1, is lit on the left
    assert ours[:, 40:].max() == 0.0
    assert numbers.errors.rmse < 0.2 * ours[:, :24].mean()


def test_pictures_are_as_large_as_asked_and_the_last_ones_are_replaced(scene):
    scene.render.resolution_x, scene.render.resolution_percentage = 128, 50
    for percent, size in ((50, (32, 9)), (100, (64, 18)), (1, (4, 4))):
        assert compare(percent=percent, samples=3) == {"FINISHED"}
        assert comparing.numbers().resolution == size
        assert comparing.numbers().samples == 4
        assert {tuple(image.size) for image in bpy.data.images if image.name.startswith("Comparison")} == {size}
        assert len([image for image in bpy.data.images if image.name.startswith("Comparison")]) == 3
        assert len(folders()) == 1


def test_an_editor_that_shows_a_picture_shows_the_next_one(scene):
    compare(percent=50)
    texture = bpy.data.textures.new("Shows it", "IMAGE")
    texture.image = bpy.data.images[comparing.DIFFERENCE]
    compare(percent=100)
    assert texture.image == bpy.data.images[comparing.DIFFERENCE]
    assert tuple(texture.image.size) == (64, 36)


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_nothing_of_the_users_changes(scene, mode):
    bpy.context.view_layer.objects.active = bpy.data.objects["Plane"]
    bpy.ops.object.mode_set(mode=mode)
    scene.deep_gbuffer.save_layers = True
    bpy.data.use_autopack = True
    texture = Path(bpy.data.filepath).with_name("texture.png")
    image = bpy.data.images.new("Texture", 4, 4)
    image.use_fake_user, image.filepath_raw, image.file_format = True, str(texture), "PNG"
    image.save()
    before, files = state(), sorted(Path(bpy.data.filepath).parent.iterdir())
    assert compare() == {"FINISHED"}
    assert state() == before
    assert sorted(Path(bpy.data.filepath).parent.iterdir()) == files
    assert image.packed_file is None
    bpy.data.use_autopack = False


def test_undo_goes_back_to_before_the_last_edit(scene):
    for samples in (3, 5):
        scene.deep_gbuffer.samples = samples
        bpy.ops.ed.undo_push(message=f"{samples} samples")
    compare()
    bpy.ops.ed.undo()
    assert bpy.context.scene.deep_gbuffer.samples == 3


def test_edits_that_were_not_saved_are_in_the_pictures(scene):
    bpy.data.objects["Plane"].location.x = 20.0  # from the left half to the right one
    compare()
    for attribute in ("ours", "cycles"):
        picture = pixels(attribute)
        assert picture[:, :24].max() == 0.0 < picture[:, 40:].min(), attribute


def test_edits_that_edit_mode_has_not_handed_over_are_in_the_pictures(scene):
    bpy.context.view_layer.objects.active = plane = bpy.data.objects["Plane"]
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(plane.data)
    bmesh.ops.translate(edited, vec=(20.0, 0.0, 0.0), verts=edited.verts)
    bmesh.update_edit_mesh(plane.data)
    compare()
    assert plane.mode == "EDIT"
    picture = pixels("cycles")
    assert picture[:, :24].max() == 0.0 < picture[:, 40:].min()
    bpy.ops.object.mode_set(mode="OBJECT")


def test_pixels_that_no_file_holds_are_named(scene):
    image = bpy.data.images.new("Painted", 4, 4)
    image.pixels[0] = 0.5
    assert comparing.lost_edits() == ["Painted"]
    image.pack()
    assert comparing.lost_edits() == []


def test_without_a_camera_it_says_so(scene):
    scene.camera = None
    with pytest.raises(RuntimeError, match="has no camera"):
        compare()
    assert folders() == []


def test_without_cycles_it_says_so(scene, monkeypatch):
    bpy.ops.preferences.addon_disable(module="cycles")
    try:
        with pytest.raises(RuntimeError, match="There is no Cycles to compare with"):
            compare()
    finally:
        bpy.ops.preferences.addon_enable(module="cycles")
    assert folders() == []


def test_it_is_offered_for_our_engine_only(scene):
    assert bpy.ops.deep_gbuffer.compare_with_cycles.poll()
    scene.render.engine = "CYCLES"
    assert not bpy.ops.deep_gbuffer.compare_with_cycles.poll()


def told(kind, content):
    """A program that says one thing as a job does, then ends well."""
    return f"from addon.report.messages import send; send({kind!r}, {content!r})"


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        ("raise SystemExit(3)", r"ended too early \(exit code 3\)"),
        ("print('out of cheese'); raise SystemExit(1)", "out of cheese"),
        ("raise SystemExit(130)", "was interrupted"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", r"exit code -9\)"),
        ("", r"exit code 0\). It said nothing"),
        (told("error", "The file is broken."), "The file is broken"),
        (
            told("failed", {"name": "second half", "reason": "No room."}),
            "Cycles, second half could not render: No room",
        ),
    ],
)
def test_a_child_that_fails_gives_its_reason_and_leaves_nothing(scene, broken, children, monkeypatch, program, reason):
    monkeypatch.setenv("PYTHONPATH", str(Path(comparison.__file__).parents[2]))
    broken(program)
    with pytest.raises(RuntimeError, match=reason):
        compare()
    assert [child.returncode is not None for child in children] == [True]
    assert folders() == []
    assert comparing.running() is None
    assert comparing.numbers() is None


def test_a_blender_that_cannot_be_started_is_named(scene, monkeypatch):
    monkeypatch.setattr(comparing, "_command", lambda: ["/no/such/blender"])
    with pytest.raises(RuntimeError, match=r"could not be started a second time.*/no/such/blender"):
        compare()
    assert folders() == []


def test_a_scene_that_cannot_be_saved_is_reported(scene, monkeypatch):
    monkeypatch.setattr(comparing.tempfile, "mkdtemp", lambda **_options: "/proc/none")
    with pytest.raises(RuntimeError, match="could not be saved for the comparison"):
        compare()


def test_pictures_that_cannot_be_written_are_reported(scene, monkeypatch):
    def full(*_arguments):
        raise OSError("No space left on device")

    monkeypatch.setattr(comparing, "write_channels", full)
    with pytest.raises(RuntimeError, match="No space left on device"):
        compare()
    assert folders() == []
    assert not [image for image in bpy.data.images if image.name.startswith("Comparison")]


def started(scene):
    """A comparison whose renders take for ever, at its first sample."""
    scene.deep_gbuffer.samples = 1_000_000
    comparing.start(scene, SAMPLES, 100)
    while comparing.running().progress.fraction == 0.0:
        assert comparing.step()


@pytest.mark.parametrize("way", ["cancel", "load", "unregister", "interrupt"])
def test_ending_it_leaves_no_process_and_no_folder(scene, children, monkeypatch, way):
    scene.deep_gbuffer.samples = 1_000_000
    handler = signal.getsignal(signal.SIGINT)
    if way == "interrupt":
        monkeypatch.setattr(comparing, "step", interrupted_step(comparing.step))
        with pytest.raises(RuntimeError, match="was cancelled"):
            compare()
    else:
        started(scene)
        assert not bpy.ops.deep_gbuffer.compare_with_cycles.poll()
        if way == "cancel":
            assert bpy.ops.deep_gbuffer.cancel_comparison() == {"FINISHED"}
        elif way == "load":
            bpy.ops.wm.read_factory_settings(use_empty=True)
        else:
            comparing.clear()
    assert signal.getsignal(signal.SIGINT) == handler
    assert len(children) == 1
    assert children[0].returncode is not None
    assert folders() == []
    assert comparing.running() is None
    assert not bpy.ops.deep_gbuffer.cancel_comparison.poll()


def interrupted_step(step):
    """`comparing.step`, until the first sample is there: then Ctrl+C."""

    def stepping():
        if comparing.running().progress.fraction > 0.0:
            raise KeyboardInterrupt
        return step()

    return stepping


def test_a_child_that_does_not_listen_is_ended_all_the_same(scene, broken, children, monkeypatch):
    monkeypatch.setattr(comparison, "GRACE_SECONDS", 0.01)
    broken(DEAF)
    comparing.start(scene, SAMPLES, 100)
    running = comparing._state.running
    while running._lines.empty():
        pass
    comparing.cancel()
    assert children[0].returncode == -9
    assert folders() == []


def drawn(panel, context):
    layout = Layout()
    stand_in = SimpleNamespace(layout=layout)
    panel.draw(stand_in, context)
    return layout


def showing(image):
    return SimpleNamespace(space_data=SimpleNamespace(image=image))


def test_the_panel_lists_the_numbers_beside_their_pictures_only(scene):
    other = bpy.data.images.new("Other", 4, 4)
    compare()
    assert not DEEP_GBUFFER_PT_compared.poll(showing(None))
    assert not DEEP_GBUFFER_PT_compared.poll(showing(other))
    for name in comparing.IMAGES.values():
        context = showing(bpy.data.images[name])
        assert DEEP_GBUFFER_PT_compared.poll(context)
        texts = drawn(DEEP_GBUFFER_PT_compared, context).texts
        for _, rows in tables(comparing.numbers()):
            assert {text for row in rows for text in row} <= set(texts)
    assert "64 × 36" in texts
    assert f"{comparing.numbers().errors.rmse:.5f}" in texts
    comparing.clear()
    assert not DEEP_GBUFFER_PT_compared.poll(context)


@pytest.mark.parametrize(("noise", "told"), [(0.049, False), (0.05, True), (0.0, False)])
def test_an_error_near_the_noise_is_told(scene, monkeypatch, noise, told):
    errors = metrics.Errors(0.1, 0.1, float("inf"), (0.0, -0.5, 1.0), 0.0, 0)
    numbers = comparing.Numbers((64, 36), 8, 1.0, 2.0, errors, noise)
    monkeypatch.setattr(comparing, "numbers", lambda: numbers)
    texts = drawn(DEEP_GBUFFER_PT_compared, showing(SimpleNamespace(name=comparing.DIFFERENCE))).texts
    assert any("own noise" in text for text in texts) == told
    assert {"equal", "-0.50000", "+1.00000"} <= set(texts)


def test_the_render_panel_shows_the_button_or_how_far_it_is(scene):
    assert drawn(DEEP_GBUFFER_PT_compare, bpy.context).operators == ["deep_gbuffer.compare_with_cycles"]
    started(scene)
    layout = drawn(DEEP_GBUFFER_PT_compare, bpy.context)
    assert layout.operators == ["deep_gbuffer.cancel_comparison"]
    assert any("%  Deep G-Buffer: Sample " in text for text in layout.texts)
