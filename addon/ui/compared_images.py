# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of the last comparison as images. Like Blender's Render Result they outlive undo, and are not saved."""

import contextlib
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from ..output import write_channels
from ..report.compared import Compared

DIFFERENCE = "Comparison: Difference"
IMAGES = {"ours": "Comparison: Deep G-Buffer", "cycles": "Comparison: Cycles", "difference": DIFFERENCE}
"""Names of the images, by the attribute of `Compared` that each shows."""


@dataclass
class _State:
    """`folder`: holds the files behind the images. `present` and `shown`: before an undo, names of the images that
    there were, and which one each Image Editor showed, by the address of its area."""

    folder: Path | None = None
    present: set[str] = field(default_factory=set[str])
    shown: dict[int, str] = field(default_factory=dict[int, str])


_state = _State()


def make(found: Compared, folder: Path) -> None:
    """Make images of the pictures, in place of those of the last comparison; `folder` is for their files alone.

    Raises OSError, or Blender's RuntimeError; then the images of the last comparison stay.
    """
    images: dict[str, Any] = {}
    try:
        for attribute, name in IMAGES.items():
            picture, path = getattr(found, attribute)[::-1], _path(folder, attribute)
            write_channels(path, {letter: picture[..., i] for i, letter in enumerate("RGB")})
            images[name] = _load(path)
    except BaseException:
        for image in images.values():
            bpy.data.images.remove(image)
        shutil.rmtree(folder, ignore_errors=True)
        raise
    for name, image in images.items():
        _put(name, image)
    remove_files()
    _state.folder = folder


def remove_files() -> None:
    """Remove the files behind the images, if any."""
    if _state.folder is not None:
        shutil.rmtree(_state.folder, ignore_errors=True)
        _state.folder = None


def before_undo() -> None:
    """Note what an undo or redo would take away."""
    _state.present = {name for name in IMAGES.values() if bpy.data.images.get((name, None)) is not None}
    showing = ((area, area.spaces.active.image) for area in _editors())
    _state.shown = {area.as_pointer(): image.name for area, image in showing if image in _images()}


def after_undo() -> None:
    """Load again what is missing, or is of an earlier comparison, since `before_undo`."""
    if _state.folder is None:
        return
    for attribute, name in IMAGES.items():
        path = _path(_state.folder, attribute)
        image = bpy.data.images.get((name, None))
        if (image is None and name in _state.present) or (image is not None and image.filepath != str(path)):
            _put(name, _load(path))
    for area in _editors():
        name = _state.shown.get(area.as_pointer())
        if name is not None and area.spaces.active.image is None:
            switch(area.spaces.active, bpy.data.images[name])


def switch(space: Any, image: Any) -> None:
    """Show `image` in an Image Editor, as near as what it showed before."""
    zoom = space.zoom_percentage
    space.image = image  # shows it at 100 %
    space.zoom_percentage = zoom


def _path(folder: Path, attribute: str) -> Path:
    return folder / f"{attribute}.exr"


def _images() -> list[Any]:
    """Those of the three images that there are."""
    found = (bpy.data.images.get((name, None)) for name in IMAGES.values())
    return [image for image in found if image is not None]


def _editors() -> Iterator[Any]:
    """Areas of all Image Editors, in other workspaces too."""
    return (area for screen in bpy.data.screens for area in screen.areas if area.type == "IMAGE_EDITOR")


def _load(path: Path) -> Any:
    """A scene-linear picture as a new image. Raises RuntimeError where Blender cannot load it."""
    image: Any = bpy.data.images.load(str(path))
    with contextlib.suppress(TypeError):  # another OpenColorIO configuration: it has its own default for such files
        image.colorspace_settings.name = _working_space()
    image.use_view_as_render = True
    image.is_runtime_data = True
    return image


def _working_space() -> str:
    """Name of the colour space of scene-linear values; from Blender 5.0 a file has its own."""
    settings = getattr(bpy.data, "colorspace", None)
    return settings.working_space if settings else "Linear Rec.709"


def _put(name: str, image: Any) -> None:
    """Call an image `name`, and use it wherever an image of that name was used."""
    old = bpy.data.images.get((name, None))
    if old is not None:
        old.user_remap(image)
        bpy.data.images.remove(old)
    image.name = name
