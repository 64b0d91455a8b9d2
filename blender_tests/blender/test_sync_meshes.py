# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes: what arrives, however Blender stores it, and what is done about broken ones."""

import bpy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sync_scenes import corner_positions, link, make_mesh, make_object, only_mesh, sync

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
