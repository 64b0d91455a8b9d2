# SPDX-License-Identifier: GPL-3.0-or-later
"""The Sampling panel: what a picture is sampled with, and when that is enough."""

from typing import Any

import bpy
from bl_ui.utils import PresetPanel

from .operators import SAMPLING_PRESETS, DEEP_GBUFFER_OT_sampling_preset_add
from .panels import CLOSED, EnginePanel


class DEEP_GBUFFER_PT_sampling_presets(PresetPanel, bpy.types.Panel):
    """Presets of the Sampling panel."""

    bl_label = "Sampling Presets"
    preset_subdir = SAMPLING_PRESETS
    preset_operator = "script.execute_preset"
    preset_add_operator = DEEP_GBUFFER_OT_sampling_preset_add.bl_idname


class DEEP_GBUFFER_PT_sampling(EnginePanel, bpy.types.Panel):
    """Samples of the final render and of viewports."""

    bl_label = "Sampling"

    def draw_header_preset(self, context: Any) -> None:
        """The presets menu."""
        DEEP_GBUFFER_PT_sampling_presets.draw_panel_header(self.layout)

    def draw(self, context: Any) -> None:
        """Samples, noise, time, seed."""
        settings = context.scene.deep_gbuffer
        column = self._column()
        samples = column.column(align=True)
        samples.prop(settings, "samples", text="Render")
        samples.prop(settings, "viewport_samples", text="Viewport")
        noise = column.row(align=True, heading="Noise Threshold")
        noise.prop(settings, "use_noise_threshold", text="")
        threshold = noise.row()
        threshold.active = settings.use_noise_threshold
        threshold.prop(settings, "noise_threshold", text="")
        column.prop(settings, "time_limit")
        column.prop(settings, "seed")


class DEEP_GBUFFER_PT_sampling_lights(EnginePanel, bpy.types.Panel):
    """How lights and world are sampled."""

    bl_label = "Lights"
    bl_parent_id = "DEEP_GBUFFER_PT_sampling"
    bl_options = CLOSED

    def draw(self, context: Any) -> None:
        """What bounds the cost of many lights, and of the world."""
        settings = context.scene.deep_gbuffer
        column = self._column()
        column.prop(settings, "light_threshold")
        column.prop(settings, "world_directions")


class DEEP_GBUFFER_PT_sampling_shadows(EnginePanel, bpy.types.Panel):
    """Shadow maps."""

    bl_label = "Shadows"
    bl_parent_id = "DEEP_GBUFFER_PT_sampling"
    bl_options = CLOSED

    def draw(self, context: Any) -> None:
        """Their size and memory, and how often they are drawn."""
        settings = context.scene.deep_gbuffer
        column = self._column()
        column.prop(settings, "shadow_map_size", text="Map Size")
        column.prop(settings, "shadow_memory", text="Pool Size")
        column.prop(settings, "shadow_updates")


CLASSES = (
    DEEP_GBUFFER_PT_sampling_presets,
    DEEP_GBUFFER_PT_sampling,
    DEEP_GBUFFER_PT_sampling_lights,
    DEEP_GBUFFER_PT_sampling_shadows,
)
