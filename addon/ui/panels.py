# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine's own panels in the render, output and view layer tabs."""

from typing import Any

import bpy
from bl_ui.utils import PresetPanel

from ..engine import passes, statistics
from ..engine.settings import GuardBandUnit, SeparationUnit, indirect
from ..render import reads_past_the_edge
from ..render.indirect_plan import INDIRECT_DEBUG_VIEWS, reads_layers
from ..scene import DebugView, IndirectMethod, Variant
from .operators import (
    LAYERS_PRESETS,
    DEEP_GBUFFER_OT_copy_statistics,
    DEEP_GBUFFER_OT_layers_preset_add,
)

CLOSED: Any = {"DEFAULT_CLOSED"}
"""Panels that start folded."""


class EnginePanel:
    """A panel of the Properties editor that only our engine shows."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    layout: Any

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Whether the scene renders with our engine."""
        return context.engine == statistics.ENGINE

    def _column(self) -> Any:
        """A column in Blender's usual two-column style."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        return self.layout.column()


class DEEP_GBUFFER_PT_shading(EnginePanel, bpy.types.Panel):
    """How surfaces reflect direct light."""

    bl_label = "Shading"
    bl_options = CLOSED

    def draw(self, context: Any) -> None:
        """The model."""
        self._column().prop(context.scene.deep_gbuffer, "shading_model", text="Model")


class DEEP_GBUFFER_PT_layers_presets(PresetPanel, bpy.types.Panel):
    """Presets of the Deep G-Buffer panel."""

    bl_label = "Deep G-Buffer Presets"
    preset_subdir = LAYERS_PRESETS
    preset_operator = "script.execute_preset"
    preset_add_operator = DEEP_GBUFFER_OT_layers_preset_add.bl_idname


class DEEP_GBUFFER_PT_layers(EnginePanel, bpy.types.Panel):
    """The deep G-buffer itself."""

    bl_label = "Deep G-Buffer"

    def draw_header_preset(self, context: Any) -> None:
        """The presets menu."""
        DEEP_GBUFFER_PT_layers_presets.draw_panel_header(self.layout)

    def draw(self, context: Any) -> None:
        """Layers, how they are found, and their separation."""
        settings = context.scene.deep_gbuffer
        column = self._column()
        column.prop(settings, "layers")
        several = column.column()
        several.active = settings.layers > 1
        several.prop(settings, "variant")
        several.prop(settings, "separation_unit")
        relative = settings.separation_unit == SeparationUnit.RELATIVE
        several.prop(settings, "relative_separation" if relative else "minimum_separation", text="Minimum")
        if settings.layers > 1 and not _reads_deeper_layers(settings):
            column.label(text="Nothing reads more than one with these settings", icon="INFO")


class DEEP_GBUFFER_PT_guard_band(EnginePanel, bpy.types.Panel):
    """What is rendered past the picture's edge."""

    bl_label = "Guard Band"
    bl_parent_id = "DEEP_GBUFFER_PT_layers"
    bl_options = CLOSED

    def draw_header(self, context: Any) -> None:
        """The switch."""
        settings = context.scene.deep_gbuffer
        self.layout.active = _reads_past_the_edge(settings)
        self.layout.prop(settings, "use_guard_band", text="")

    def draw(self, context: Any) -> None:
        """Its width."""
        settings = context.scene.deep_gbuffer
        column = self._column()
        column.active = settings.use_guard_band and _reads_past_the_edge(settings)
        column.prop(settings, "guard_band_unit")
        percent = settings.guard_band_unit == GuardBandUnit.PERCENT
        column.prop(settings, "guard_band_percent" if percent else "guard_band_pixels")


def _reads_deeper_layers(settings: Any) -> bool:
    """Whether anything that is switched on reads a layer behind the first."""
    shown = settings.debug_view != DebugView.NONE and settings.debug_layer > 1
    return settings.save_layers or settings.save_deep or shown or _marches(settings)


def _reads_past_the_edge(settings: Any) -> bool:
    """Whether anything that is switched on reads the guard band."""
    reprojects = settings.layers > 1 and reads_past_the_edge(Variant(settings.variant))
    return reprojects or settings.indirect.method != IndirectMethod.NONE


def _marches(settings: Any) -> bool:
    """Whether indirect light is looked for in the layers, by final renders or by viewports."""
    group = settings.indirect
    return any(reads_layers(indirect(group, quality)) for quality in (group.render, group.viewport))


