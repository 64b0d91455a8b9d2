# SPDX-License-Identifier: GPL-3.0-or-later
"""What changed gets a new version; everything else stays the very same object."""

from dataclasses import fields
from itertools import pairwise

import bpy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from sync_scenes import link, make_material, make_object, sync

from addon.scene import Scene
from addon.scene.arrays import same_array
from addon.sync import Mirror
from addon.sync.changes import Messages


def changed(before: Scene, after: Scene) -> set[str]:
    """Names of the versions that differ."""
    return {
        field.name
        for field in fields(before.versions)
        if getattr(before.versions, field.name) != getattr(after.versions, field.name)
    }


@pytest.fixture(name="scene")
def furnished_scene(empty_scene: bpy.types.Scene) -> bpy.types.Scene:
    """Two different meshes with a material each, a light, a camera and a world."""
    for name in ("A", "B"):
        material, _ = make_material(name, "ShaderNodeBsdfPrincipled")
        make_object(name).data.materials.append(material)
    link("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    empty_scene.camera = link("Camera", bpy.data.cameras.new("Camera"))
    empty_scene.world = bpy.data.worlds.new("World")
    return empty_scene


def move_vertex() -> None:
    bpy.data.objects["A"].data.vertices[0].co.x += 1.0
    bpy.data.objects["A"].data.update()


def add_face() -> None:
    mesh = bpy.data.objects["A"].data
    vertices = [tuple(vertex.co) for vertex in mesh.vertices]
    mesh.clear_geometry()
    mesh.from_pydata(vertices, [], [(0, 1, 2)])


def set_attribute(path: str, name: str, value: object) -> None:
    setattr(eval(f"bpy.{path}", {"bpy": bpy}), name, value)


def recolor() -> None:
    bpy.data.materials["A"].node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.9


def add_material_slot() -> None:
    bpy.data.objects["A"].data.materials[0] = bpy.data.materials["B"]


def set_world() -> None:
    world = bpy.data.worlds["World"]
    world.color = (0.9, 0.1, 0.1)
    if world.node_tree is not None:
        world.node_tree.nodes["Background"].inputs[0].default_value = (0.9, 0.1, 0.1, 1)


def tag_mesh() -> None:
    bpy.data.objects["A"].data.update_tag()


EDITS = {
    "vertex": (move_vertex, {"geometry"}),
    "topology": (add_face, {"geometry"}),
    "location": (lambda: set_attribute("data.objects['A']", "location", (1, 0, 0)), {"transforms"}),
    "pass index": (lambda: set_attribute("data.objects['A']", "pass_index", 3), {"transforms"}),
    "material": (recolor, {"materials"}),
    "slot": (add_material_slot, {"transforms", "materials"}),
    "light": (lambda: set_attribute("data.lights['Lamp']", "energy", 77.0), {"lights"}),
    "light moved": (lambda: set_attribute("data.objects['Lamp']", "location", (1, 0, 0)), {"lights"}),
    "lens": (lambda: set_attribute("data.cameras['Camera']", "lens", 77.0), {"camera"}),
    "camera moved": (lambda: set_attribute("data.objects['Camera']", "location", (1, 0, 0)), {"camera"}),
    "resolution": (lambda: set_attribute("context.scene.render", "resolution_x", 77), {"camera"}),
    "world": (set_world, {"world"}),
    "nothing": (lambda: None, set()),
    "selection": (lambda: bpy.data.objects["A"].select_set(state=True), set()),
    "frame without animation": (lambda: bpy.context.scene.frame_set(7), set()),
    "tag": (tag_mesh, set()),
    "deletion": (lambda: bpy.data.objects.remove(bpy.data.objects["A"]), {"geometry", "transforms", "materials"}),
    "hiding": (
        lambda: set_attribute("data.objects['A']", "hide_viewport", True),
        {"geometry", "transforms", "materials"},
    ),
}


@pytest.mark.parametrize("edit", EDITS)
def test_edit_raises_only_its_versions(scene, edit):
    mirror = Mirror()
    before = sync(mirror).scene
    apply, expected = EDITS[edit]
    apply()
    after = sync(mirror).scene
    assert changed(before, after) == expected
    assert (after is before) == (not expected)
    for kept in before.meshes.keys() & after.meshes.keys():
        untouched = before.meshes[kept].name != "A" or "geometry" not in expected
        assert (after.meshes[kept] is before.meshes[kept]) == untouched
    for key in before.materials.keys() & after.materials.keys():
        assert (after.materials[key] is before.materials[key]) == (edit != "material" or key != min(before.materials))


def test_other_meshes_keep_their_identity_when_one_goes(scene):
    mirror = Mirror()
    before = sync(mirror).scene
    bpy.data.objects.remove(bpy.data.objects["A"])
    after = sync(mirror).scene
    (key,) = after.meshes
    assert after.meshes[key] is before.meshes[key]


def test_moving_vertices_keeps_triangles_and_uvs(scene):
    mirror = Mirror()
    before = sync(mirror).scene
    move_vertex()
    after = sync(mirror).scene
    (key,) = [key for key, mesh in before.meshes.items() if mesh.name == "A"]
    assert after.meshes[key].version > before.meshes[key].version
    assert after.meshes[key].triangles is before.meshes[key].triangles
    assert not np.array_equal(after.meshes[key].positions, before.meshes[key].positions)


def test_before_stays_as_it_was(scene):
    """A frame that the GL thread still reads is never written to."""
    mirror = Mirror()
    before = sync(mirror).scene
    copies = {key: mesh.positions.copy() for key, mesh in before.meshes.items()}
    move_vertex()
    sync(mirror)
    assert all(np.array_equal(before.meshes[key].positions, copy) for key, copy in copies.items())


def test_undo_restores_keys_and_data(scene):
    bpy.context.preferences.edit.use_global_undo = True
    mirror = Mirror()
    bpy.ops.ed.undo_push(message="start")
    before = sync(mirror).scene
    bpy.data.objects["B"].location.x = 5.0
    bpy.data.objects.remove(bpy.data.objects["A"])
    bpy.ops.ed.undo_push(message="edit")
    sync(mirror)
    bpy.ops.ed.undo()
    after = sync(mirror).scene
    assert after.meshes.keys() == before.meshes.keys()
    assert [batch.key for batch in after.batches] == [batch.key for batch in before.batches]
    for batch, old in zip(after.batches, before.batches, strict=True):
        np.testing.assert_array_equal(batch.matrices, old.matrices)


def test_animation_frames(scene):
    thing = bpy.data.objects["A"]
    thing.keyframe_insert("location", frame=1)
    thing.location.x = 10.0
    thing.keyframe_insert("location", frame=11)
    thing.shape_key_add(name="Basis")
    key = thing.shape_key_add(name="Tall")
    key.data[0].co.z -= 1.0
    key.value = 0.0
    key.keyframe_insert("value", frame=11)
    key.value = 1.0
    key.keyframe_insert("value", frame=21)
    mirror = Mirror()
    frames = []
    for frame in (1, 6, 11, 21, 22):
        scene.frame_set(frame)
        frames.append(sync(mirror).scene)
    steps = [changed(a, b) for a, b in pairwise(frames)]
    assert steps == [{"transforms"}, {"transforms"}, {"geometry"}, set()]


def test_two_mirrors_never_share_a_version(scene):
    first, second = sync().scene, sync().scene
    assert {mesh.version for mesh in first.meshes.values()}.isdisjoint(mesh.version for mesh in second.meshes.values())


@given(arrays(np.float32, array_shapes(max_dims=2, max_side=5)), st.data())
def test_same_array_compares_bits(values, data):
    assert same_array(values, values.copy())
    if values.size:
        other = values.copy()
        index = data.draw(st.integers(0, values.size - 1))
        other.view(np.uint32).reshape(-1)[index] ^= 1
        assert not same_array(values, other)
    assert not same_array(values, None)
    assert not same_array(values, values[None])


def test_messages_are_told_once_and_long_lists_cut():
    messages = Messages()
    messages.add("a", "cause", "One.")
    messages.add("a", "cause", "Again.")
    for number in range(8):
        messages.add_named("Left out:", f"o{number}")
        messages.add_named("Left out:", f"o{number}")
    assert messages.texts() == ("One.", "Left out: “o0”, “o1”, “o2”, “o3”, “o4” and 3 more.")


def test_sharing_a_mesh_with_a_modified_object_that_goes(empty_scene):
    """Keys belong to what is shown: the plain object's mesh is not affected by the one with a modifier before it."""
    first = make_object("First")
    first.modifiers.new("Array", "ARRAY")
    link("Second", first.data)
    mirror = Mirror()
    before = sync(mirror).scene
    assert len(before.meshes) == 2
    first.hide_viewport = True
    after = sync(mirror).scene
    (key,) = after.meshes
    assert after.meshes[key] is before.meshes[key]
