# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from addon.scene import BaseColorSource, Image, ImageTexture, Versions, snapshot
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
        replace(builders.quad("q"), positions=positions, name=name),
        materials=(textured,),
        lights=(builders.light(radius=0.1),),
        images=(Image("i", name, 3, pixels, srgb=True),),
    )
    scene = replace(scene, camera=builders.camera(), versions=Versions(1, 2, 3, 4, 5, 6))
    snapshot.save(path, scene)
    assert_same(snapshot.load(path), scene)


def test_two_snapshots_never_share_a_version(tmp_path):
    snapshot.save(tmp_path / "scene.npz", builders.scene(builders.quad("q")))
    first, second = (snapshot.load(tmp_path / "scene.npz") for _ in range(2))
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
    with pytest.raises(OSError, match="nowhere.npz"):
        snapshot.load(tmp_path / "nowhere.npz")
