# SPDX-License-Identifier: GPL-3.0-or-later
"""A good scene that tests put trouble into, and what must hold of its picture all the same."""

from pathlib import Path

import bpy
import numpy as np
import OpenEXR

import addon

GOOD, BAD = "Good plane", "Troubled object"


def add(name: str, vertices: list[tuple[float, float, float]], faces: list[tuple[int, ...]]) -> bpy.types.Object:
    """A mesh object; nothing is repaired."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    result = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(result)
    return result


def render(scene: bpy.types.Scene, folder: Path) -> tuple[dict[str, np.ndarray], list[str]]:
    """Every channel of the final render and the warnings that came with it."""
    image = scene.render.image_settings
    if bpy.app.version >= (5, 0, 0):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = str(folder / "out.exr")
    assert bpy.ops.render.render(write_still=True, scene=scene.name) == {"FINISHED"}
    statistics = addon.engine.statistics.last(scene.name)
    return read_exr(scene.render.filepath), statistics["warnings"]


def assert_good_picture(channels: dict[str, np.ndarray]) -> None:
    """Finite everywhere, and the plane in the lower half is there and lit, but for a shadow on less than half of it."""
    for name, pixels in channels.items():
        assert np.isfinite(pixels).all(), f"{name} is not finite"
    red = next(pixels for name, pixels in channels.items() if name.endswith("Combined.R"))
    depth = next(pixels for name, pixels in channels.items() if name.endswith("Depth.Z"))
    assert (red[-4:] > 0.01).mean() > 0.5, "the good plane must be lit"
    assert (depth[-4:] < 1e9).all(), "the good plane must be there"


def assert_named(warnings: list[str]) -> None:
    """Some warning names the troubled object, in a sentence."""
    assert any(BAD in text and text.endswith((".", "!")) for text in warnings), warnings


def read_exr(path: str | Path) -> dict[str, np.ndarray]:
    """Every channel of every part of an EXR file, by name."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: np.array(item.pixels) for part in file.parts for name, item in part.channels.items()}
