# SPDX-License-Identifier: GPL-3.0-or-later
import json
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from addon.scene import (
    ALL_GROUPS,
    BaseColorSource,
    EmissionSampling,
    EnvironmentMap,
    Image,
    ImageTexture,
    SunDisc,
    Versions,
    World,
    snapshot,
)
from addon.scene.correspondence import Correspondence
from addon.scene.versions import new_version
from blender_tests import builders


def assert_same(a, b):
    assert type(a) is type(b)
    if isinstance(a, np.ndarray):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    elif is_dataclass(a):
        for item in fields(a):
            if item.name in ("version", "versions"):
                continue  # numbers of the process that saved it
            assert_same(getattr(a, item.name), getattr(b, item.name))
    elif isinstance(a, dict):
        assert list(a) == list(b)
        for key in a:
            assert_same(a[key], b[key])
    elif isinstance(a, tuple):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            assert_same(x, y)
    else:
        assert a == b


@given(
    positions=hnp.arrays(np.float32, (4, 3), elements=st.floats(width=32)),
    name=st.text(),
    pixels=hnp.arrays(np.uint8, (2, 3, 4)),
)
def test_a_scene_comes_back_as_it_was(tmp_path_factory, positions, name, pixels):
    path = tmp_path_factory.mktemp("snapshot") / "scene.npz"
    textured = builders.material(source=BaseColorSource.TEXTURE, texture=ImageTexture("i"))
    scene = builders.scene(
        replace(builders.quad("q"), positions=positions, velocities=-positions, name=name),
        materials=(textured,),
        lights=(builders.light(radius=0.1),),
        images=(Image("i", name, 3, pixels, srgb=True),),
    )
    disc = SunDisc((0.0, 0.6, 0.8), (0.0, 0.0, 1.0), 0.1, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), -0.1, -0.3, 0.6)
    environment = EnvironmentMap("e", name, 4, positions[None])
    world = World((1.0, 2.0, 3.0), environment, np.eye(3), disc, seen_by_glossy=False)
    hidden = replace(scene.batches[0], seen_by_camera=False, casts_shadow=False, link_group=63)
    linked = replace(scene.lights[0], receiver_groups=ALL_GROUPS - 1, blocker_groups=1, shadow_texel=0.1)
    rough = replace(textured, diffuse_roughness=0.3, emission_sampling=EmissionSampling.FRONT)
    scene = replace(scene, batches=(hidden,), lights=(linked,), materials={"white": rough}, world=world)
    scene = replace(scene, camera=builders.camera(), versions=Versions(1, 2, 3, 4, 5, 6))
    before = replace(scene, batches=(replace(scene.batches[0], version=7, matrices=2.0 * scene.batches[0].matrices),))
    snapshot.save(path, scene, before, replace(before, camera=None))
    loaded = snapshot.load(path)
    assert_same(loaded.scene, scene)
    assert_same(loaded.previous, before)
    assert_same(loaded.earlier, replace(before, camera=None))


def test_without_other_frames_there_are_none(tmp_path):
    snapshot.save(tmp_path / "scene.npz", builders.scene(builders.quad("q")))
    loaded = snapshot.load(tmp_path / "scene.npz")
    assert (loaded.previous, loaded.earlier) == (None, None)


def test_what_frames_share_comes_back_shared_and_what_they_do_not_apart(tmp_path):
    still, moving = builders.quad("still"), replace(builders.quad("moving"), version=new_version())
    moved = replace(moving, version=new_version(), positions=moving.positions + np.float32(1.0))
    image = Image("i", "i", 3, np.zeros((2, 2, 4), np.uint8), srgb=True)
    before = replace(builders.scene(still, moving, images=(image,)), versions=Versions(geometry=new_version()))
    pushed = replace(before.batches[0], version=new_version(), matrices=2.0 * before.batches[0].matrices)
    now = replace(
        before,
        meshes={"still": still, "moving": moved},
        batches=(pushed, before.batches[1]),
        versions=replace(before.versions, geometry=new_version()),
    )
    snapshot.save(tmp_path / "scene.npz", now, before, before)
    loaded = snapshot.load(tmp_path / "scene.npz")
    scene, previous, earlier = loaded.scene, loaded.previous, loaded.earlier
    assert scene.meshes["still"] is previous.meshes["still"] is earlier.meshes["still"]
    assert scene.images["i"] is previous.images["i"]
    assert scene.materials["white"] is previous.materials["white"]
    assert scene.batches[1] is previous.batches[1]
    assert scene.meshes["moving"].version != previous.meshes["moving"].version
    assert scene.meshes["moving"].triangles is previous.meshes["moving"].triangles
    assert previous.meshes["moving"] is earlier.meshes["moving"]
    assert scene.batches[0].version != previous.batches[0].version
    assert scene.versions == replace(previous.versions, geometry=scene.versions.geometry)
    assert scene.versions.geometry != previous.versions.geometry
    correspondence = Correspondence(previous)
    assert correspondence.positions(scene.meshes["moving"]) is previous.meshes["moving"].positions
    assert correspondence.matrices(scene.batches[1]) is scene.batches[1].matrices


