# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes: what arrives, however Blender stores it, and what is done about broken ones."""

import bmesh
import bpy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sync_scenes import corner_positions, link, make_mesh, make_object, modify_with_nodes, only_mesh, sync

from addon.sync import Mirror

FINITE = st.floats(-1e3, 1e3, width=32)


def reference_triangles(mesh: bpy.types.Mesh) -> np.ndarray:
    """Corner positions by Blender's slow documented way, sorted by slot."""
    mesh.calc_loop_triangles()
    order = sorted(mesh.loop_triangles, key=lambda triangle: triangle.material_index)
    return np.array([[mesh.vertices[i].co for i in triangle.vertices] for triangle in order], np.float32)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    vertices=arrays(np.float32, (12, 3), elements=FINITE, unique=True),
    faces=st.lists(st.permutations(range(12)).map(lambda p: tuple(p[:4])), min_size=1, max_size=6),
    slots=st.lists(st.integers(0, 3), min_size=6, max_size=6),
    smooth=st.booleans(),
    with_uv=st.booleans(),
)
def test_mesh_equals_blenders_own(empty_scene, vertices, faces, slots, smooth, with_uv):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    data = make_mesh("M", vertices, faces)
    for polygon, slot in zip(data.polygons, slots, strict=False):
        polygon.material_index = slot
        polygon.use_smooth = smooth
    if with_uv:
        layer = data.uv_layers.new(name="UV")
        layer.uv.foreach_set("vector", np.linspace(0, 1, len(data.loops) * 2, dtype=np.float32))
    thing = link("Thing", data)
    mesh = only_mesh(sync().scene)
    expected = reference_triangles(data)
    kept = np.array([np.linalg.matrix_rank(t[1:] - t[0]) == 2 for t in expected.astype(np.float64)])
    got = corner_positions(mesh)
    assert len(got) >= kept.sum()
    assert {t.tobytes() for t in expected[kept]} <= {t.tobytes() for t in got} <= {t.tobytes() for t in expected}
    assert sum(r.count for r in mesh.slots) == len(mesh.triangles)
    assert [r.slot for r in mesh.slots] == sorted({r.slot for r in mesh.slots})
    assert thing.data is data


def test_slots_group_their_triangles(empty_scene):
    thing = make_object(
        vertices=[(x, y, 0) for x in range(5) for y in range(2)],
        faces=[(0, 2, 3, 1), (2, 4, 5, 3), (4, 6, 7, 5), (6, 8, 9, 7)],
    )
    for polygon, slot in zip(thing.data.polygons, (2, 0, 2, 1), strict=True):
        polygon.material_index = slot
    mesh = only_mesh(sync().scene)
    assert [(r.slot, r.first, r.count) for r in mesh.slots] == [(0, 0, 2), (1, 2, 2), (2, 4, 4)]
    centers = corner_positions(mesh)[:, :, 0]
    assert centers[:2].min() == 1.0
    assert centers[:2].max() == 2.0
    assert centers[2:4].min() == 3.0


def test_modifiers_are_applied(empty_scene):
    thing = make_object()
    thing.modifiers.new("Array", "ARRAY").count = 3
    assert len(only_mesh(sync().scene).triangles) == 12


def test_smooth_mesh_without_uv_is_indexed_by_points(empty_scene):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=8)
    sphere = bpy.context.object
    while sphere.data.uv_layers:
        sphere.data.uv_layers.remove(sphere.data.uv_layers[0])
    bpy.ops.object.shade_smooth()
    mesh = only_mesh(sync().scene)
    assert len(mesh.positions) == len(sphere.data.vertices)
    np.testing.assert_allclose(mesh.normals, mesh.positions, atol=0.05)


def test_flat_and_sharp_normals(empty_scene):
    bpy.ops.mesh.primitive_cube_add()
    mesh = only_mesh(sync().scene)
    assert len(mesh.positions) == 24
    corners = corner_positions(mesh)
    geometric = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    geometric /= np.linalg.norm(geometric, axis=1, keepdims=True)
    np.testing.assert_allclose(mesh.normals[mesh.triangles[:, 0]], geometric, atol=1e-6)


def test_custom_normals(empty_scene):
    thing = make_object()
    wanted = np.array([(0.0, 0.6, 0.8)] * len(thing.data.loops))
    thing.data.normals_split_custom_set(wanted.tolist())
    np.testing.assert_allclose(only_mesh(sync().scene).normals, wanted, atol=1e-3)


