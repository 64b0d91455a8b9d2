# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine's own panels in the render, output and view layer tabs."""

from typing import Any

import bpy
from bl_ui.utils import PresetPanel

from ..engine import passes, statistics
from ..engine.settings import GuardBandUnit, SeparationUnit
from ..render import reads_past_the_edge
from ..scene import DebugView, Variant
from .operators import (
    LAYERS_PRESETS,
    SAMPLING_PRESETS,
    DEEP_GBUFFER_OT_copy_statistics,
    DEEP_GBUFFER_OT_layers_preset_add,
    DEEP_GBUFFER_OT_sampling_preset_add,
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
        """Samples, time, seed."""
        settings = context.scene.deep_gbuffer
        column = self._column()
        samples = column.column(align=True)
        samples.prop(settings, "samples", text="Render")
        samples.prop(settings, "viewport_samples", text="Viewport")
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
            column.label(text="Only layer output and debug views read them yet", icon="INFO")


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
    return settings.save_layers or settings.save_deep or shown


def _reads_past_the_edge(settings: Any) -> bool:
    """Whether anything that is switched on reads the guard band."""
    return settings.layers > 1 and reads_past_the_edge(Variant(settings.variant))


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
        layer.active = settings.debug_view != "NONE"
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
        table(self.layout, "Scene", [*counts, ("Device", last["device"])])
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
    DEEP_GBUFFER_PT_sampling_presets,
    DEEP_GBUFFER_PT_sampling,
    DEEP_GBUFFER_PT_sampling_lights,
    DEEP_GBUFFER_PT_sampling_shadows,
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
