# SPDX-License-Identifier: GPL-3.0-or-later
"""Light and shadow linking: who is lit and who casts, in bits of lights and groups of batches, as in Cycles."""

import bpy
import pytest
from sync_scenes import assert_texts, cycles_pixel, depsgraph, link, make_material, make_object, only_light, sync

from addon.scene import ALL_GROUPS, LINK_GROUPS, Light, Scene
from addon.sync import Mirror

SIDES = pytest.mark.parametrize(
    ("kind", "bits"), [("receiver_collection", "receiver_groups"), ("blocker_collection", "blocker_groups")]
)


def add_lamp(name: str = "Lamp") -> bpy.types.Object:
    lamp = link(name, bpy.data.lights.new(name, "POINT"))
    lamp.location.z = 2.0
    return lamp


def linking(kind: str, emitter: bpy.types.Object, **states: str) -> bpy.types.Collection:
    """Give an emitter a collection of the objects that are named, each INCLUDE or EXCLUDE."""
    collection = bpy.data.collections.new(f"{emitter.name}'s")
    setattr(emitter.light_linking, kind, collection)
    for name, state in states.items():
        collection.objects.link(bpy.data.objects[name])
        collection.collection_objects[-1].light_linking.link_state = state
    return collection


def groups(scene: Scene) -> dict[str, int]:
    """The group of each mesh, by its name."""
    return {scene.meshes[batch.mesh].name: batch.link_group for batch in scene.batches}


def linked(scene: Scene, light: Light, bits: str) -> set[str]:
    """Names of the meshes that a light reaches."""
    return {name for name, group in groups(scene).items() if getattr(light, bits) >> group & 1}


def test_without_collections_everything_is_linked_to_everything(empty_scene):
    make_object("Thing")
    add_lamp()
    scene = sync().scene
    assert groups(scene) == {"Thing": 0}
    light = only_light(scene)
    assert (light.receiver_groups, light.blocker_groups) == (ALL_GROUPS, ALL_GROUPS)


@SIDES
@pytest.mark.parametrize(
    ("states", "names"),
    [
        ({}, {"A", "B", "C"}),
        ({"A": "INCLUDE"}, {"A"}),
        ({"A": "EXCLUDE"}, {"B", "C"}),
        ({"A": "INCLUDE", "B": "EXCLUDE"}, {"A"}),
        ({"A": "INCLUDE", "C": "INCLUDE"}, {"A", "C"}),
    ],
)
def test_what_is_included_and_what_is_excluded(empty_scene, kind, bits, states, names):
    for name in "ABC":
        make_object(name)
    linking(kind, add_lamp(), **states)
    scene = sync().scene
    light = only_light(scene)
    assert linked(scene, light, bits) == names
    other = "blocker_groups" if bits == "receiver_groups" else "receiver_groups"
    assert getattr(light, other) == ALL_GROUPS


@SIDES
def test_the_first_level_says_what_holds_for_a_whole_collection(empty_scene, kind, bits):
    for name in "ABC":
        make_object(name)
    lamp = add_lamp()
    outer, inner, innermost = linking(kind, lamp, B="INCLUDE"), *(bpy.data.collections.new(name) for name in "IJ")
    outer.children.link(inner)
    inner.children.link(innermost)
    innermost.objects.link(bpy.data.objects["A"])
    innermost.collection_objects[0].light_linking.link_state = "EXCLUDE"
    scene = sync().scene
    assert linked(scene, only_light(scene), bits) == {"A", "B"}
    outer.collection_children[0].light_linking.link_state = "EXCLUDE"
    scene = sync().scene
    assert linked(scene, only_light(scene), bits) == {"B"}
    outer.objects.link(bpy.data.objects["A"])  # what is said of the object itself comes last, and holds
    scene = sync().scene
    assert linked(scene, only_light(scene), bits) == {"A", "B"}