def test_an_environment_comes_back_shared_with_a_version_of_this_process(tmp_path):
    environment = EnvironmentMap("e", "e", 7, np.ones((2, 4, 3), np.float32))
    scene = replace(builders.scene(), world=World((1.0, 1.0, 1.0), environment))
    snapshot.save(tmp_path / "scene.npz", scene, replace(scene, camera=builders.camera()))
    first, second = (snapshot.load(tmp_path / "scene.npz") for _ in range(2))
    assert first.scene.world.environment is first.previous.world.environment
    assert first.scene.world.environment.version != second.scene.world.environment.version


def test_shared_arrays_are_stored_once(tmp_path):
    mesh = replace(builders.quad("q"), version=new_version())
    moved = replace(mesh, version=new_version(), positions=mesh.positions + np.float32(1.0))
    snapshot.save(tmp_path / "one.npz", builders.scene(mesh))
    snapshot.save(tmp_path / "two.npz", builders.scene(moved), builders.scene(mesh))
    counts = []
    for name in ("one.npz", "two.npz"):
        with np.load(tmp_path / name) as archive:
            counts.append(len(archive.files))
    batch_arrays = 3  # `builders.scene` makes new batches each time
    assert counts[1] == counts[0] + 1 + batch_arrays


def test_two_items_with_one_version_keep_one_version(tmp_path):
    """Equal versions are equal data even where the objects differ, as those of a mirror and of its copy do."""
    batch = replace(builders.batch("q"), version=new_version())
    now, before = (builders.scene(builders.quad("q"), batches=(replace(batch),)) for _ in range(2))
    snapshot.save(tmp_path / "scene.npz", now, before)
    loaded = snapshot.load(tmp_path / "scene.npz")
    assert loaded.scene.batches[0].version == loaded.previous.batches[0].version


@pytest.mark.parametrize("key", ["array", "item", ""])
def test_any_key_will_do(tmp_path, key):
    snapshot.save(tmp_path / "scene.npz", builders.scene(builders.quad(key)))
    assert list(snapshot.load(tmp_path / "scene.npz").scene.meshes) == [key]


def test_two_snapshots_never_share_a_version(tmp_path):
    snapshot.save(tmp_path / "scene.npz", builders.scene(builders.quad("q")))
    first, second = (snapshot.load(tmp_path / "scene.npz").scene for _ in range(2))
    assert first.meshes["q"].version != second.meshes["q"].version
    assert first.batches[0].version != second.batches[0].version
    assert first.versions != second.versions


def test_a_file_that_is_no_snapshot_is_named(tmp_path):
    path = tmp_path / "broken.npz"
    path.write_bytes(b"PK\x03\x04 not really")
    with pytest.raises(snapshot.SnapshotError, match="broken.npz"):
        snapshot.load(path)
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(snapshot.SnapshotError, match="other.npz"):
        snapshot.load(tmp_path / "other.npz")
    old = {"format": 2, "scene": {}}
    np.savez(tmp_path / "old.npz", header=np.frombuffer(json.dumps(old).encode(), np.uint8))
    with pytest.raises(snapshot.SnapshotError, match="old.npz: snapshot format 2, expected 3"):
        snapshot.load(tmp_path / "old.npz")
    with pytest.raises(OSError, match="nowhere.npz"):
        snapshot.load(tmp_path / "nowhere.npz")
