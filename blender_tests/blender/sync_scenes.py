# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds small Blender scenes and mirrors them."""

from collections.abc import Callable, Sequence
from pathlib import Path

import bpy
import numpy as np

from addon.scene import Light, Material, Mesh, Scene
from addon.sync import Mirror, SyncResult

TETRAHEDRON = ([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])


def depsgraph() -> bpy.types.Depsgraph:
    """The evaluated viewport depsgraph, brought up to date."""
    bpy.context.view_layer.update()
    return bpy.context.evaluated_depsgraph_get()


def sync(mirror: Mirror | None = None) -> SyncResult:
    """Mirror the current scene, anew unless a mirror is given."""
    return (mirror or Mirror()).sync(depsgraph())


def link(name: str, data: bpy.types.ID | None) -> bpy.types.Object:
    """A new object in the scene's own collection."""
    created = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(created)
    return created


def make_mesh(name: str, vertices: Sequence, faces: Sequence) -> bpy.types.Mesh:
    """A mesh data-block from plain lists."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(map(float, vertex)) for vertex in vertices], [], [tuple(map(int, face)) for face in faces])
    return mesh


def make_object(name: str = "Thing", vertices: Sequence = TETRAHEDRON[0], faces: Sequence = TETRAHEDRON[1]):
    """A linked mesh object, a tetrahedron unless told otherwise."""
    return link(name, make_mesh(name, vertices, faces))


def modify_with_nodes(thing: bpy.types.Object) -> bpy.types.NodeTree:
    """A new, empty geometry nodes modifier's tree, which takes the object's geometry and gives some."""
    group = bpy.data.node_groups.new("G", "GeometryNodeTree")
    for in_out in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
    thing.modifiers.new("Nodes", "NODES").node_group = group
    return group


def instance_on_grid(side: int, build: Callable) -> bpy.types.Object:
    """An object whose geometry nodes instance what `build(nodes, links)` returns on a grid of points."""
    scatter = link("Scatter", bpy.data.meshes.new("Scatter"))
    group = modify_with_nodes(scatter)
    nodes, links = group.nodes, group.links
    grid = nodes.new("GeometryNodeMeshGrid")
    grid.inputs["Vertices X"].default_value = grid.inputs["Vertices Y"].default_value = side
    on_points, output = nodes.new("GeometryNodeInstanceOnPoints"), nodes.new("NodeGroupOutput")
    links.new(grid.outputs[0], on_points.inputs["Points"])
    links.new(build(nodes, links), on_points.inputs["Instance"])
    links.new(on_points.outputs[0], output.inputs[0])
    return scatter


def node_tree(owner: bpy.types.ID) -> bpy.types.NodeTree:
    """The node tree of a new material, world or light, emptied."""
    if owner.node_tree is None or bpy.app.version < (5, 0, 0):
        owner.use_nodes = True
    owner.node_tree.nodes.clear()
    return owner.node_tree


def make_material(name: str, shader: str | None = None, **inputs: object):
    """A material with one shader node (or only an output) whose inputs are set by name with underscores for spaces.

    Returns the material and the shader node.
    """
    material = bpy.data.materials.new(name)
    tree = node_tree(material)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    if shader is None:
        return material, None
    node = tree.nodes.new(shader)
    for key, value in inputs.items():
        node.inputs[key.replace("_", " ")].default_value = value
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material, node


def mirrored_material(material: bpy.types.Material | None) -> tuple[Material, Scene, tuple[str, ...]]:
    """What a material becomes on an object that has only it, and a UV map."""
    thing = make_object()
    thing.data.uv_layers.new()
    thing.data.materials.append(material)
    result = sync()
    (batch,) = result.scene.batches
    return result.scene.materials[batch.materials[0]], result.scene, result.warnings


def only_mesh(scene: Scene) -> Mesh:
    """The scene's one mesh."""
    (mesh,) = scene.meshes.values()
    return mesh


def only_light(scene: Scene) -> Light:
    """The scene's one light."""
    (light,) = scene.lights
    return light


def corner_positions(mesh: Mesh) -> np.ndarray:
    """(T, 3, 3) positions of the triangles' corners."""
    return mesh.positions[mesh.triangles]


def world_points(scene: Scene) -> np.ndarray:
    """(N, 3) world positions of all vertices of all instances, in an order that does not depend on batches."""
    points = []
    for batch in scene.batches:
        positions = scene.meshes[batch.mesh].positions.astype(np.float64)
        points.extend(positions @ matrix[:3, :3].T + matrix[:3, 3] for matrix in batch.matrices)
    stacked = np.concatenate(points) if points else np.empty((0, 3))
    return stacked[np.lexsort(np.round(stacked, 4).T)]


def make_image(name: str = "Pixels", color=(0.2, 0.4, 0.6, 0.8), size=(3, 2), *, is_float=False, space=None):
    """An image of one colour, a generated one."""
    image = bpy.data.images.new(name, *size, alpha=True, float_buffer=is_float)
    if space is not None:
        image.colorspace_settings.name = space
    image.pixels.foreach_set(np.tile(np.array(color, np.float32), size[0] * size[1]))
    return image


def texture_node(tree: bpy.types.NodeTree, image: bpy.types.Image | None) -> bpy.types.ShaderNodeTexImage:
    """A new image texture node."""
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    return node


def add(material: bpy.types.Material, kind: str, **inputs) -> bpy.types.Node:
    """A new node whose inputs are set by name with underscores for spaces."""
    node = material.node_tree.nodes.new(kind)
    for key, value in inputs.items():
        node.inputs[key.replace("_", " ")].default_value = value
    return node


def connect(material: bpy.types.Material, output, entry) -> None:
    """Link two sockets of a material."""
    material.node_tree.links.new(output, entry)


def cycles_pixel(scene: bpy.types.Scene, path: Path) -> np.ndarray:
    """Linear RGB that Cycles renders of what lies at the origin, seen from above."""
    scene.camera = link("Camera", bpy.data.cameras.new("Camera"))
    scene.camera.location.z = 2.0
    scene.render.engine, scene.render.resolution_x, scene.render.resolution_y = "CYCLES", 4, 4
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format, scene.render.filepath = "OPEN_EXR", str(path)
    bpy.ops.render.render(write_still=True)
    return np.array(bpy.data.images.load(str(path)).pixels[:3])


def assert_texts(texts: tuple[str, ...], *parts: str) -> None:
    """One text holds all parts."""
    assert any(all(part in text for part in parts) for text in texts), texts


def textured(image: bpy.types.Image | None, name: str = "Painted"):
    """A material whose base colour is an image; with its shader and its texture node."""
    material, shader = make_material(name, "ShaderNodeBsdfPrincipled")
    node = texture_node(material.node_tree, image)
    connect(material, node.outputs["Color"], shader.inputs["Base Color"])
    return material, shader, node
