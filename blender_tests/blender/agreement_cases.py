# SPDX-License-Identifier: GPL-3.0-or-later
"""Every kind of light on the still life: lamps of each type and shape, worlds, a mesh, links, and a pierced caster."""

import math
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from agreement_scenes import (
    CLAY,
    LAMP_LOCATION,
    LAMP_TARGET,
    MATTE,
    PLASTIC,
    cut_out,
    lamp,
    material,
    node,
    plane,
    still_life,
    toward,
)

Case = Callable[..., bpy.types.Scene]
"""Builds the lit scene; takes the arguments of `still_life`."""

LAMPS: dict[str, dict[str, Any]] = {
    "point without size": {"kind": "POINT", "energy": 120.0, "shadow_soft_size": 0.0},
    "point, coloured": {"kind": "POINT", "energy": 120.0, "shadow_soft_size": 0.1, "color": (1.0, 0.4, 0.1)},
    "point, soft falloff": {"kind": "POINT", "energy": 120.0, "shadow_soft_size": 0.4},
    "point, sphere": {"kind": "POINT", "energy": 120.0, "shadow_soft_size": 0.4, "use_soft_falloff": False},
    "spot without size": {"kind": "SPOT", "shadow_soft_size": 0.0},
    "spot, soft falloff": {"kind": "SPOT", "shadow_soft_size": 0.2},
    "spot, sphere": {"kind": "SPOT", "shadow_soft_size": 0.2, "use_soft_falloff": False},
    "sun, sharp": {"kind": "SUN", "angle": 0.0},
    "sun, wide": {"kind": "SUN", "angle": math.radians(30)},
    "square": {"kind": "AREA", "shape": "SQUARE", "size": 1.2},
    "rectangle": {"kind": "AREA", "shape": "RECTANGLE", "size": 2.0, "size_y": 0.5},
    "disk": {"kind": "AREA", "shape": "DISK", "size": 1.2},
    "ellipse": {"kind": "AREA", "shape": "ELLIPSE", "size": 2.0, "size_y": 0.6},
    "rectangle, scaled": {"kind": "AREA", "shape": "RECTANGLE", "size": 1.0, "size_y": 0.5, "scale": (2.0, 1.5, 1.0)},
    "square with spread": {"kind": "AREA", "shape": "SQUARE", "size": 1.2, "spread": math.radians(80)},
}
COMMON: dict[str, dict[str, Any]] = {
    "SPOT": {"energy": 300.0, "spot_size": math.radians(70), "spot_blend": 0.4},
    "AREA": {"energy": 80.0},
    "SUN": {"energy": 3.0, "location": (-2.5, -0.6, 2.0)},
}


def lit_by(properties: dict[str, Any]) -> Case:
    """The still life under one lamp."""

    def build(*size: int, **surfaces: Any) -> bpy.types.Scene:
        scene = still_life(*size, **surfaces)
        lamp(scene, **{**COMMON.get(properties["kind"], {}), **properties})
        return scene

    return build


def under(paint: Callable[[bpy.types.NodeTree, bpy.types.Node], None]) -> Case:
    """The still life under a world whose nodes `paint` links to the Background node that it gets."""

    def build(*size: int, **surfaces: Any) -> bpy.types.Scene:
        scene = still_life(*size, **surfaces)
        world = bpy.data.worlds.new("World")
        world.use_nodes = True
        world.cycles.sampling_method, world.cycles.sample_map_resolution = "MANUAL", 1024  # of noise, not of the light
        scene.world = world
        paint(world.node_tree, node(world.node_tree, "BACKGROUND"))
        return scene

    return build


def constant(_tree: bpy.types.NodeTree, background: bpy.types.Node) -> None:
    """One colour from everywhere."""
    background.inputs["Color"].default_value = (0.2, 0.5, 0.9, 1.0)
    background.inputs["Strength"].default_value = 1.5


def gradient(tree: bpy.types.NodeTree, background: bpy.types.Node) -> None:
    """From a dark warm colour at one side of the horizon to a bright cold one at the other, linearly in x."""
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    mapping = tree.nodes.new("ShaderNodeMapping")  # −1…1 to 0…1
    mapping.inputs["Location"].default_value = (0.5, 0.0, 0.0)
    mapping.inputs["Scale"].default_value = (0.5, 1.0, 1.0)
    along = tree.nodes.new("ShaderNodeTexGradient")
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].color = (0.3, 0.1, 0.05, 1.0)
    ramp.color_ramp.elements[1].color = (0.4, 0.9, 1.5, 1.0)
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], along.inputs["Vector"])
    tree.links.new(along.outputs["Factor" if "Factor" in along.outputs else "Fac"], ramp.inputs[0])
    tree.links.new(ramp.outputs["Color"], background.inputs["Color"])


