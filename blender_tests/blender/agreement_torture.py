# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes that shadow maps fail on: grazing light, narrow gaps, pierced and thin casters, unseen ones, scale."""

import math
from typing import Any

import bpy
import numpy as np
from agreement_scenes import MATTE, box, camera, cut_out, empty_scene, finished, lamp, material, plane, sphere

Point = tuple[float, float, float]

WIDTH, HEIGHT = 96, 60
WALL = {**MATTE, "Base Color": (0.6, 0.6, 0.65, 1.0)}
LEAF_TEXELS = 24


def sun(scene: bpy.types.Scene, elevation: float, azimuth: float, angle: float) -> None:
    """A sun of 3 W/m² that stands at an elevation and azimuth from +X, of an angular diameter; degrees."""
    high, around = math.radians(elevation), math.radians(azimuth)
    place = (math.cos(high) * math.cos(around), math.cos(high) * math.sin(around), math.sin(high))
    lamp(scene, "SUN", place, (0.0, 0.0, 0.0), energy=3.0, angle=math.radians(angle))


def grazing_sun(width: int = WIDTH, height: int = HEIGHT) -> bpy.types.Scene:
    """Smooth waves and a ball of few faces under a sun 4° above the horizon."""
    scene = empty_scene(width, height)
    count = 48
    heights = np.linspace(-2.0, 2.0, count + 1)
    vertices = [(x, y, 0.08 * math.sin(4.0 * x) * math.cos(3.0 * y)) for y in heights for x in heights]
    corners = [row * (count + 1) + column for row in range(count) for column in range(count)]
    faces = [(first, first + 1, first + count + 2, first + count + 1) for first in corners]
    waves = mesh_object("Waves", vertices, faces, MATTE)
    waves.data.shade_smooth()
    sphere(0.4, material("Ball", WALL), (0.6, 0.3, 0.5), segments=24)
    sun(scene, 4.0, 170.0, 0.5)
    camera(scene, (0.0, -3.6, 1.9), (0.0, -0.2, 0.0))
    return scene


def narrow_gap(width: int = WIDTH, height: int = HEIGHT) -> bpy.types.Scene:
    """A box 1 mm above the ground, 3 cm of its edge, so that the gap is three pixels high."""
    scene = empty_scene(width, height)
    plane(4.0, material("Ground", MATTE))
    box(0.5, material("Box", WALL), (0.0, 0.25, 0.251))
    lamp(scene, "POINT", (-0.7, -0.9, 0.45), energy=20.0, shadow_soft_size=0.02)
    camera(scene, (0.21, -0.25, 0.03), (0.246, 0.0, 0.0015), lens=420.0)
    return scene


def leaf_card(width: int = WIDTH, height: int = HEIGHT) -> bpy.types.Scene:
    """A leaf that is a texture's alpha on a square, its shadow on the wall behind it."""
    scene = empty_scene(width, height)
    plane(4.0, material("Wall", WALL), (0.0, 0.5, 0.0), (math.radians(90.0), 0.0, 0.0))
    plane(0.9, leaf(), (-0.1, 0.0, 0.0), (math.radians(90.0), 0.0, math.radians(15.0)))
    lamp(scene, "POINT", (-0.7, -1.6, 0.5), energy=50.0, shadow_soft_size=0.05)
    camera(scene, (0.2, -3.2, 0.1), (0.2, 0.5, -0.1), lens=60.0)
    return scene


def leaf() -> bpy.types.Material:
    """A material that is there where a toothed leaf is drawn on the unit square, its texels unfiltered."""
    axis = (np.arange(LEAF_TEXELS) + 0.5) / LEAF_TEXELS * 2.0 - 1.0
    x, y = np.meshgrid(axis, axis)
    edge = 0.75 + 0.15 * np.cos(10.0 * np.arctan2(y, x))
    pixels = np.empty((LEAF_TEXELS, LEAF_TEXELS, 4), np.float32)
    pixels[..., :3] = (0.3, 0.6, 0.2)
    pixels[..., 3] = (x * x + y * y < edge * edge) & (np.abs(x - 0.3 * y) > 0.06)
    return cut_out("Leaf", MATTE, pixels)


