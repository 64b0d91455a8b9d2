# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings, panels, operators and presets."""

import atexit
from pathlib import Path

import bpy

from . import compare, compare_panels, comparing, data_panels, operators, panels, properties, standard_panels

_CLASSES = (
    *operators.CLASSES,
    *compare.CLASSES,
    *panels.CLASSES,
    *compare_panels.CLASSES,
    *data_panels.CLASSES,
)
_PRESET_ROOT = str(Path(__file__).parent)


@bpy.app.handlers.persistent
def _before_load(_path: str) -> None:
    """The file that was compared is about to be replaced."""
    comparing.clear()


def register() -> None:
    """Add everything to Blender's user interface."""
    properties.register()
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    bpy.utils.register_preset_path(_PRESET_ROOT)
    standard_panels.register()
    bpy.app.handlers.load_pre.append(_before_load)
    atexit.register(unregister)  # bpy 4.5 as a module does not end cleanly while Python classes are registered


def unregister() -> None:
    """Take everything away again."""
    atexit.unregister(unregister)
    bpy.app.handlers.load_pre.remove(_before_load)
    comparing.clear()
    standard_panels.unregister()
    bpy.utils.unregister_preset_path(_PRESET_ROOT)
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
    properties.unregister()
