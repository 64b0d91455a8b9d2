# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare with Cycles, in background: the pictures, the numbers, and that nothing else is touched."""

from pathlib import Path
from types import SimpleNamespace

import bmesh
import bpy
import numpy as np
import pytest

from addon.report import metrics
from addon.ui import compare as operators
from addon.ui import compared_images, comparing
from addon.ui.compare_panels import DEEP_GBUFFER_PT_compare, DEEP_GBUFFER_PT_compared, tables
from blender_tests.blender.comparison_fixtures import (  # noqa: F401 - fixtures
    SAMPLES,
    compare,
    comparison_images,
    folders,
    pixels,
    scene_fixture,
    started,
)
from blender_tests.blender.engine_fixtures import plane_scene_fixture, registered_fixture  # noqa: F401 - fixtures
from blender_tests.blender.test_engine_panels import Layout


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


def test_the_pictures_are_images_and_the_numbers_are_theirs(scene, capfd):
    assert compare() == {"FINISHED"}
    assert f"Compared with Cycles: RMSE {comparing.numbers().errors.rmse:.4g}" in capfd.readouterr().out
    ours, cycles, difference = (pixels(name) for name in compared_images.IMAGES)
    for attribute, name in compared_images.IMAGES.items():
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
        assert [tuple(image.size) for image in comparison_images()] == [size] * 3
        assert len(folders()) == 1


def test_an_editor_that_shows_a_picture_shows_the_next_one(scene):
    compare(percent=50)
    texture = bpy.data.textures.new("Shows it", "IMAGE")
    texture.image = bpy.data.images[compared_images.DIFFERENCE]
    compare(percent=100)
    assert texture.image == bpy.data.images[compared_images.DIFFERENCE]
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


def edit(scene, samples):
    """What a user does, and can undo."""
    scene.deep_gbuffer.samples = samples
    bpy.ops.ed.undo_push(message=f"{samples} samples")


def test_undo_and_redo_keep_the_pictures_and_who_shows_them(scene):
    an_editor = an_image_editor()
    edit(scene, 2)
    compare()
    an_editor.image = bpy.data.images[compared_images.DIFFERENCE]
    expected = pixels("ours")
    edit(bpy.context.scene, 3)
    for step, samples in ((bpy.ops.ed.undo, 2), (bpy.ops.ed.redo, 3), (bpy.ops.ed.undo, 2)):
        step()
        assert bpy.context.scene.deep_gbuffer.samples == samples
        assert sorted(image.name for image in comparison_images()) == sorted(compared_images.IMAGES.values())
        np.testing.assert_array_equal(pixels("ours"), expected)
        assert an_editor.image == bpy.data.images[compared_images.DIFFERENCE]


def an_image_editor():
    return next(area.spaces.active for each in bpy.data.screens for area in each.areas if area.type == "IMAGE_EDITOR")


def test_undo_brings_no_earlier_pictures_back(scene):
    compare(percent=50)
    edit(scene, 3)
    edit(scene, 4)
    compare(percent=100)
    bpy.ops.ed.undo()
    assert [tuple(image.size) for image in comparison_images()] == [(64, 36)] * 3
    np.testing.assert_array_equal(pixels("difference") >= 0.0, True)


def test_undo_brings_no_picture_back_that_was_removed(scene):
    edit(scene, 2)
    compare()
    bpy.data.images.remove(bpy.data.images[compared_images.DIFFERENCE])
    edit(scene, 3)
    bpy.ops.ed.undo()
    assert len(comparison_images()) == 2


def test_the_pictures_are_not_saved_as_the_render_result_is_not(scene, tmp_path):
    compare()
    texture = bpy.data.textures.new("Shows it", "IMAGE")
    texture.use_fake_user = True
    texture.image = bpy.data.images[compared_images.DIFFERENCE]
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    assert len(comparison_images()) == 3
    bpy.ops.wm.open_mainfile(filepath=path)
    assert bpy.data.textures["Shows it"].image is None
    assert comparison_images() == []
    assert comparing.numbers() is None


def test_the_scene_that_was_asked_for_is_compared_whichever_is_active(scene):
    other = bpy.data.scenes.new("Another")
    other.render.engine = "DEEP_GBUFFER"
    bpy.context.window.scene = other
    with bpy.context.temp_override(scene=scene):
        compare()
    assert comparing.numbers().resolution == (64, 36)
    for attribute in ("ours", "cycles"):
        assert pixels(attribute)[:, :24].mean() > 0.1, attribute


def test_edits_that_were_not_saved_are_in_the_pictures(scene):
    bpy.data.objects["Plane"].location.x = 20.0  # from the left half to the right one
    compare()
    assert_the_plane_is_on_the_right()


def assert_the_plane_is_on_the_right():
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
    assert_the_plane_is_on_the_right()
    bpy.ops.object.mode_set(mode="OBJECT")


def test_pixels_that_no_file_holds_are_named(scene):
    image = bpy.data.images.new("Painted", 4, 4)
    image.pixels[0] = 0.5
    assert comparing.lost_edits() == ["Painted"]
    image.pack()
    assert comparing.lost_edits() == []


def test_it_is_offered_for_our_engine_only(scene):
    assert bpy.ops.deep_gbuffer.compare_with_cycles.poll()
    scene.render.engine = "CYCLES"
    assert not bpy.ops.deep_gbuffer.compare_with_cycles.poll()


def test_tooltips_have_no_line_breaks(registered):
    for cls in operators.CLASSES:
        shown = getattr(bpy.ops.deep_gbuffer, cls.bl_idname.partition(".")[2]).get_rna_type().description
        assert shown
        assert "\n" not in shown, cls
        assert "  " not in shown, cls


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
    for name in compared_images.IMAGES.values():
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
    texts = drawn(DEEP_GBUFFER_PT_compared, showing(SimpleNamespace(name=compared_images.DIFFERENCE))).texts
    assert any("own noise" in text for text in texts) == told
    assert {"equal", "-0.50000", "+1.00000"} <= set(texts)


def test_the_render_panel_shows_the_button_or_how_far_it_is(scene):
    assert drawn(DEEP_GBUFFER_PT_compare, bpy.context).operators == ["deep_gbuffer.compare_with_cycles"]
    started(scene)
    layout = drawn(DEEP_GBUFFER_PT_compare, bpy.context)
    assert layout.operators == ["deep_gbuffer.cancel_comparison"]
    assert any("%  Deep G-Buffer: Sample " in text for text in layout.texts)