def lampshade(width: int = WIDTH, height: int = HEIGHT) -> bpy.types.Scene:
    """A lamp inside a cone without thickness that is open above and below, between a floor, a wall and a box."""
    scene = empty_scene(width, height)
    plane(6.0, material("Floor", MATTE))
    plane(6.0, material("Wall", WALL), (0.0, 0.8, 0.0), (math.radians(90.0), 0.0, 0.0))
    box(0.4, material("Box", MATTE), (0.9, 0.2, 0.2), 0.4)
    bpy.ops.mesh.primitive_cone_add(
        vertices=32, radius1=0.3, radius2=0.15, depth=0.4, end_fill_type="NOTHING", location=(-0.2, 0.2, 1.2)
    )
    finished(material("Shade", WALL), smooth=True)
    lamp(scene, "POINT", (-0.2, 0.2, 1.2), energy=60.0, shadow_soft_size=0.04)
    camera(scene, (0.1, -4.2, 1.3), (0.1, 0.0, 0.85), lens=45.0)
    return scene


def caster_behind_the_camera(width: int = WIDTH, height: int = HEIGHT) -> bpy.types.Scene:
    """Poles and a beam behind the camera, whose shadows are all that is seen of them."""
    scene = empty_scene(width, height)
    plane(12.0, material("Ground", MATTE))
    surface = material("Pole", WALL)
    for x in (-1.2, 0.1, 1.0):
        cuboid((x - 0.1, -3.1, 0.0), (x + 0.1, -2.9, 3.0), surface)
    cuboid((-1.6, -3.1, 2.4), (1.4, -2.9, 2.7), surface)
    sun(scene, 35.0, -97.0, 2.0)
    camera(scene, (0.0, -2.5, 2.2), (0.0, 1.0, 0.0), lens=30.0)
    return scene


def kilometre(width: int = WIDTH, height: int = HEIGHT) -> bpy.types.Scene:
    """A kilometre of ground with towers in the distance, and blades of 4 cm an arm's length away."""
    scene = empty_scene(width, height)
    plane(1000.0, material("Ground", MATTE))
    surface = material("Tower", WALL)
    for x, y in ((-60.0, 180.0), (40.0, 120.0), (110.0, 330.0)):
        cuboid((x - 8.0, y - 8.0, 0.0), (x + 8.0, y + 8.0, 45.0), surface)
    for index in range(7):
        x, y = -0.5 + 0.17 * index, 1.1 + 0.06 * (index % 3)
        cuboid((x - 0.01, y - 0.01, 0.0), (x + 0.01, y + 0.01, 0.2 + 0.02 * (index % 2)), surface)
    sun(scene, 25.0, 160.0, 0.53)
    camera(scene, (0.0, 0.0, 0.6), (0.0, 2.0, 0.3), lens=24.0)
    return scene


def cuboid(low: Point, high: Point, surface: bpy.types.Material) -> Any:
    """An axis-aligned box between two corners."""
    middle = [(a + b) / 2.0 for a, b in zip(low, high, strict=True)]
    result = box(1.0, surface, (middle[0], middle[1], middle[2]))
    result.scale = [b - a for a, b in zip(low, high, strict=True)]
    return result


def mesh_object(name: str, vertices: Any, faces: Any, values: dict[str, Any]) -> bpy.types.Object:
    """An object of vertices and faces with a Principled material."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.materials.append(material(name, values))
    result = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(result)
    return result


TORTURE = {
    "grazing sun over curved meshes": grazing_sun,
    "gap of 1 mm under a box": narrow_gap,
    "leaf card in front of a wall": leaf_card,
    "light inside a lampshade": lampshade,
    "caster behind the camera": caster_behind_the_camera,
    "sun over a kilometre": kilometre,
}
