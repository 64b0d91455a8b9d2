# SPDX-License-Identifier: GPL-3.0-or-later
"""The Indirect Light panel: the method, and of its settings those that it reads."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import bpy
from bl_ui.utils import PresetPanel

from ..scene import IndirectMethod
from ..scene.quality import QualityNumbers
from .operators import INDIRECT_PRESETS, DEEP_GBUFFER_OT_indirect_preset_add
from .panels import CLOSED, EnginePanel

_FILTERS = {"divisor", "spatial_filter", "temporal_filter"}
_OCCLUSION = _FILTERS | {"taps", "radius"}
_RAYS = _FILTERS | {"rays", "bounces", "exit_surfaces"}

READ: Mapping[str, set[str]] = {
    IndirectMethod.NONE: set(),
    IndirectMethod.OCCLUSION: _OCCLUSION,
    IndirectMethod.SSAO: _OCCLUSION,
    IndirectMethod.RADIOSITY: _OCCLUSION | {"bounces", "paper_composite"},
    IndirectMethod.DEEP_MARCH: _RAYS | {"march_steps", "march_distance"},
    IndirectMethod.MARCH_GRID: _RAYS | {"contact_steps", "cells", "cell_rays", "cell_size", "grid_memory"},
}
"""Which of the numbers of `IndirectSettings` each method reads."""


class DEEP_GBUFFER_PT_indirect_presets(PresetPanel, bpy.types.Panel):
    """Presets of the Indirect Light panel."""

    bl_label = "Indirect Light Presets"
    preset_subdir = INDIRECT_PRESETS
    preset_operator = "script.execute_preset"
    preset_add_operator = DEEP_GBUFFER_OT_indirect_preset_add.bl_idname


class DEEP_GBUFFER_PT_indirect(EnginePanel, bpy.types.Panel):
    """How light that surfaces reflect at each other is found."""

    bl_label = "Indirect Light"

    def draw_header_preset(self, context: Any) -> None:
        """The presets menu."""
        DEEP_GBUFFER_PT_indirect_presets.draw_panel_header(self.layout)

    def draw(self, context: Any) -> None:
        """The method, and what renders and viewports share."""
        indirect = context.scene.deep_gbuffer.indirect
        reads = READ[indirect.method]
        column = self._column()
        column.prop(indirect, "method")
        if "bounces" in reads:
            bounces = column.column()
            bounces.active = not indirect.unlimited_bounces
            bounces.prop(indirect, "bounces")
            column.prop(indirect, "unlimited_bounces")
        for name in ("radius", "march_distance", "paper_composite"):
            if name in reads:
                column.prop(indirect, name)
        if "exit_surfaces" in reads:
            exits = column.column()
            exits.active = "contact_steps" not in reads or any(
                quality.contact_steps for quality in (indirect.render, indirect.viewport)
            )
            exits.prop(indirect, "exit_surfaces")


class _MethodPanel(EnginePanel):
    """A part of the Indirect Light panel."""

    bl_parent_id = "DEEP_GBUFFER_PT_indirect"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only where there is indirect light."""
        return super().poll(context) and context.scene.deep_gbuffer.indirect.method != IndirectMethod.NONE


class _QualityPanel(_MethodPanel):
    """The numbers of renders or of viewports."""

    def _draw_numbers(self, indirect: Any, quality: Any) -> None:
        """The preset, and those numbers that the method reads."""
        column = self._column()
        column.prop(quality, "preset")
        for number in fields(QualityNumbers):
            if number.name in READ[indirect.method]:
                column.prop(quality, number.name)


class DEEP_GBUFFER_PT_indirect_viewport(_QualityPanel, bpy.types.Panel):
    """The numbers of viewports."""

    bl_label = "Viewport"

    def draw(self, context: Any) -> None:
        """Preset and numbers."""
        indirect = context.scene.deep_gbuffer.indirect
        self._draw_numbers(indirect, indirect.viewport)


class DEEP_GBUFFER_PT_indirect_render(_QualityPanel, bpy.types.Panel):
    """The numbers of final renders."""

    bl_label = "Render"

    def draw(self, context: Any) -> None:
        """Preset and numbers."""
        indirect = context.scene.deep_gbuffer.indirect
        self._draw_numbers(indirect, indirect.render)


class DEEP_GBUFFER_PT_indirect_grid(_MethodPanel, bpy.types.Panel):
    """The radiance grid."""

    bl_label = "Radiance Grid"
    bl_options = CLOSED

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only where the method has one."""
        return super().poll(context) and "cell_size" in READ[context.scene.deep_gbuffer.indirect.method]

    def draw(self, context: Any) -> None:
        """Size and memory of its cells."""
        indirect = context.scene.deep_gbuffer.indirect
        column = self._column()
        column.prop(indirect, "cell_size")
        column.prop(indirect, "grid_memory")


class DEEP_GBUFFER_PT_indirect_filters(_MethodPanel, bpy.types.Panel):
    """What smooths noise."""

    bl_label = "Filters"
    bl_options = CLOSED

    def draw(self, context: Any) -> None:
        """In space and in time."""
        indirect = context.scene.deep_gbuffer.indirect
        column = self._column()
        column.prop(indirect, "spatial_filter")
        column.prop(indirect, "temporal_filter")


CLASSES = (
    DEEP_GBUFFER_PT_indirect_presets,
    DEEP_GBUFFER_PT_indirect,
    DEEP_GBUFFER_PT_indirect_viewport,
    DEEP_GBUFFER_PT_indirect_render,
    DEEP_GBUFFER_PT_indirect_grid,
    DEEP_GBUFFER_PT_indirect_filters,
)
