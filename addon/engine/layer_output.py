# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the layers and the scene of a final render are saved, and saving them."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import bpy

from .. import output
from ..render import LayerImages
from ..scene import snapshot
from . import messages
from .frames import Frames


class Saved(NamedTuple):
    """Paths of the files that were written, and a message for each that could not be."""

    files: tuple[str, ...]
    failures: tuple[str, ...]


def save(depsgraph: Any, frames: Frames, layers: Sequence[LayerImages]) -> Saved:
    """Write the files that the scene asks for."""
    scenes = [frame.scene for frame in (frames.current, *frames.before)]
    ours = depsgraph.scene.deep_gbuffer
    wanted: tuple[tuple[bool, str, str, Callable[[Path], None]], ...] = (
        (ours.save_layers, "layers", "layers.exr", lambda path: output.write_layers(path, layers)),
        (ours.save_deep, "deep samples", "deep.exr", lambda path: output.write_deep(path, layers)),
        (ours.save_snapshot, "scene snapshot", "snapshot.npz", lambda path: snapshot.save(path, *scenes)),
    )
    files: list[str] = []
    failures: list[str] = []
    for asked, item, ending, write in wanted:
        if not asked:
            continue
        template = ours.layers_path or "//"
        if template.startswith("//") and not bpy.data.filepath:
            failures.append(messages.unsaved(item, template))
            continue
        path = _path(depsgraph, template, ending)
        try:
            write(path)
        except OSError as error:
            failures.append(messages.not_written(item, str(path), error))
        else:
            files.append(str(path))
    return Saved(tuple(files), tuple(failures))


def _path(depsgraph: Any, template: str, ending: str) -> Path:
    scene = depsgraph.scene
    several = sum(layer.use for layer in scene.original.view_layers) > 1
    layer_name = depsgraph.view_layer.name if several else ""
    stem = Path(bpy.data.filepath).stem or "untitled"
    return Path(bpy.path.abspath(file_name(template, stem, scene.frame_current, layer_name, ending)))


def file_name(template: str, blend_name: str, frame: int, view_layer: str, ending: str) -> str:
    """The path of one file, by Blender's conventions for its own output path.

    A run of # is the frame number, padded to its length; without one, four digits are appended. A path that is a
    folder (it ends with a slash) takes the .blend's name. An ending .exr is dropped before, and
    "_VIEWLAYER" (where given) and "_ENDING" come after.
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
    return f"{folder}{name}{layer}_{ending}"
