# SPDX-License-Identifier: GPL-3.0-or-later
"""What is seen: ray visibility, holdouts, the view layer's world, and what single viewports hide."""

import bpy
import numpy as np
import pytest
from sync_scenes import assert_texts, depsgraph, link, make_image, make_object, node_tree, sync, textured

from addon.scene import Scene
from addon.sync import Mirror, without_hidden


def shown_names(scene: Scene) -> list[str]:
    """Names of the meshes that cameras see, once for each placement."""
    seen = (batch for batch in scene.batches if batch.seen_by_camera)
    return sorted(scene.meshes[batch.mesh].name for batch in seen for _ in range(batch.count))


def casting_names(scene: Scene) -> list[str]:
    """Names of the meshes that cast shadows, once for each placement."""
    casting = (batch for batch in scene.batches if batch.casts_shadow)
    return sorted(scene.meshes[batch.mesh].name for batch in casting for _ in range(batch.count))


def instance_collection(name: str, *objects: bpy.types.Object) -> bpy.types.Object:
    """An empty that instances a collection of objects which are nowhere else in the scene."""
    collection = bpy.data.collections.new(name)
    for item in objects:
        collection.objects.link(item)
        bpy.context.scene.collection.objects.unlink(item)
    empty = link(name, None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    return empty


def test_what_cameras_do_not_see_still_casts_shadows(empty_scene):
    make_object("Seen")
    make_object("Unseen").visible_camera = False
    result = sync()
    assert (shown_names(result.scene), casting_names(result.scene)) == (["Seen"], ["Seen", "Unseen"])
    assert result.warnings == ()


def test_what_casts_no_shadow_is_still_seen(empty_scene):
    make_object("Casting")
    make_object("Seen").visible_shadow = False
    scene = sync().scene
    assert (shown_names(scene), casting_names(scene)) == (["Casting", "Seen"], ["Casting"])


def test_what_is_neither_seen_nor_casts_shadows_is_left_out(empty_scene):
    thing = make_object("Nothing")
    thing.visible_camera = thing.visible_shadow = False
    scene = sync().scene
    assert (scene.batches, len(scene.meshes)) == ((), 0)


@pytest.mark.parametrize(
    ("attribute", "names"),
    [("visible_camera", shown_names), ("visible_shadow", casting_names)],
    ids=["seen", "casting"],
)
def test_an_instance_is_what_both_it_and_its_instancer_are(empty_scene, attribute, names):
    first, second = make_object("First"), make_object("Second")
    setattr(first, attribute, False)
    placer = instance_collection("Both", first, second)
    other = link("Other", None)
    other.instance_type, other.instance_collection = "COLLECTION", placer.instance_collection
    assert names(sync().scene) == ["Second", "Second"]
    setattr(placer, attribute, False)
    assert names(sync().scene) == ["Second"]


def test_objects_of_one_mesh_are_a_batch_for_each_way_in_which_they_are_there(empty_scene):
    usual = make_object("Thing")
    unseen, shadowless, usual_too = (link(name, usual.data) for name in ("Unseen", "Shadowless", "Usual"))
    unseen.visible_camera, shadowless.visible_shadow = False, False
    mirror = Mirror()
    before = sync(mirror).scene
    found = {(batch.seen_by_camera, batch.casts_shadow): batch for batch in before.batches}
    assert {traits: batch.count for traits, batch in found.items()} == {
        (True, True): 2,
        (False, True): 1,
        (True, False): 1,
    }
    assert len({batch.key for batch in before.batches}) == 3
    usual_too.visible_shadow = False
    after = sync(mirror).scene
    assert {batch.key for batch in after.batches} == {batch.key for batch in before.batches}
    assert after.versions.transforms != before.versions.transforms
    assert after.versions.geometry == before.versions.geometry
    kept = [batch for batch in after.batches if batch is found[batch.seen_by_camera, batch.casts_shadow]]
    assert [batch.seen_by_camera for batch in kept] == [False]


def test_what_an_unseen_surface_would_show_is_not_told(empty_scene):
    material, _, _ = textured(make_image())
    thing = make_object("Unseen")
    thing.data.materials.append(material)
    assert_texts(sync().warnings, "no UV map")
    thing.visible_camera = False
    assert sync().warnings == ()


@pytest.mark.parametrize("instanced", [False, True], ids=["object", "instancer"])
@pytest.mark.parametrize(
    ("attribute", "text"),
    [("is_holdout", "Holdouts"), ("is_shadow_catcher", "Shadow catchers")],
    ids=["holdout", "catcher"],
)
def test_holdouts_and_shadow_catchers_are_told(empty_scene, attribute, text, instanced):
    thing = make_object("Thing")
    owner = instance_collection("Placer", thing) if instanced else thing
    assert sync().warnings == ()
    setattr(owner, attribute, True)
    result = sync()
    assert_texts(result.warnings, text, "not rendered yet", f"“{owner.name}”")
    assert shown_names(result.scene) == ["Thing"]


def in_collection(item: bpy.types.Object) -> bpy.types.LayerCollection:
    """Move an object to a collection of its own; the view layer's settings of that collection."""
    collection = bpy.data.collections.new("Special")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(item)
    bpy.context.scene.collection.objects.unlink(item)
    return bpy.context.view_layer.layer_collection.children["Special"]


def test_holdout_collections_are_told(empty_scene):
    in_collection(make_object("Thing")).holdout = True
    assert_texts(sync().warnings, "Holdouts", "“Thing”")


def test_indirect_only_collections_cast_shadows_and_are_told(empty_scene):
    """In Cycles too, they are only missing from what cameras see directly."""
    make_object("Seen")
    in_collection(make_object("Lighting")).indirect_only = True
    result = sync()
    assert (shown_names(result.scene), casting_names(result.scene)) == (["Seen"], ["Lighting", "Seen"])
    assert_texts(result.warnings, "Indirect light", "“Lighting”")


def make_world(name: str, value: float) -> bpy.types.World:
    world = bpy.data.worlds.new(name)
    tree = node_tree(world)
    background, output = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
    background.inputs["Color"].default_value = (value, value, value, 1.0)
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    return world


def test_the_view_layers_own_world_is_used(empty_scene):
    empty_scene.world = make_world("Scene's", 0.1)
    assert sync().scene.world.radiance == pytest.approx((0.1, 0.1, 0.1))
    bpy.context.view_layer.world_override = make_world("Layer's", 0.9)
    assert sync().scene.world.radiance == pytest.approx((0.9, 0.9, 0.9))


def test_a_view_layer_without_environment_is_black(empty_scene):
    empty_scene.world = make_world("World", 0.5)
    bpy.context.view_layer.use_sky = False
    assert sync().scene.world.radiance == (0.0, 0.0, 0.0)


@pytest.fixture(name="area")
def area_fixture(empty_scene) -> bpy.types.Area:
    """A viewport of a window that is not shown anywhere."""
    (window,) = bpy.context.window_manager.windows
    return next(area for area in window.screen.areas if area.type == "VIEW_3D")


def local_view(area: bpy.types.Area, *names: str) -> None:
    """Enter the local view of some objects."""
    bpy.context.view_layer.update()
    for item in bpy.context.view_layer.objects:
        item.select_set(item.name in names)
    region = next(region for region in area.regions if region.type == "WINDOW")
    (window,) = bpy.context.window_manager.windows
    with bpy.context.temp_override(window=window, screen=window.screen, area=area, region=region):
        assert bpy.ops.view3d.localview(frame_selected=False) == {"FINISHED"}


def test_local_view_shows_only_its_objects_lights_and_instances(area):
    make_object("Inside")
    link("Outside", bpy.data.objects["Inside"].data)
    make_object("Other")
    instance_collection("Instancer", make_object("Placed"))
    instance_collection("Outsider", make_object("Missed"))
    for name in ("Lamp", "Dark"):
        link(name, bpy.data.lights.new(name, "POINT"))
    mirror = Mirror()
    local_view(area, "Inside", "Instancer", "Lamp")
    result = mirror.sync(depsgraph(), area.spaces.active)
    assert shown_names(result.scene) == ["Inside", "Inside", "Missed", "Other", "Placed"]
    seen = without_hidden(result.scene, result.hidden, Scene())
    assert shown_names(seen) == ["Inside", "Placed"]
    assert [light.name for light in seen.lights] == ["Lamp"]
    assert all(seen.meshes[key] is mesh for key, mesh in result.scene.meshes.items())
    assert mirror.sync(depsgraph()).scene is result.scene


@pytest.mark.parametrize(("kind", "left"), [("mesh", ([], ["Lamp"])), ("light", (["Placed", "Thing"], []))])
def test_a_viewports_filter_of_object_types_applies(area, kind, left):
    make_object("Thing")
    instance_collection("Instancer", make_object("Placed"))
    link("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    space = area.spaces.active
    setattr(space, f"show_object_viewport_{kind}", False)
    result = Mirror().sync(depsgraph(), space)
    seen = without_hidden(result.scene, result.hidden, Scene())
    assert (shown_names(seen), [light.name for light in seen.lights]) == left


def test_a_viewport_that_hides_nothing_shows_the_mirrors_own_scene(area):
    make_object("Thing")
    result = Mirror().sync(depsgraph(), area.spaces.active)
    assert without_hidden(result.scene, result.hidden, Scene()) is result.scene


def test_what_a_viewport_shows_stays_the_same_until_it_changes(area):
    """Also where something hidden changes, and every version differs from that of the unfiltered scene."""
    make_object("Inside")
    outside = link("Outside", bpy.data.objects["Inside"].data)
    local_view(area, "Inside")
    mirror, seen = Mirror(), [Scene()]

    def look() -> Scene:
        result = mirror.sync(depsgraph(), area.spaces.active)
        seen.append(without_hidden(result.scene, result.hidden, seen[-1]))
        return result.scene

    whole = look()
    outside.location.x = 3.0
    look()
    assert seen[2] is seen[1]
    bpy.data.objects["Inside"].location.x = 2.0
    look()
    assert seen[3].versions.transforms not in (seen[2].versions.transforms, whole.versions.transforms)
    assert seen[3].versions.geometry == seen[2].versions.geometry
    (batch,) = seen[3].batches
    np.testing.assert_allclose(batch.matrices[:, 0, 3], [2.0])
    assert batch.version not in (seen[2].batches[0].version, whole.batches[0].version)
    assert len(batch.ids) == len(batch.object_index) == 1
