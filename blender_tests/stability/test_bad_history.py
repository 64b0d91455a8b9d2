# SPDX-License-Identifier: GPL-3.0-or-later
"""Trouble in the frames before the rendered one: the picture still comes, whatever the variant, and all is defined."""

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest
from troubled_scenes import BAD, add, assert_good_picture, read_exr, render

from addon.scene import Variant

FRAME = 5
BOX = [(x, y, z) for x in (-1, 1) for y in (2, 4) for z in (0.5, 2)]
BOX_FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def keyed(item: bpy.types.bpy_struct, name: str, before: object, now: object) -> None:
    """Give a property one value up to the frame before the rendered one, and another from that on."""
    for frame, value in ((1, before), (FRAME, now)):
        setattr(item, name, value)
        item.keyframe_insert(name, frame=frame)


def nothing(_scene: bpy.types.Scene) -> None:
    """All is well, and at rest."""
    add(BAD, BOX, BOX_FACES)


def invisible_before(_scene: bpy.types.Scene) -> None:
    """The object appears."""
    keyed(add(BAD, BOX, BOX_FACES), "hide_render", True, False)


def invisible_now(_scene: bpy.types.Scene) -> None:
    """The object vanishes."""
    keyed(add(BAD, BOX, BOX_FACES), "hide_render", False, True)


def without_scale_before(_scene: bpy.types.Scene) -> None:
    """The object grows from nothing, with no inverse transform."""
    keyed(add(BAD, BOX, BOX_FACES), "scale", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


def not_a_number_before(_scene: bpy.types.Scene) -> None:
    """The object comes from a place that is none."""
    keyed(add(BAD, BOX, BOX_FACES), "location", (float("nan"), 0.0, 0.0), (0.0, 0.0, 0.0))


def far_away_before(_scene: bpy.types.Scene) -> None:
    """The object moves by more than float32 can tell."""
    keyed(add(BAD, BOX, BOX_FACES), "location", (1e30, 0.0, 1e30), (0.0, 0.0, 0.0))


def other_triangles_before(_scene: bpy.types.Scene) -> None:
    """The object had fewer copies of its mesh."""
    keyed(add(BAD, BOX, BOX_FACES).modifiers.new("Array", "ARRAY"), "count", 1, 3)


def mirrored_before(_scene: bpy.types.Scene) -> None:
    """The object turns inside out."""
    keyed(add(BAD, BOX, BOX_FACES), "scale", (-1.0, 1.0, 1.0), (1.0, 1.0, 1.0))


def camera_elsewhere_before(scene: bpy.types.Scene) -> None:
    """The camera jumps, from behind the object."""
    add(BAD, BOX, BOX_FACES)
    keyed(scene.camera, "location", (0.0, 40.0, 1.0), tuple(scene.camera.location))


def camera_inside_before(scene: bpy.types.Scene) -> None:
    """The camera moves out of the object."""
    add(BAD, BOX, BOX_FACES)
    keyed(scene.camera, "location", (0.0, 3.0, 1.0), tuple(scene.camera.location))


def another_lens_before(scene: bpy.types.Scene) -> None:
    """The camera's focal length leaps to a thousandth."""
    add(BAD, BOX, BOX_FACES)
    keyed(scene.camera.data, "lens", 5000.0, 50.0)


def orthographic_before(scene: bpy.types.Scene) -> None:
    """A marker cuts from an orthographic camera."""
    add(BAD, BOX, BOX_FACES)
    other = bpy.data.objects.new("Other", bpy.data.cameras.new("Other"))
    other.data.type = "ORTHO"
    scene.collection.objects.link(other)
    for frame, camera in ((1, other), (FRAME, scene.camera)):
        scene.timeline_markers.new(camera.name, frame=frame).camera = camera


@pytest.mark.parametrize(
    "trouble",
    [
        nothing,
        invisible_before,
        invisible_now,
        without_scale_before,
        not_a_number_before,
        far_away_before,
        other_triangles_before,
        mirrored_before,
        camera_elsewhere_before,
        camera_inside_before,
        another_lens_before,
        orthographic_before,
    ],
)
@pytest.mark.parametrize("variant", list(Variant))
def test_trouble_in_the_past(
    scene: bpy.types.Scene, tmp_path: Path, variant: Variant, trouble: Callable[[bpy.types.Scene], None]
) -> None:
    settings = scene.deep_gbuffer
    settings.variant, settings.layers, settings.minimum_separation = variant.value, 3, 0.1
    settings.use_guard_band, settings.guard_band_pixels = True, 3
    settings.save_layers, settings.save_motion, settings.save_exit = True, True, True
    settings.layers_path = str(tmp_path / "layers.exr")
    trouble(scene)
    scene.frame_set(FRAME)
    assert_good_picture(render(scene, tmp_path)[0])
    (layer_file,) = (path for path in tmp_path.glob("*.exr") if path.name != "out.exr")
    written = read_exr(layer_file)
    assert sum("motion" in name.lower() for name in written) >= settings.layers
    for name, pixels in written.items():
        assert not np.isnan(pixels).any(), name
        assert np.isfinite(pixels).all() or "motion" not in name.lower(), name
