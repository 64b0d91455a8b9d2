# SPDX-License-Identifier: GPL-3.0-or-later
"""The order of draws and lights is that of the file's content, in the session that made it and in later ones."""

import bpy
from sync_scenes import link, make_object, sync

from addon.scene import Scene


def order(scene: Scene) -> list:
    """Everything whose order the picture depends on."""
    batches = [
        (scene.meshes[batch.mesh].name, scene.materials[batch.materials[0]].name, batch.object_index.tolist())
        for batch in scene.batches
    ]
    return [*batches, *((light.name, round(float(light.world_from_light[0, 3]), 3)) for light in scene.lights)]


def test_draws_have_the_same_order_when_the_file_is_opened_again(empty_scene, tmp_path):
    for number, name in enumerate(("D", "B", "C", "A")):
        thing = make_object(name)
        thing.pass_index = number
        if name in "BC":
            thing.modifiers.new("Array", "ARRAY")
        else:
            thing.data.materials.append(None)
    shared = bpy.data.objects["A"].data
    for number, name in enumerate(("Z", "Y", "X")):
        copy = link(name, shared)
        copy.pass_index = 10 + number
        copy.material_slots[0].link = "OBJECT"
        copy.material_slots[0].material = bpy.data.materials.new(f"M{name}") if name != "X" else None
    collection = bpy.data.collections.new("Lights")
    for name in ("L2", "L1"):
        collection.objects.link(bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT")))
    for x, name in enumerate(("E2", "E1")):
        empty = link(name, None)
        empty.instance_type, empty.instance_collection, empty.location.x = "COLLECTION", collection, float(x)
    before = order(sync().scene)
    assert len(before) == 6 + 4
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert order(sync().scene) == before