def cycles_case(case: str) -> None:
    """Link the lamp above a floor in one of several ways that Blender's manual leaves open."""
    floor, lamp = bpy.data.objects["Floor"], bpy.data.objects["Lamp"]
    if case == "nothing":
        linking("receiver_collection", lamp)
    elif case == "included and excluded":
        linking("receiver_collection", lamp, Other="INCLUDE", Floor="EXCLUDE")
    elif case == "only another excluded":
        linking("receiver_collection", lamp, Other="EXCLUDE")
    elif case == "instancer excluded":
        placed = bpy.data.collections.new("Placed")
        placed.objects.link(floor)
        bpy.context.scene.collection.objects.unlink(floor)
        empty = link("Placer", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", placed
        linking("receiver_collection", lamp, Floor="INCLUDE", Placer="EXCLUDE")
    else:
        outer, inner = linking("receiver_collection", lamp), bpy.data.collections.new("Inner")
        outer.children.link(inner)
        inner.objects.link(floor)
        outer.collection_children[0].light_linking.link_state = "EXCLUDE" if case == "outer excludes" else "INCLUDE"
        inner.collection_objects[0].light_linking.link_state = "INCLUDE" if case == "outer excludes" else "EXCLUDE"


@pytest.mark.parametrize(
    "case",
    [
        "nothing",
        "included and excluded",
        "only another excluded",
        "instancer excluded",
        "outer excludes",
        "outer includes",
    ],
)
def test_what_is_lit_is_what_cycles_lights(empty_scene, tmp_path, case):
    make_object("Floor", [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [(0, 1, 2, 3)])
    make_object("Other").location.x = 100.0
    add_lamp().data.energy = 100.0
    cycles_case(case)
    scene = sync().scene
    lit = "Floor" in linked(scene, only_light(scene), "receiver_groups")
    assert lit == (cycles_pixel(empty_scene, tmp_path / "floor.exr").max() > 0.0)


def test_several_lights_share_groups_of_what_they_treat_alike(empty_scene):
    for name in "ABCD":
        make_object(name)
    first, second, third = (add_lamp(name) for name in ("First", "Second", "Third"))
    linking("receiver_collection", first, A="INCLUDE", B="INCLUDE")
    linking("blocker_collection", second, A="EXCLUDE", B="EXCLUDE", C="EXCLUDE")
    third.light_linking.receiver_collection = first.light_linking.receiver_collection
    scene = sync().scene
    found = groups(scene)
    assert (found["A"], found["D"]) == (found["B"], 0)
    assert len(set(found.values())) == 3
    by_name = {light.name: light for light in scene.lights}
    assert linked(scene, by_name["First"], "receiver_groups") == {"A", "B"}
    assert linked(scene, by_name["Second"], "blocker_groups") == {"D"}
    assert by_name["Third"].receiver_groups == by_name["First"].receiver_groups
    assert all(light.blocker_groups == ALL_GROUPS for light in (by_name["First"], by_name["Third"]))


@SIDES
def test_an_instancers_links_count_before_those_of_what_it_places(empty_scene, kind, bits):
    placed = make_object("A")
    collection = bpy.data.collections.new("Placed")
    collection.objects.link(placed)
    bpy.context.scene.collection.objects.unlink(placed)
    for name in ("First", "Second"):
        empty = link(name, None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
    linking(kind, add_lamp(), A="INCLUDE", First="EXCLUDE")
    scene = sync().scene
    assert len(scene.batches) == 2
    reached = [getattr(only_light(scene), bits) >> batch.link_group & 1 for batch in scene.batches]
    assert sorted(reached) == [0, 1]


def test_a_light_within_an_instance_keeps_its_links(empty_scene):
    make_object("A")
    lamp = add_lamp()
    linking("receiver_collection", lamp, A="EXCLUDE")
    collection = bpy.data.collections.new("Placed")
    collection.objects.link(lamp)
    bpy.context.scene.collection.objects.unlink(lamp)
    empty = link("Placer", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    linking("receiver_collection", empty, A="INCLUDE")
    scene = sync().scene
    assert linked(scene, only_light(scene), "receiver_groups") == set()


def test_linking_changes_what_it_concerns_and_nothing_else(empty_scene):
    shared = make_object("A")
    link("B", shared.data)
    make_object("C")
    lamp, mirror = add_lamp(), Mirror()
    before = sync(mirror).scene
    linking("receiver_collection", lamp, A="INCLUDE")
    after = sync(mirror).scene
    assert [batch.count for batch in after.batches] == [1, 1, 1]
    assert after.versions.geometry == before.versions.geometry
    assert after.versions.transforms != before.versions.transforms
    assert after.versions.lights != before.versions.lights
    assert before.batches[-1] in after.batches
    assert sync(mirror).scene is after
    lamp.light_linking.receiver_collection = None
    keys = [batch.key for batch in sync(mirror).scene.batches]
    assert keys == [batch.key for batch in before.batches]


def test_keys_tell_what_links_and_do_not_depend_on_the_numbers_of_groups(empty_scene):
    for name in "AB":
        make_object(name)
    second = add_lamp("Second")
    linking("receiver_collection", second, B="INCLUDE")
    mirror = Mirror()
    before = {batch.key: batch for batch in sync(mirror).scene.batches}
    first = add_lamp("First")
    linking("receiver_collection", first, A="INCLUDE")
    after = {batch.key: batch for batch in sync(mirror).scene.batches}
    (kept,) = before.keys() & after.keys()
    assert (before[kept].link_group, after[kept].link_group) == (1, 2)
    assert before[kept].version != after[kept].version


def test_more_kinds_of_objects_than_groups_are_told(empty_scene):
    for number in range(LINK_GROUPS):
        make_object(f"T{number:02}")
        linking("receiver_collection", add_lamp(f"L{number:02}"), **{f"T{number:02}": "INCLUDE"})
    result = sync()
    found = groups(result.scene)
    assert sorted(found.values()) == list(range(LINK_GROUPS))
    (left_out,) = (name for name, group in found.items() if group == 0)
    assert_texts(result.warnings, f"at most {LINK_GROUPS - 1}", f"“{left_out}”")
    bpy.data.objects.remove(bpy.data.objects[left_out])
    assert sync().warnings == ()


def test_linking_of_emissive_surfaces_is_told(empty_scene):
    thing = make_object("Glowing")
    material, node = make_material("Glow", "ShaderNodeEmission")
    thing.data.materials.append(material)
    assert sync().warnings == ()
    linking("receiver_collection", thing)
    assert_texts(sync().warnings, "Light linking of emissive surfaces", "“Glowing”")
    node.inputs["Strength"].default_value = 0.0
    assert sync().warnings == ()


def test_reading_links_leaves_instances_visible(empty_scene):
    """Iterating `Depsgraph.ids` makes Blender say that no viewport shows instanced objects."""
    (window,) = bpy.context.window_manager.windows
    space = next(area for area in window.screen.areas if area.type == "VIEW_3D").spaces.active
    collection = bpy.data.collections.new("Placed")
    collection.objects.link(bpy.data.objects.new("Thing", make_object("Other").data))
    empty = link("Placer", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    add_lamp()
    assert not Mirror().sync(depsgraph(), space).hidden.rows
