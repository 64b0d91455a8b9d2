# SPDX-License-Identifier: GPL-3.0-or-later
"""Real scenes that nobody here made: counts, textures and materials make sense, and a second look changes nothing."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from sync_scenes import sync

from addon.scene import BaseColorSource, Scene
from addon.sync import Mirror


def open_scene(folder: Path, name: str) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(folder / name))


def triangle_count(scene: Scene) -> int:
    return sum(batch.count * len(scene.meshes[batch.mesh].triangles) for batch in scene.batches)


def assert_consistent(scene: Scene) -> None:
    """The promises of the contract that any scene must keep."""
    for batch in scene.batches:
        mesh = scene.meshes[batch.mesh]
        assert all(key in scene.materials for key in batch.materials)
        assert mesh.triangles.max() < len(mesh.positions) == len(mesh.normals)
        assert np.isfinite(mesh.positions).all()
        lengths = np.linalg.norm(mesh.normals, axis=1)
        assert (np.isclose(lengths, 1.0, atol=1e-3) | (lengths == 0.0)).all()
        assert [r.first for r in mesh.slots] == list(np.cumsum([0, *(r.count for r in mesh.slots[:-1])]))
        assert sum(r.count for r in mesh.slots) == len(mesh.triangles)
    for material in scene.materials.values():
        assert material.texture is None or material.texture.image in scene.images
    assert [batch.key for batch in scene.batches] == sorted(batch.key for batch in scene.batches)


@pytest.mark.parametrize(
    ("name", "triangles", "textured"),
    [
        ("cornell/cornell.blend", 30, 0),
        ("sponza/sponza.blend", 66445, 17),
        ("living_room/living_room.blend", 143163, 4),
        ("robot_expressive/robot_dance.blend", 3240, 0),
        ("node_materials/22_node_groups.blend", 72, 6),
    ],
)
def test_scene(shared_scenes, name, triangles, textured):
    open_scene(shared_scenes, name)
    mirror = Mirror()
    result = sync(mirror)
    scene = result.scene
    assert_consistent(scene)
    assert triangles * 0.995 <= triangle_count(scene) <= triangles
    assert sum(m.source is BaseColorSource.TEXTURE for m in scene.materials.values()) == textured
    assert scene.camera is not None
    assert scene.lights
    assert len(set(result.warnings)) == len(result.warnings)
    assert sync(mirror).scene is scene


def test_living_room_materials(shared_scenes):
    open_scene(shared_scenes, "living_room/living_room.blend")
    scene = sync().scene
    by_name = {material.name: material for material in scene.materials.values()}
    assert (by_name["Mirror"].metallic, by_name["Mirror"].roughness) == (1.0, 0.0)
    leaves = by_name["Leaves"]
    assert leaves.texture_alpha
    alpha = scene.images[leaves.texture.image].pixels[..., 3]
    assert (alpha == 255).mean() > 0.5  # the file's own alpha, the leaf's outline, is not what the material uses
    assert 30 < alpha.min() < 128


def test_robot_dances(shared_scenes):
    """Skinned and rigid parts move; nothing else changes."""
    open_scene(shared_scenes, "robot_expressive/robot_dance.blend")
    mirror = Mirror()
    bpy.context.scene.frame_set(1)
    before = sync(mirror).scene
    bpy.context.scene.frame_set(20)
    after = sync(mirror).scene
    assert before.versions.materials == after.versions.materials
    assert before.versions.lights == after.versions.lights
    moved = [key for key in after.meshes if after.meshes[key] is not before.meshes[key]]
    assert moved
    assert len(moved) < len(after.meshes)
    assert_consistent(after)


def test_mannequiny(empty_scene, shared_scenes):
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    bpy.ops.import_scene.gltf(filepath=str(shared_scenes / "mannequiny" / "mannequiny.glb"))
    scene = sync().scene
    assert_consistent(scene)
    assert triangle_count(scene) == 13832
    assert {m.source for m in scene.materials.values()} == {BaseColorSource.ATTRIBUTE}
    assert all(mesh.colors is not None for mesh in scene.meshes.values())
