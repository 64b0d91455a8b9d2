# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of objects, lights, materials and worlds: settings of theirs that Blender shows in other engines' panels."""

from typing import Any

import bpy

from .panels import CLOSED, EnginePanel

_SURFACES = {"MESH", "CURVE", "SURFACE", "META", "FONT"}
"""Types of objects that are rendered as meshes."""


class DEEP_GBUFFER_PT_object_ray_visibility(EnginePanel, bpy.types.Panel):
    """Which rays see an object."""

    bl_label = "Ray Visibility"
    bl_context = "object"
    bl_parent_id = "OBJECT_PT_visibility"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """For what is rendered, and for what places it."""
        item = context.object
        places = item is not None and item.instance_type != "NONE"
        return super().poll(context) and item is not None and (item.type in {*_SURFACES, "LIGHT"} or places)

    def draw(self, context: Any) -> None:
        """Camera and shadow of surfaces, diffuse and glossy of lights, all of them of instancers."""
        item = context.object
        is_light, is_surface = item.type == "LIGHT", item.type in _SURFACES
        column = self._column()
        if not is_light:
            column.prop(item, "visible_camera", text="Camera")
        if not is_surface:
            column.prop(item, "visible_diffuse", text="Diffuse")
            column.prop(item, "visible_glossy", text="Glossy")
        if not is_light:
            column.prop(item, "visible_shadow", text="Shadow")


class DEEP_GBUFFER_PT_light_shadow(EnginePanel, bpy.types.Panel):
    """Shadows of a light."""

    bl_label = "Shadow"
    bl_context = "data"
    bl_parent_id = "DATA_PT_EEVEE_light"
    bl_options = CLOSED

    @classmethod
    def poll(cls, context: Any) -> bool:
        """For lights."""
        return super().poll(context) and context.light is not None

    def draw_header(self, context: Any) -> None:
        """The switch."""
        self.layout.prop(context.light, "use_shadow", text="")

    def draw(self, context: Any) -> None:
        """The limit of the shadow maps' resolution, where it can be kept."""
        light = context.light
        sun = light.type == "SUN"
        column = self._column()
        column.active = light.use_shadow
        if not sun:
            column.prop(light, "use_absolute_resolution")
        limit = column.column()
        limit.active = sun or light.use_absolute_resolution
        limit.prop(light, "shadow_maximum_resolution", text="Resolution Limit")


class DEEP_GBUFFER_PT_material_settings(EnginePanel, bpy.types.Panel):
    """How an emissive material lights the scene."""

    bl_label = "Settings"
    bl_context = "material"
    bl_options = CLOSED

    @classmethod
    def poll(cls, context: Any) -> bool:
        """For materials of surfaces, as long as the Cycles add-on, whose setting it is, is enabled."""
        material = context.material
        return super().poll(context) and hasattr(material, "cycles") and not material.grease_pencil

    def draw(self, context: Any) -> None:
        """Cycles' own setting."""
        self._column().prop(context.material.cycles, "emission_sampling")


class DEEP_GBUFFER_PT_world_ray_visibility(EnginePanel, bpy.types.Panel):
    """Which rays see the world."""

    bl_label = "Ray Visibility"
    bl_context = "world"
    bl_options = CLOSED

    @classmethod
    def poll(cls, context: Any) -> bool:
        """For worlds, as long as the Cycles add-on, whose settings they are, is enabled."""
        return super().poll(context) and hasattr(context.world, "cycles_visibility")

    def draw(self, context: Any) -> None:
        """Those of Cycles' own settings that are read."""
        visibility = context.world.cycles_visibility
        column = self._column()
        for name in ("camera", "diffuse", "glossy"):
            column.prop(visibility, name)


CLASSES = (
    DEEP_GBUFFER_PT_object_ray_visibility,
    DEEP_GBUFFER_PT_light_shadow,
    DEEP_GBUFFER_PT_material_settings,
    DEEP_GBUFFER_PT_world_ray_visibility,
)
