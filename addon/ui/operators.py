# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators: statistics to the clipboard, sampling presets."""

import json
from typing import Any, ClassVar

import bpy
from bl_operators.presets import AddPresetBase

from ..engine import statistics

PRESET_FOLDER = "deep_gbuffer/sampling"


class DEEP_GBUFFER_OT_copy_statistics(bpy.types.Operator):
    """Copy the statistics of the last final render of this scene to the clipboard, as JSON"""

    bl_idname = "deep_gbuffer.copy_statistics"
    bl_label = "Copy Statistics"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only after a final render."""
        return statistics.last(context.scene.name) is not None

    def execute(self, context: Any) -> Any:
        """Copy."""
        context.window_manager.clipboard = json.dumps(statistics.last(context.scene.name), indent=2)
        return {"FINISHED"}


class DEEP_GBUFFER_OT_sampling_preset_add(AddPresetBase, bpy.types.Operator):  # pyright: ignore[reportIncompatibleMethodOverride]
    """Add or remove a sampling preset"""

    bl_idname = "deep_gbuffer.sampling_preset_add"
    bl_label = "Add Sampling Preset"
    preset_menu = "DEEP_GBUFFER_PT_sampling_presets"
    preset_subdir = PRESET_FOLDER
    preset_defines: ClassVar[list[str]] = ["settings = bpy.context.scene.deep_gbuffer"]
    preset_values: ClassVar[list[str]] = [
        "settings.samples",
        "settings.viewport_samples",
        "settings.time_limit",
    ]


CLASSES = (DEEP_GBUFFER_OT_copy_statistics, DEEP_GBUFFER_OT_sampling_preset_add)