class DEEP_GBUFFER_PT_film(EnginePanel, bpy.types.Panel):
    """Pixel filter and background."""

    bl_label = "Film"
    bl_options = CLOSED

    def draw(self, context: Any) -> None:
        """Blender's own film settings."""
        column = self._column()
        column.prop(context.scene.render, "filter_size")
        column.prop(context.scene.render, "film_transparent", text="Transparent")


class DEEP_GBUFFER_PT_debug_view(EnginePanel, bpy.types.Panel):
    """One channel of the deep G-buffer instead of the picture."""

    bl_label = "Debug View"
    bl_options = CLOSED

    def draw(self, context: Any) -> None:
        """Channel and layer."""
        settings = context.scene.deep_gbuffer
        column = self._column()
        column.prop(settings, "debug_view", text="Channel")
        layer = column.column()
        layer.active = settings.debug_view not in {DebugView.NONE, *INDIRECT_DEBUG_VIEWS}
        layer.prop(settings, "debug_layer")


class DEEP_GBUFFER_PT_layer_output(EnginePanel, bpy.types.Panel):
    """Files with every layer."""

    bl_label = "Layer Output"
    bl_context = "output"
    bl_options = CLOSED

    def draw(self, context: Any) -> None:
        """Which files, and where."""
        settings = context.scene.deep_gbuffer
        column = self._column()
        column.prop(settings, "save_layers")
        motion = column.column()
        motion.active = settings.save_layers
        motion.prop(settings, "save_motion")
        exits = column.column()
        exits.active = settings.save_layers or settings.save_deep
        exits.prop(settings, "save_exit")
        column.prop(settings, "save_deep")
        column.prop(settings, "save_snapshot")
        path = column.column()
        path.active = settings.save_layers or settings.save_deep or settings.save_snapshot
        path.prop(settings, "layers_path", text="Path")


class DEEP_GBUFFER_PT_view_layer_passes(EnginePanel, bpy.types.Panel):
    """The passes that the engine delivers."""

    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context: Any) -> None:
        """One box per pass of the table."""
        column = self._column()
        for item in passes.PASSES:
            if item.flag:
                column.prop(context.view_layer, item.flag, text=item.names[-1])


class DEEP_GBUFFER_PT_statistics(EnginePanel, bpy.types.Panel):
    """What the last final render did and cost."""

    bl_label = "Statistics"
    bl_options = CLOSED

    def draw(self, context: Any) -> None:
        """Times, passes, passes left out with the reason, and memory."""
        last = statistics.last(context.scene.name)
        if last is None:
            self.layout.label(text="No final render yet.")
            return
        table(self.layout, "Time", [(label, f"{last[key]:.3f} s") for key, label in TIMES])
        table(self.layout, "Passes (last sample)", [(item["name"], f"{item['ms']:.2f} ms") for item in last["passes"]])
        table(self.layout, "Left out", [(item["name"], item["reason"]) for item in last["left_out"]])
        table(self.layout, "Memory", [(name, f"{size / 2**20:.1f} MiB") for name, size in last["bytes"].items()])
        counts = [(key.capitalize(), f"{last[key]:,}") for key in ("samples", "triangles", "draws", "instances")]
        ended = [("Ended by", last["ended_by"].capitalize())] if last["ended_by"] else []
        table(self.layout, "Scene", [*counts, *ended, ("Device", last["device"])])
        self.layout.operator(DEEP_GBUFFER_OT_copy_statistics.bl_idname, icon="COPYDOWN")


TIMES = (
    ("sync_s", "Reading the scene"),
    ("upload_s", "Upload"),
    ("first_picture_s", "First picture"),
    ("sample_s", "One sample"),
    ("total_s", "Total"),
)


def table(layout: Any, title: str, rows: list[tuple[str, str]]) -> None:
    """A box with a title, and rows of name and value; nothing where there are no rows."""
    if not rows:
        return
    box = layout.box().column(align=True)
    box.label(text=title)
    for name, value in rows:
        row = box.split(factor=0.4)
        row.label(text=name)
        row.label(text=value)


CLASSES = (
    DEEP_GBUFFER_PT_shading,
    DEEP_GBUFFER_PT_layers_presets,
    DEEP_GBUFFER_PT_layers,
    DEEP_GBUFFER_PT_guard_band,
    DEEP_GBUFFER_PT_film,
    DEEP_GBUFFER_PT_debug_view,
    DEEP_GBUFFER_PT_statistics,
    DEEP_GBUFFER_PT_layer_output,
    DEEP_GBUFFER_PT_view_layer_passes,
)
