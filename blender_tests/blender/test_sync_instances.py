# SPDX-License-Identifier: GPL-3.0-or-later
"""Instances of every kind, their materials, visibility and broken transforms."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from sync_scenes import depsgraph, instance_on_grid, link, make_object, sync, world_points


def assert_same_points_as_depsgraph(scene) -> None:
    """Compare with Blender's slow documented way."""
    points = []
    for instance in depsgraph().object_instances:
        shown = instance.object
        if shown.type == "MESH" and instance.show_self and len(shown.data.polygons):
            corners = {loop.vertex_index for loop in shown.data.loops}
            points.extend(tuple(instance.matrix_world @ shown.data.vertices[index].co) for index in corners)
    got = np.unique(np.round(world_points(scene), 3) + 0.0, axis=0)
    np.testing.assert_allclose(got, np.unique(np.round(np.array(points), 3) + 0.0, axis=0), atol=2e-3)


def count(scene) -> int:
    return sum(batch.count for batch in scene.batches)


def test_objects_that_share_a_mesh_are_one_batch(empty_scene):
    first = make_object()
    for x in range(1, 4):
        copy = link(f"Copy{x}", first.data)
        copy.location.x = x
        copy.pass_index = x
    scene = sync().scene
    (batch,) = scene.batches
    assert batch.count == 4
    assert sorted(batch.object_index) == [0, 1, 2, 3]
    assert {(int(i), m[0, 3]) for i, m in zip(batch.object_index, batch.matrices, strict=True)} == {
        (x, float(x)) for x in range(4)
    }
    assert batch.matrices.dtype == np.float64
    assert_same_points_as_depsgraph(scene)


def test_nested_collection_instances(empty_scene):
    inner, outer = bpy.data.collections.new("Inner"), bpy.data.collections.new("Outer")
    thing = make_object()
    inner.objects.link(thing)
    empty_scene.collection.objects.unlink(thing)
    for x in range(2):
        empty = bpy.data.objects.new(f"I{x}", None)
        empty.instance_type, empty.instance_collection, empty.location.x = "COLLECTION", inner, 3.0 * x
        outer.objects.link(empty)
    for y in range(3):
        empty = link(f"O{y}", None)
        empty.instance_type, empty.instance_collection, empty.location.y = "COLLECTION", outer, 5.0 * y
        empty.rotation_euler = (0.1, 0.2, 0.3)
    scene = sync().scene
    assert (len(scene.meshes), len(scene.batches), count(scene)) == (1, 1, 6)
    assert_same_points_as_depsgraph(scene)


def test_geometry_nodes_instances_of_an_object(empty_scene):
    thing = make_object()

    def build(nodes, links):
        info = nodes.new("GeometryNodeObjectInfo")
        info.inputs["Object"].default_value = thing
        info.inputs["As Instance"].default_value = True
        return info.outputs["Geometry"]

    instance_on_grid(5, build)
    result = sync()
    assert (len(result.scene.meshes), count(result.scene)) == (1, 26)
    assert_same_points_as_depsgraph(result.scene)
    assert result.warnings == ()


def test_geometry_nodes_meshes_with_material(empty_scene):
    material = bpy.data.materials.new("Set by nodes")

    def build(nodes, links):
        cube, assign = nodes.new("GeometryNodeMeshCube"), nodes.new("GeometryNodeSetMaterial")
        assign.inputs["Material"].default_value = material
        links.new(cube.outputs[0], assign.inputs[0])
        return assign.outputs[0]

    instance_on_grid(3, build)
    scene = sync().scene
    assert count(scene) == 9
    (mesh,) = scene.meshes.values()
    (batch,) = scene.batches
    shown = {scene.materials[batch.materials[min(r.slot, len(batch.materials) - 1)]].name for r in mesh.slots}
    assert shown == {"Set by nodes"}
    assert_same_points_as_depsgraph(scene)


def test_particle_instances(empty_scene):
    thing = make_object()
    thing.location.z = 20.0
    bpy.ops.mesh.primitive_plane_add(size=4)
    emitter = bpy.context.object
    emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
    particles = emitter.particle_systems[0].settings
    particles.count, particles.frame_start, particles.frame_end = 7, 1, 1
    particles.render_type, particles.instance_object, particles.physics_type = "OBJECT", thing, "NO"
    empty_scene.frame_set(2)
    scene = sync().scene
    assert count(scene) == 9
    assert_same_points_as_depsgraph(scene)


def test_instancer_may_hide_itself(empty_scene):
    thing = make_object()
    bpy.ops.mesh.primitive_plane_add()
    plane = bpy.context.object
    plane.instance_type = "VERTS"
    thing.parent = plane
    plane.show_instancer_for_viewport = False
    scene = sync().scene
    assert count(scene) == 5  # four vertices and, as Blender itself shows it, the child
    assert [mesh.name for mesh in scene.meshes.values()] == ["Thing"]


