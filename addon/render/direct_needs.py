# SPDX-License-Identifier: GPL-3.0-or-later
"""What of the passes that light surfaces a scene needs. Pure: no OpenGL, no Blender."""

from ..scene import ALL_GROUPS, LightKind, RenderSettings, Scene, ShadingModel
from .light_reach import MANY_LIGHTS
from .lighting_plan import LightPlan

LIGHT_DEFINES = ("SUN_LIGHTS", "AREA_LIGHTS", "SPHERE_LIGHTS", "DISK_LIGHTS", "MESH_LIGHTS", "WORLD_LIGHTS")
"""Kinds of light; the direct pass has a loop over lights where it has any of them."""

DIRECT_DEFINES = (
    *LIGHT_DEFINES,
    "SPOT_CONES",
    "SPECULAR",
    "DIFFUSE_ROUGHNESS",
    "PHONG",
    "WORLD",
    "ENVIRONMENT",
    "EMISSION",
    "SHADOWS",
    "LINKING",
    "MANY_LIGHTS",
)
"""What the direct pass compiles only where a scene has it: drivers that draw on the CPU run every branch they have."""

GOURAUD_DEFINES = tuple(name for name in DIRECT_DEFINES if name not in ("DIFFUSE_ROUGHNESS", "SHADOWS", "MANY_LIGHTS"))
"""What the gouraud pass compiles in the same way. It always has PHONG."""


def direct_needs(scene: Scene, settings: RenderSettings, lights: LightPlan) -> dict[str, tuple[bool, str]]:
    """Per define of the direct pass, whether the scene needs it, and why not if it does not."""
    kinds = {light.kind for light in lights.lights}
    bulbs = {light.soft_falloff for light in lights.lights if light.kind in (LightKind.POINT, LightKind.SPOT)}
    world, materials = scene.world, scene.materials.values()
    linked = any(light.receiver_groups != ALL_GROUPS for light in lights.lights)
    physical = settings.shading_model is ShadingModel.PHYSICAL
    shines, dark = world.shines, "the world is black or lights nothing"
    if lights.world_gathered:
        shines = world.seen_by_glossy and any(material.is_glossy for material in materials)
        dark = "the indirect method finds the world's diffuse light, and nothing is glossy"
    needed = {
        "SUN_LIGHTS": (LightKind.SUN in kinds, "no sun"),
        "AREA_LIGHTS": (LightKind.AREA in kinds, "no area light"),
        "SPHERE_LIGHTS": (False in bulbs, "no point or spot light without soft falloff"),
        "DISK_LIGHTS": (True in bulbs, "no point or spot light with soft falloff"),
        "MESH_LIGHTS": (bool(lights.mesh_lights), "no emissive surface is sampled as a light"),
        "WORLD_LIGHTS": (lights.world_directions > 0, dark),
        "SPOT_CONES": (LightKind.SPOT in kinds, "no spot light"),
        "SPECULAR": (any(material.is_glossy for material in materials), "no glossy material"),
        "DIFFUSE_ROUGHNESS": (
            physical and any(material.diffuse_roughness > 0.0 for material in materials),
            "no material has diffuse roughness, or Phong shading knows none",
        ),
        "PHONG": (not physical, "shading is not Phong's"),
        "WORLD": (shines, dark),
        "ENVIRONMENT": (shines and world.environment is not None, "the world has one colour"),
        "EMISSION": (any(material.is_emissive for material in materials), "no emissive material"),
        "SHADOWS": (lights.casts_shadows, "no light casts a shadow, or nothing is in its way"),
        "LINKING": (linked, "every light shines on everything"),
        "MANY_LIGHTS": (lights.many, f"no more than {MANY_LIGHTS} lamps"),
    }
    return {name: needed[name] for name in DIRECT_DEFINES}


def direct_program_defines(defines: frozenset[str], *, preview: bool) -> frozenset[str]:
    """The defines of one sample's program: a preview has lamps and the world whole, others sample them.

    Only reflections that are too smooth for its samples show the world as it is.
    """
    chosen = set(defines)
    if preview:
        chosen.add("PREVIEW")
        chosen.discard("WORLD_LIGHTS")
    elif not {"SPECULAR", "WORLD_LIGHTS"} <= defines:
        chosen -= {"WORLD", "ENVIRONMENT"}
    if chosen & set(LIGHT_DEFINES):
        chosen.add("LIGHTS")
    else:
        chosen -= {"SHADOWS", "LINKING", "MANY_LIGHTS"}
    return frozenset(chosen)
