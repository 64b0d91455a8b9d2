# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the layers of a final render are saved, and saving them."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import bpy

from .. import output
from ..render import LayerImages
from . import messages

Writer = Callable[[Path, Sequence[LayerImages]], None]


def save(depsgraph: Any, layers: Sequence[LayerImages]) -> tuple[str, ...]:
    """Write the files that the scene asks for. Returns a message for each that could not be written."""
    ours = depsgraph.scene.deep_gbuffer
    wanted: list[tuple[str, str, Writer]] = []
    if ours.save_layers:
        wanted.append(("layers", "layers", output.write_layers))
    if ours.save_deep:
        wanted.append(("deep samples", "deep", output.write_deep))
    failures = (_write(depsgraph, item, suffix, writer, layers) for item, suffix, writer in wanted)
    return tuple(text for text in failures if text)


def _write(depsgraph: Any, item: str, suffix: str, writer: Writer, layers: Sequence[LayerImages]) -> str:
    scene = depsgraph.scene
    template = scene.deep_gbuffer.layers_path
    if template.startswith("//") and not bpy.data.filepath:
        return messages.unsaved(item, template)
    several = sum(layer.use for layer in scene.original.view_layers) > 1
    layer_name = depsgraph.view_layer.name if several else ""
    stem = Path(bpy.data.filepath).stem or "untitled"
    path = Path(bpy.path.abspath(file_name(template, stem, scene.frame_current, layer_name, suffix)))
    try:
        writer(path, layers)
    except OSError as error:
        return messages.not_written(item, str(path), error)
    return ""


def file_name(template: str, blend_name: str, frame: int, view_layer: str, suffix: str) -> str:
    """The path of one file, by Blender's conventions for its own output path.

    A run of # is the frame number, padded to its length; without one, four digits are appended. A path that is a
    folder (it ends with a slash) takes the .blend's name. An ending .exr is dropped before, and
    "_VIEWLAYER" (where given) and "_SUFFIX.exr" come after.
    """
    path = template.removesuffix(".exr")
    if path.endswith(("/", "\\")):
        path += f"{blend_name}_"
    name = re.split(r"[/\\]", path)[-1]
    folder = path.removesuffix(name)
    runs = list(re.finditer("#+", name))
    if runs:
        first, last = runs[-1].span()
        name = f"{name[:first]}{frame:0{last - first}d}{name[last:]}"
    else:
        name += f"{frame:04d}"
    layer = f"_{re.sub(r'[^0-9A-Za-z._-]', '_', view_layer)}" if view_layer else ""
    return f"{folder}{name}{layer}_{suffix}.exr"
