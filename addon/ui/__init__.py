# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings, panels, operators and presets."""

import atexit
from pathlib import Path

import bpy

from . import (
    compare,
    compare_panels,
    compared_images,
    comparing,
    data_panels,
    indirect_panels,
    operators,
    panels,
    properties,
    sampling_panels,
    standard_panels,
)

_CLASSES = (
    *operators.CLASSES,
    *compare.CLASSES,
    *sampling_panels.CLASSES,
    *indirect_panels.CLASSES,
    *panels.CLASSES,
    *compare_panels.CLASSES,
    *data_panels.CLASSES,
)
_PRESET_ROOT = str(Path(__file__).parent)


@bpy.app.handlers.persistent
def _before_load(_path: str) -> None:
    """The file that was compared is about to be replaced."""
    comparing.clear()


@bpy.app.handlers.persistent
def _before_undo(*_arguments: object) -> None:
    """Undo and redo know nothing of a comparison's images."""
    compared_images.before_undo()


@bpy.app.handlers.persistent
def _after_undo(*_arguments: object) -> None:
    """Bring them back."""
    compared_images.after_undo()


_HANDLERS = (
    (bpy.app.handlers.load_pre, _before_load),
    (bpy.app.handlers.undo_pre, _before_undo),
    (bpy.app.handlers.undo_post, _after_undo),
    (bpy.app.handlers.redo_pre, _before_undo),
    (bpy.app.handlers.redo_post, _after_undo),
)


def register() -> None:
    """Add everything to Blender's user interface."""
    properties.register()
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    bpy.utils.register_preset_path(_PRESET_ROOT)
    standard_panels.register()
    for handlers, handler in _HANDLERS:
        handlers.append(handler)
    atexit.register(unregister)  # bpy 4.5 as a module does not end cleanly while Python classes are registered


def unregister() -> None:
    """Take everything away again."""
    atexit.unregister(unregister)
    for handlers, handler in _HANDLERS:
        handlers.remove(handler)
    comparing.clear()
    standard_panels.unregister()
    bpy.utils.unregister_preset_path(_PRESET_ROOT)
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
    properties.unregister()
