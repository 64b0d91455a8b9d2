# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of scenes that both engines render: materials, things, lights, a camera; and a still life to be lit."""

from typing import Any

import bpy
import numpy as np
from mathutils import Vector

Point = tuple[float, float, float]

MATTE = {"Base Color": (0.7, 0.5, 0.3, 1.0), "Roughness": 1.0, "Specular IOR Level": 0.0}
METAL = {"Base Color": (0.9, 0.7, 0.4, 1.0), "Roughness": 0.4, "Metallic": 1.0}
PLASTIC = {"Base Color": (0.3, 0.5, 0.7, 1.0), "Roughness": 0.5}
CLAY = {**MATTE, "Diffuse Roughness": 1.0}

LAMP_LOCATION, LAMP_TARGET = (-1.0, -0.8, 2.6), (0.1, 0.1, 0.2)


def empty_scene(width: int = 64, height: int = 40) -> bpy.types.Scene:
    """Nothing, seen by nobody; light does not bounce."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    scene.cycles.max_bounces = 0
    return scene


def material(name: str, values: dict[str, Any]) -> bpy.types.Material:
    """A Principled material with some of its inputs set."""
    result = bpy.data.materials.new(name)
    result.use_nodes = True
    inputs = node(result.node_tree, "BSDF_PRINCIPLED").inputs
    for socket, value in values.items():
        inputs[socket].default_value = value
    return result


def cut_out(name: str, values: dict[str, Any], pixels: np.ndarray) -> bpy.types.Material:
    """A Principled material whose colour and alpha are an image's (N, N, 4), its texels unfiltered."""
    side = len(pixels)
    image = bpy.data.images.new(name, side, side, alpha=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    result = material(name, values)
    texture = result.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, "Closest"
    inputs = node(result.node_tree, "BSDF_PRINCIPLED").inputs
    result.node_tree.links.new(texture.outputs["Color"], inputs["Base Color"])
    result.node_tree.links.new(texture.outputs["Alpha"], inputs["Alpha"])
    return result


def node(tree: bpy.types.NodeTree, kind: str) -> bpy.types.Node:
    """The first node of a type; Blender may have translated its name."""
    return next(item for item in tree.nodes if item.type == kind)


def finished(surface: bpy.types.Material, *, smooth: bool = False) -> bpy.types.Object:
    """The object that an operator has just added, with its material."""
    result = bpy.context.object
    result.data.materials.append(surface)
    if smooth:
        result.data.shade_smooth()
    return result


def toward(location: Point, target: Point) -> Any:
    """Euler angles that turn −z from a place to another, +y up."""
    return (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()


def plane(size: float, surface: bpy.types.Material, location: Point = (0, 0, 0), turn: Point = (0, 0, 0)) -> Any:
    """A square that faces +Z before it is turned."""
    bpy.ops.mesh.primitive_plane_add(size=size, location=location, rotation=turn)
    return finished(surface)


def sphere(radius: float, surface: bpy.types.Material, location: Point, segments: int = 64) -> Any:
    """A smooth sphere, half as many faces high as around."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=segments, ring_count=segments // 2, radius=radius, location=location)
    return finished(surface, smooth=True)


def box(size: float, surface: bpy.types.Material, location: Point, turn: float = 0.0) -> Any:
    """A cube, turned about z."""
    bpy.ops.mesh.primitive_cube_add(size=size, location=location, rotation=(0.0, 0.0, turn))
    return finished(surface)


def camera(scene: bpy.types.Scene, location: Point, target: Point, lens: float = 50.0) -> bpy.types.Object:
    """The scene's camera, which looks at a point."""
    result = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    result.data.lens = lens
    result.location = location
    result.rotation_euler = toward(location, target)
    scene.collection.objects.link(result)
    scene.camera = result
    return result


def lamp(
    scene: bpy.types.Scene,
    kind: str,
    location: Point = LAMP_LOCATION,
    target: Point = LAMP_TARGET,
    scale: Point = (1.0, 1.0, 1.0),
    **properties: Any,
) -> bpy.types.Object:
    """A light that shines towards a point, with some of its properties set; `kind` is Blender's type."""
    light = bpy.data.lights.new(kind.title(), kind)
    for name, value in properties.items():
        setattr(light, name, value)
    result = bpy.data.objects.new(kind.title(), light)
    result.location, result.rotation_euler, result.scale = location, toward(location, target), scale
    scene.collection.objects.link(result)
    return result


def sun(scene: bpy.types.Scene, direction: Point, **properties: Any) -> bpy.types.Object:
    """A sun that shines along a direction."""
    return lamp(scene, "SUN", (0.0, 0.0, 0.0), direction, **properties)


def still_life(
    width: int = 64, height: int = 40, *, ground: dict[str, Any] = MATTE, ball: dict[str, Any] = METAL
) -> bpy.types.Scene:
    """A ball and a box on the ground, which touch it: umbra, penumbra and contact shadows, and nothing that shines."""
    scene = empty_scene(width, height)
    plane(6.0, material("Ground", ground)).name = "Ground"
    sphere(0.6, material("Ball", ball), (0.55, 0.1, 0.6)).name = "Ball"
    box(0.8, material("Box", PLASTIC), (-0.75, 0.5, 0.4), turn=0.5).name = "Box"
    camera(scene, (0.1, -4.6, 3.4), (0.1, 0.0, 0.45), lens=46.0)
    return scene