def test_uv_map_that_renders(empty_scene):
    thing = make_object()
    for name, value in (("First", 0.25), ("Second", 0.75)):
        layer = thing.data.uv_layers.new(name=name)
        layer.uv.foreach_set("vector", np.full(len(thing.data.loops) * 2, value, np.float32))
    thing.data.uv_layers["Second"].active_render = True
    assert set(only_mesh(sync().scene).uvs.ravel()) == {0.75}


@pytest.mark.parametrize("domain", ["POINT", "CORNER"])
@pytest.mark.parametrize("kind", ["BYTE_COLOR", "FLOAT_COLOR"])
def test_colour_attribute_is_linear(empty_scene, domain, kind):
    thing = make_object()
    attribute = thing.data.color_attributes.new(name="Paint", type=kind, domain=domain)
    for index, entry in enumerate(attribute.data):
        entry.color = (0.5, 0.25, 0.125, 1.0) if index else (1.0, 0.0, 0.0, 1.0)
    colors = only_mesh(sync().scene).colors
    np.testing.assert_allclose(colors[-1], (0.5, 0.25, 0.125, 1.0), atol=0.004)
    np.testing.assert_allclose(colors[0], (1.0, 0.0, 0.0, 1.0), atol=0.004)


def add_velocities(data: bpy.types.Mesh, kind: str = "FLOAT_VECTOR", domain: str = "POINT") -> np.ndarray:
    """An attribute as simulations write it, m/s; vectors grow with the vertex."""
    attribute = data.attributes.new("velocity", kind, domain)
    vectors = np.arange(3 * len(data.vertices), dtype=np.float32).reshape(-1, 3)
    if (kind, domain) == ("FLOAT_VECTOR", "POINT"):
        attribute.data.foreach_set("vector", vectors.ravel())
    return vectors


@pytest.mark.parametrize("smooth", [False, True], ids=["by corner", "by point"])
def test_velocities_are_per_frame_and_belong_to_their_vertices(empty_scene, smooth):
    empty_scene.render.fps, empty_scene.render.fps_base = 30, 1.5
    data = make_object().data
    data.polygons.foreach_set("use_smooth", [smooth] * len(data.polygons))
    per_second = add_velocities(data)
    mesh = only_mesh(sync().scene)
    assert len(mesh.positions) == (4 if smooth else 12)
    points = {tuple(vertex.co): vertex.index for vertex in data.vertices}
    indices = [points[tuple(position)] for position in mesh.positions.tolist()]
    np.testing.assert_array_equal(mesh.velocities, per_second[indices] / np.float32(20.0))
    assert mesh.velocities.dtype == np.float32


def test_a_mesh_without_velocities_has_none(empty_scene):
    make_object()
    assert only_mesh(sync().scene).velocities is None


@pytest.mark.parametrize(("kind", "domain"), [("FLOAT_VECTOR", "CORNER"), ("FLOAT", "POINT"), ("FLOAT_COLOR", "POINT")])
def test_what_is_only_called_velocity_is_none(empty_scene, kind, domain):
    add_velocities(make_object().data, kind, domain)
    assert only_mesh(sync().scene).velocities is None


def test_velocities_that_are_not_finite_are_zero(empty_scene):
    data = make_object().data
    per_second = add_velocities(data)
    per_second[2] = (float("nan"), float("inf"), 24.0)
    data.attributes["velocity"].data.foreach_set("vector", per_second.ravel())
    mesh = only_mesh(sync().scene)
    assert np.isfinite(mesh.velocities).all()
    (row,) = np.unique(mesh.velocities[(mesh.positions == data.vertices[2].co).all(axis=1)], axis=0)
    np.testing.assert_array_equal(row, (0.0, 0.0, np.float32(24.0) / np.float32(empty_scene.render.fps)))
    assert np.abs(mesh.velocities).max() == np.float32(24.0) / np.float32(empty_scene.render.fps)


def test_velocities_from_geometry_nodes(empty_scene):
    tree = modify_with_nodes(make_object())
    store = tree.nodes.new("GeometryNodeStoreNamedAttribute")
    store.data_type, store.domain = "FLOAT_VECTOR", "POINT"
    store.inputs["Name"].default_value = "velocity"
    value = next(socket for socket in store.inputs if socket.name == "Value" and socket.type == "VECTOR")
    value.default_value = (24.0, -48.0, 0.0)
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(start.outputs[0], store.inputs["Geometry"])
    tree.links.new(store.outputs[0], end.inputs[0])
    mesh = only_mesh(sync().scene)
    np.testing.assert_array_equal(mesh.velocities, np.tile(np.float32([1.0, -2.0, 0.0]), (12, 1)))