def panorama(height: int = 64) -> bpy.types.Image:
    """A high-dynamic-range sky, brown ground and a sun of three texels a side that shines as much as the sky does."""
    rows, columns = np.meshgrid(np.arange(height), np.arange(2 * height), indexing="ij")
    up = np.sin((rows + 0.5) / height * np.pi - 0.5 * np.pi)
    around = np.cos((columns + 0.5) / (2 * height) * 2.0 * np.pi)
    pixels = np.ones((height, 2 * height, 4), np.float32)
    pixels[..., :3] = np.where(up[..., None] > 0.0, (0.25, 0.45, 0.8), (0.25, 0.15, 0.08))
    pixels[..., :3] *= (1.0 + 0.5 * around)[..., None]
    middle = (int(0.78 * height), int(0.7 * height))
    pixels[middle[0] - 1 : middle[0] + 2, middle[1] - 1 : middle[1] + 2, :3] = (220.0, 190.0, 150.0)
    image = bpy.data.images.new("Panorama", 2 * height, height, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def environment(tree: bpy.types.NodeTree, background: bpy.types.Node) -> None:
    """A panorama with a small sun, turned about z."""
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (0.0, 0.0, math.radians(75.0))
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = panorama()
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])


def sky(*, disc: bool) -> Callable[[bpy.types.NodeTree, bpy.types.Node], None]:
    """The version's sky of single scattering, with the sun 35° above the horizon."""

    def paint(tree: bpy.types.NodeTree, background: bpy.types.Node) -> None:
        texture = tree.nodes.new("ShaderNodeTexSky")
        texture.sky_type = "SINGLE_SCATTERING" if bpy.app.version >= (5, 0, 0) else "NISHITA"
        texture.sun_disc, texture.sun_size = disc, math.radians(3.0)
        texture.sun_elevation, texture.sun_rotation = math.radians(35.0), math.radians(-60.0)
        tree.links.new(texture.outputs["Color"], background.inputs["Color"])
        background.inputs["Strength"].default_value = 0.1

    return paint


def glowing_mesh(*size: int, **surfaces: Any) -> bpy.types.Scene:
    """The still life under a square that emits on both sides."""
    scene = still_life(*size, **surfaces)
    colors = {"Base Color": (0.0, 0.0, 0.0, 1.0), "Emission Color": (1.0, 0.8, 0.6, 1.0), "Emission Strength": 12.0}
    plane(1.2, material("Glow", {**MATTE, **colors}), LAMP_LOCATION, toward(LAMP_LOCATION, LAMP_TARGET))
    return scene


def linked(*size: int, **surfaces: Any) -> bpy.types.Scene:
    """One lamp that lights all but the box, and one that nothing but the ball shadows."""
    scene = still_life(*size, **surfaces)
    first = lamp(scene, "POINT", energy=60.0, shadow_soft_size=0.2)
    second = lamp(scene, "POINT", (1.2, -1.6, 2.4), energy=60.0, shadow_soft_size=0.2, color=(0.4, 0.7, 1.0))
    lit, casting = bpy.data.collections.new("Lit"), bpy.data.collections.new("Casting")
    for collection, names in ((lit, ("Ground", "Ball")), (casting, ("Ball",))):
        for name in names:
            collection.objects.link(bpy.data.objects[name])
    first.light_linking.receiver_collection = lit
    second.light_linking.blocker_collection = casting
    return scene


def without_shadow(*size: int, **surfaces: Any) -> bpy.types.Scene:
    """A lamp whose light passes through everything."""
    scene = still_life(*size, **surfaces)
    lamp(scene, "POINT", energy=120.0, shadow_soft_size=0.2, use_shadow=False)
    return scene


def pierced_caster(*size: int, **surfaces: Any) -> bpy.types.Scene:
    """A card of which a texture's alpha leaves a chequerboard, between a lamp and the still life."""
    scene = still_life(*size, **surfaces)
    card = plane(1.6, pierced(), (-0.4, -0.1, 1.6))
    card.visible_camera = False  # only its shadow is judged: its alpha is tested where Cycles mixes
    lamp(scene, "POINT", energy=120.0, shadow_soft_size=0.03)  # its many edges would be nothing but penumbra
    return scene


def pierced(squares: int = 2, texels: int = 16) -> bpy.types.Material:
    """A material that is there on every other square of a chequerboard."""
    rows, columns = np.meshgrid(np.arange(squares * texels), np.arange(squares * texels), indexing="ij")
    pixels = np.ones((*rows.shape, 4), np.float32)
    pixels[..., 3] = (rows // texels + columns // texels) % 2
    return cut_out("Pierced", PLASTIC, pixels)


def clay(*size: int, **surfaces: Any) -> bpy.types.Scene:
    """Rough diffuse ground and ball, which Cycles shades after Oren and Nayar."""
    return lit_by(LAMPS["point, soft falloff"])(*size, **{"ground": CLAY, "ball": CLAY, **surfaces})


LIGHTS: dict[str, Case] = {name: lit_by(properties) for name, properties in LAMPS.items()} | {
    "lamp without shadow": without_shadow,
    "emissive mesh": glowing_mesh,
    "light and shadow linking": linked,
    "pierced caster": pierced_caster,
    "rough diffuse": clay,
}
WORLDS: dict[str, Case] = {
    "world, constant": under(constant),
    "world, gradient": under(gradient),
    "world, panorama": under(environment),
    "world, sky without disc": under(sky(disc=False)),
    "world, sky with disc": under(sky(disc=True)),
}
NOISY = ("pierced caster", *WORLDS)
"""Cases that Cycles needs more samples for."""
