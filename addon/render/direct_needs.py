# SPDX-License-Identifier: GPL-3.0-or-later
"""What of the direct pass a scene needs. Pure: no OpenGL, no Blender."""

from ..scene import LightKind, Scene

DIRECT_DEFINES = (
    "SUN_LIGHTS",
    "AREA_LIGHTS",
    "SPHERE_LIGHTS",
    "DISK_LIGHTS",
    "SPOT_CONES",
    "SPECULAR",
    "WORLD",
    "EMISSION",
)
"""What the direct pass compiles only where a scene has it: drivers that draw on the CPU run every branch they have."""


def direct_needs(scene: Scene) -> dict[str, tuple[bool, str]]:
    """Per define of the direct pass, whether the scene needs it, and why not if it does not."""
    kinds = {light.kind for light in scene.lights}
    bulbs = {light.soft_falloff for light in scene.lights if light.kind in (LightKind.POINT, LightKind.SPOT)}
    materials = scene.materials.values()
    needed = (
        (LightKind.SUN in kinds, "no sun"),
        (LightKind.AREA in kinds, "no area light"),
        (False in bulbs, "no point or spot light without soft falloff"),
        (True in bulbs, "no point or spot light with soft falloff"),
        (LightKind.SPOT in kinds, "no spot light"),
        (any(material.is_glossy for material in materials), "no glossy material"),
        (max(scene.world.radiance) > 0.0, "the world is black"),
        (any(material.is_emissive for material in materials), "no emissive material"),
    )
    return dict(zip(DIRECT_DEFINES, needed, strict=True))
