# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's own panels that make sense with this engine."""

from typing import Any

import bpy

from ..engine import statistics

EXCLUDED = {"DATA_PT_light", "NODE_DATA_PT_light", "DATA_PT_camera_stereoscopy", "RENDER_PT_output_views"}
EXCLUDED_WORDS = ("freestyle", "gpencil", "grease", "lightprobe", "stereoscopy")
"""Panels that name every engine, but whose settings we do not read."""

INCLUDED = {
    "DATA_PT_EEVEE_light",
    "DATA_PT_EEVEE_light_influence",
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
    "MATERIAL_PT_preview",
    "NODE_DATA_PT_EEVEE_light",
}
"""Panels that name other engines only, but whose settings we read."""


def _panels() -> list[Any]:
    """Every panel class that says which engines it is for."""
    return [panel for panel in bpy.types.Panel.__subclasses__() if hasattr(panel, "COMPAT_ENGINES")]


def _suitable() -> list[Any]:
    return [
        panel
        for panel in _panels()
        if panel.__name__ in INCLUDED
        or (
            "BLENDER_RENDER" in panel.COMPAT_ENGINES
            and panel.__name__ not in EXCLUDED
            and not any(word in panel.__name__.lower() for word in EXCLUDED_WORDS)
        )
    ]


def register() -> None:
    """Show them with our engine."""
    for panel in _suitable():
        panel.COMPAT_ENGINES.add(statistics.ENGINE)


def unregister() -> None:
    """Hide them again; they are as they were before."""
    for panel in _panels():
        panel.COMPAT_ENGINES.discard(statistics.ENGINE)