def test_instanced_light(empty_scene):
    lights = bpy.data.collections.new("Lights")
    lights.objects.link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT")))
    for x in range(3):
        empty = link(f"E{x}", None)
        empty.instance_type, empty.instance_collection, empty.location.x = "COLLECTION", lights, x
    scene = sync().scene
    assert sorted(light.world_from_light[0, 3] for light in scene.lights) == [0.0, 1.0, 2.0]
    assert len({light.key for light in scene.lights}) == 3


def ids_at(scene) -> dict[tuple, int]:
    """The id of each instance by its place."""
    return {
        tuple(np.round(matrix[:3, 3], 3)): int(identifier)
        for batch in scene.batches
        for matrix, identifier in zip(batch.matrices, batch.ids, strict=True)
    }


def test_ids_follow_objects_and_instances_when_others_come_and_go(empty_scene):
    thing = make_object("A first")
    inside = bpy.data.collections.new("Inside")
    for x in range(3):
        placed = bpy.data.objects.new(f"In{x}", thing.data)
        placed.location.x = x
        inside.objects.link(placed)
    for y in range(1, 4):
        empty = link(f"E{y}", None)
        empty.instance_type, empty.instance_collection, empty.location.y = "COLLECTION", inside, y
    for z in range(1, 4):
        link(f"Z{z}", thing.data).location.z = z
    before = ids_at(sync().scene)
    assert len(before) == len(set(before.values())) == 13
    bpy.data.objects.remove(thing)
    bpy.data.objects.remove(bpy.data.objects["E1"])
    (batch,) = sync().scene.batches
    assert batch.ids.dtype == np.int64
    after = ids_at(sync().scene)
    assert len(after) == 3 + 6
    assert after == {place: before[place] for place in after}


def test_ids_of_points_do_not_depend_on_the_frame(empty_scene):
    def build(nodes, links):
        return nodes.new("GeometryNodeMeshCube").outputs[0]

    scatter = instance_on_grid(4, build)
    before = sync().scene.batches[0]
    scatter.location.z = 5.0
    (after,) = sync().scene.batches
    assert len(set(before.ids)) == 16
    np.testing.assert_array_equal(after.ids, before.ids)


def test_slots_linked_to_the_object(empty_scene):
    mine, shared = bpy.data.materials.new("Mine"), bpy.data.materials.new("Shared")
    first = make_object()
    first.data.materials.append(shared)
    second = link("Second", first.data)
    second.material_slots[0].link = "OBJECT"
    second.material_slots[0].material = mine
    scene = sync().scene
    assert len(scene.meshes) == 1
    assert {scene.materials[batch.materials[0]].name for batch in scene.batches} == {"Mine", "Shared"}


def test_hidden_objects_are_not_there(empty_scene):
    make_object("Seen")
    make_object("Hidden").hide_viewport = True
    make_object("Wire").display_type = "WIRE"
    assert [mesh.name for mesh in sync().scene.meshes.values()] == ["Seen"]


def test_material_override(empty_scene):
    make_object().data.materials.append(bpy.data.materials.new("Own"))
    bpy.context.view_layer.material_override = bpy.data.materials.new("Clay")
    assert [material.name for material in sync().scene.materials.values()] == ["Clay"]


@pytest.mark.parametrize("scale", [(0, 0, 0), (1, 0, 0)], ids=["point", "line"])
def test_zero_scale_is_left_out_and_told(empty_scene, scale):
    thing = make_object("Flat")
    thing.scale = scale
    link("Whole", thing.data)
    result = sync()
    assert count(result.scene) == 1
    assert any("“Flat”" in text and "scale of zero" in text for text in result.warnings)


def test_flattened_object_stays_visible_with_defined_normals(empty_scene):
    make_object("Flat").scale = (2, 3, 0)
    result = sync()
    (matrix,) = result.scene.batches[0].matrices
    assert np.isfinite(np.linalg.inv(matrix)).all()
    np.testing.assert_allclose(matrix[:3, :3], np.diag([2.0, 3.0, 0.0]), atol=1e-4)
    assert result.warnings == ()


def test_tiny_and_mirrored_objects_are_kept(empty_scene):
    make_object("Tiny").scale = (1e-4, 1e-4, 1e-4)
    make_object("Mirrored").scale = (-1, 1, 1)
    result = sync()
    assert count(result.scene) == 2
    assert result.warnings == ()


def test_broken_matrix_is_left_out_and_told(empty_scene):
    make_object("Nowhere").matrix_world = Matrix.Translation((float("nan"), 0, 0))
    result = sync()
    assert count(result.scene) == 0
    assert any("“Nowhere”" in text for text in result.warnings)
