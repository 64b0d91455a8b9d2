# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scene scripts share: an empty scene, materials, meshes from numbers, camera, lights, and saving."""

import math
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import bpy
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import addon

Color = tuple[float, float, float]
Point = tuple[float, float, float]
Profile = Sequence[tuple[float, float]]


def new_scene(world: Color, strength: float = 1.0) -> bpy.types.Scene:
    """An empty scene of 640×360 pixels under a world of one colour, rendered by Deep G-Buffer."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon.register()
    scene = bpy.context.scene
    scene.render.engine = "DEEP_GBUFFER"
    scene.render.resolution_x, scene.render.resolution_y = 640, 360
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*world, 1.0)
    background.inputs["Strength"].default_value = strength
    return scene


def save(script: str) -> None:
    """Write the scene beside its script, compressed, with nothing in it that no one uses, and end with the engine."""
    bpy.data.orphans_purge(do_recursive=True)
    path = Path(script).resolve().with_suffix(".blend")
    bpy.context.preferences.filepaths.save_version = 0
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, relative_remap=True)
    addon.unregister()
    print(f"{path.name}: {path.stat().st_size / 1024:.0f} KiB")


def material(
    name: str,
    base_color: Color,
    *,
    roughness: float = 0.5,
    metallic: float = 0.0,
    specular: float = 0.5,
    emission: float = 0.0,
) -> bpy.types.Material:
    """A Principled material of constants; `emission` is a strength in the base colour."""
    result = bpy.data.materials.new(name)
    result.use_nodes = True
    inputs = result.node_tree.nodes["Principled BSDF"].inputs
    values: dict[str, Any] = {
        "Base Color": (*base_color, 1.0),
        "Roughness": roughness,
        "Metallic": metallic,
        "Specular IOR Level": specular,
        "Emission Color": (*base_color, 1.0),
        "Emission Strength": emission,
    }
    for socket, value in values.items():
        inputs[socket].default_value = value
    result.diffuse_color = (*base_color, 1.0)
    return result


def mesh_object(
    name: str,
    vertices: Iterable[Sequence[float]],
    faces: Iterable[Sequence[int]],
    materials: Sequence[bpy.types.Material],
    *,
    smooth_below: float | None = None,
    collection: bpy.types.Collection | None = None,
) -> bpy.types.Object:
    """A mesh object; edges flatter than `smooth_below` degrees are shaded smooth, none where it is None."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(list(vertices), [], list(faces))
    for item in materials:
        mesh.materials.append(item)
    if smooth_below is not None:
        mesh.shade_smooth()
        mesh.set_sharp_from_angle(angle=math.radians(smooth_below))
    mesh.validate()
    result = bpy.data.objects.new(name, mesh)
    link(result, collection)
    return result


def link(item: bpy.types.Object, collection: bpy.types.Collection | None = None) -> None:
    """Put an object into a collection, the scene's own by default."""
    (collection or bpy.context.scene.collection).objects.link(item)


def box(
    name: str,
    low: Point,
    high: Point,
    item: bpy.types.Material,
    *,
    bevel: float = 0.0,
    collection: bpy.types.Collection | None = None,
) -> bpy.types.Object:
    """An axis-aligned box, its edges rounded by a modifier of `bevel` metres."""
    vertices = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    result = mesh_object(name, vertices, faces, [item], collection=collection)
    if bevel > 0.0:
        modifier = result.modifiers.new("Bevel", "BEVEL")
        modifier.width, modifier.segments = bevel, 2
        modifier.harden_normals = True
    return result


def lathe(
    name: str,
    profile: Profile,
    item: bpy.types.Material,
    *,
    segments: int = 48,
    subdivisions: int = 0,
    collection: bpy.types.Collection | None = None,
) -> bpy.types.Object:
    """A surface of revolution about z of (radius, height) points, listed upwards; both ends are closed by a fan."""
    vertices: list[Point] = []
    for radius, height in profile:
        for step in range(segments):
            angle = math.tau * step / segments
            vertices.append((radius * math.cos(angle), radius * math.sin(angle), height))
    faces: list[tuple[int, ...]] = []
    for ring in range(len(profile) - 1):
        for step in range(segments):
            following = (step + 1) % segments
            low, high = ring * segments, (ring + 1) * segments
            faces.append((low + step, low + following, high + following, high + step))
    for ring, turn in ((0, -1), (len(profile) - 1, 1)):
        vertices.append((0.0, 0.0, profile[ring][1]))
        for step in range(segments):
            edge = (ring * segments + step, ring * segments + (step + 1) % segments)
            faces.append((*edge[::turn], len(vertices) - 1))
    result = mesh_object(name, vertices, faces, [item], smooth_below=40.0, collection=collection)
    subdivide(result, subdivisions)
    return result


def subdivide(item: bpy.types.Object, levels: int) -> None:
    """Smooth an object with a Catmull-Clark modifier."""
    if levels > 0:
        modifier = item.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels = modifier.render_levels = levels


def instance(collection: bpy.types.Collection, name: str, location: Point, turn: float = 0.0) -> bpy.types.Object:
    """An empty that instances a collection, turned about z by `turn` radians."""
    result = bpy.data.objects.new(name, None)
    result.instance_type = "COLLECTION"
    result.instance_collection = collection
    result.empty_display_size = 0.2
    result.location = location
    result.rotation_euler = (0.0, 0.0, turn)
    link(result)
    return result


def camera(location: Point, target: Point, lens: float) -> bpy.types.Object:
    """The scene's camera, looking at a point; 36 mm film width."""
    result = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    result.data.lens = lens
    result.location = location
    result.rotation_euler = toward(location, target)
    link(result)
    bpy.context.scene.camera = result
    return result


def sun(direction: Point, strength: float, color: Color, angle: float) -> bpy.types.Object:
    """A sun that shines along `direction`; W/m², angular diameter in degrees."""
    light = bpy.data.lights.new("Sun", "SUN")
    light.energy, light.color, light.angle = strength, color, math.radians(angle)
    return _place_light(light, (0.0, 0.0, 10.0), direction)


def area_light(
    name: str, location: Point, direction: Point, size: tuple[float, float], power: float, color: Color
) -> bpy.types.Object:
    """A rectangular area light shining along `direction`; size in m, power in W."""
    light = bpy.data.lights.new(name, "AREA")
    light.shape, light.size, light.size_y = "RECTANGLE", size[0], size[1]
    light.energy, light.color = power, color
    return _place_light(light, location, direction)


def toward(location: Point, target: Point) -> Any:
    """Euler angles that turn −z from `location` to `target`, +y up."""
    return (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()


def _place_light(light: bpy.types.Light, location: Point, direction: Point) -> bpy.types.Object:
    result = bpy.data.objects.new(light.name, light)
    result.location = location
    result.rotation_euler = Vector(direction).to_track_quat("-Z", "Y").to_euler()
    link(result)
    return result