def test_velocities_that_change_are_a_new_version_with_the_same_triangles(empty_scene):
    data = make_object().data
    add_velocities(data)
    mirror = Mirror()
    versions = [only_mesh(sync(mirror).scene)]
    data.attributes["velocity"].data[0].vector.x += 24.0
    data.update()
    versions.append(only_mesh(sync(mirror).scene))
    empty_scene.render.fps *= 2
    versions.append(only_mesh(sync(mirror).scene))
    assert len({mesh.version for mesh in versions}) == 3
    assert versions[0].triangles is versions[1].triangles is versions[2].triangles
    np.testing.assert_array_equal(versions[2].velocities, versions[1].velocities / 2)
    assert np.abs(versions[1].velocities - versions[0].velocities).max() == 1.0


@pytest.mark.parametrize(
    "add",
    [
        bpy.ops.object.text_add,
        lambda: bpy.ops.object.metaball_add(type="BALL"),
        bpy.ops.surface.primitive_nurbs_surface_sphere_add,
    ],
    ids=["text", "metaball", "surface"],
)
def test_everything_that_becomes_a_mesh(empty_scene, add):
    add()
    result = sync()
    assert sum(len(mesh.triangles) for mesh in result.scene.meshes.values()) > 50
    assert len(result.scene.batches) == 1


def test_bevelled_curve_with_material(empty_scene):
    bpy.ops.curve.primitive_bezier_circle_add()
    curve = bpy.context.object
    curve.data.bevel_depth = 0.1
    material = bpy.data.materials.new("Wire")
    curve.data.materials.append(material)
    scene = sync().scene
    assert len(only_mesh(scene).triangles) > 50
    assert [m.name for m in scene.materials.values()] == ["Wire"]


def test_not_finite_vertices_are_left_out_and_told(empty_scene):
    thing = make_object("Broken", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], [(0, 1, 2), (1, 3, 2)])
    thing.data.vertices[3].co.x = float("nan")
    result = sync()
    mesh = only_mesh(result.scene)
    assert len(mesh.triangles) == 1
    assert np.isfinite(mesh.positions).all()
    assert np.isfinite(mesh.normals).all()
    assert any("“Broken”" in text and "not finite" in text for text in result.warnings)


def test_triangles_without_area_are_left_out_and_told(empty_scene):
    make_object("Thin", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0)], [(0, 1, 2), (0, 1, 3)])
    result = sync()
    assert len(only_mesh(result.scene).triangles) == 1
    assert sum("“Thin”" in text for text in result.warnings) == 1


def test_empty_mesh_is_told_once_for_all(empty_scene):
    link("Nothing", bpy.data.meshes.new("Nothing"))
    link("Void", bpy.data.meshes.new("Void"))
    result = sync()
    assert result.scene.batches == ()
    (text,) = result.warnings
    assert "“Nothing”" in text
    assert "“Void”" in text


def test_kinds_that_are_not_rendered_are_named(empty_scene):
    link("Smoke", bpy.data.volumes.new("Smoke"))
    link("Fur", bpy.data.hair_curves.new("Fur"))
    texts = sync().warnings
    assert any("“Smoke”" in text and "olume" in text for text in texts)
    assert any("“Fur”" in text and "urves" in text for text in texts)


def test_a_mesh_in_edit_mode_is_as_it_is_being_edited(empty_scene):
    thing = make_object(vertices=[(0, 0, 0), (1, 0, 0), (0, 1, 0)], faces=[(0, 1, 2)])
    bpy.context.view_layer.objects.active = thing
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(thing.data)
    bmesh.ops.translate(edited, vec=(0.0, 0.0, 5.0), verts=edited.verts)
    bmesh.update_edit_mesh(thing.data)
    mirror = Mirror()
    mesh = only_mesh(sync(mirror).scene)
    assert np.unique(corner_positions(mesh)[..., 2]) == [5.0]
    assert only_mesh(sync(mirror).scene) is mesh
    bpy.ops.object.mode_set(mode="OBJECT")
