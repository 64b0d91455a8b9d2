# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators: statistics to the clipboard, presets."""

import json
from dataclasses import fields
from typing import Any, ClassVar

import bpy
from bl_operators.presets import AddPresetBase

from ..engine import statistics
from ..scene.quality import QualityNumbers

SAMPLING_PRESETS = "deep_gbuffer/sampling"
LAYERS_PRESETS = "deep_gbuffer/layers"
INDIRECT_PRESETS = "deep_gbuffer/indirect"


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


class _PresetAdd(AddPresetBase):
    """A preset of some of our settings."""

    preset_defines: ClassVar[list[str]] = ["settings = bpy.context.scene.deep_gbuffer"]


class DEEP_GBUFFER_OT_sampling_preset_add(_PresetAdd, bpy.types.Operator):  # pyright: ignore[reportIncompatibleMethodOverride]
    """Add or remove a sampling preset"""

    bl_idname = "deep_gbuffer.sampling_preset_add"
    bl_label = "Add Sampling Preset"
    preset_menu = "DEEP_GBUFFER_PT_sampling_presets"
    preset_subdir = SAMPLING_PRESETS
    preset_values: ClassVar[list[str]] = [
        "settings.samples",
        "settings.viewport_samples",
        "settings.use_noise_threshold",
        "settings.noise_threshold",
        "settings.time_limit",
    ]


class DEEP_GBUFFER_OT_indirect_preset_add(_PresetAdd, bpy.types.Operator):  # pyright: ignore[reportIncompatibleMethodOverride]
    """Add or remove an indirect light preset"""

    bl_idname = "deep_gbuffer.indirect_preset_add"
    bl_label = "Add Indirect Light Preset"
    preset_menu = "DEEP_GBUFFER_PT_indirect_presets"
    preset_subdir = INDIRECT_PRESETS
    preset_values: ClassVar[list[str]] = [
        "settings.indirect.method",
        "settings.indirect.bounces",
        "settings.indirect.unlimited_bounces",
        "settings.indirect.radius",
        "settings.indirect.march_distance",
        "settings.indirect.exit_surfaces",
        "settings.indirect.cell_size",
        "settings.indirect.grid_memory",
        "settings.indirect.spatial_filter",
        "settings.indirect.temporal_filter",
        "settings.indirect.paper_composite",
        *(
            f"settings.indirect.{use}.{number.name}"
            for use in ("render", "viewport")
            for number in fields(QualityNumbers)
        ),
    ]


class DEEP_GBUFFER_OT_layers_preset_add(_PresetAdd, bpy.types.Operator):  # pyright: ignore[reportIncompatibleMethodOverride]
    """Add or remove a deep G-buffer preset"""

    bl_idname = "deep_gbuffer.layers_preset_add"
    bl_label = "Add Deep G-Buffer Preset"
    preset_menu = "DEEP_GBUFFER_PT_layers_presets"
    preset_subdir = LAYERS_PRESETS
    preset_values: ClassVar[list[str]] = [
        "settings.layers",
        "settings.variant",
        "settings.separation_unit",
        "settings.minimum_separation",
        "settings.relative_separation",
        "settings.use_guard_band",
        "settings.guard_band_unit",
        "settings.guard_band_pixels",
        "settings.guard_band_percent",
    ]


CLASSES = (
    DEEP_GBUFFER_OT_copy_statistics,
    DEEP_GBUFFER_OT_sampling_preset_add,
    DEEP_GBUFFER_OT_indirect_preset_add,
    DEEP_GBUFFER_OT_layers_preset_add,
)
