# SPDX-License-Identifier: GPL-3.0-or-later
"""Which instance and which vertex of one frame is which of another."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from addon.scene import SlotRange
from addon.scene.correspondence import Correspondence, matching_rows
from addon.scene.versions import new_version
from blender_tests import builders

IDS = hnp.arrays(np.int64, st.integers(0, 12), elements=st.sampled_from([-(2**63), -1, 0, 1, 2, 3, 2**63 - 1]))


def placed(places, ids=None, mesh="q", key=None, materials=("white",)):
    """A batch with a version of its own whose instances are told apart by how far they are along x."""
    matrices = np.array([builders.translation(x) for x in places]).reshape(-1, 4, 4)
    ids = np.arange(len(places)) if ids is None else ids
    batch = builders.batch(mesh, matrices, materials, key)
    return replace(batch, ids=np.array(ids, np.int64), version=new_version())


def places(matrices):
    """How far along x each matrix of (N, 4, 4) is."""
    return matrices[:, 0, 3].tolist()


def scene_of(*batches, meshes=("q",)):
    return builders.scene(*(builders.quad(key) for key in meshes), batches=batches)


def changed(mesh, **arrays):
    """A mesh with other arrays and therefore another version."""
    return replace(mesh, version=new_version(), **arrays)


@given(IDS, IDS)
def test_rows_match_the_nth_to_the_nth_or_else_to_the_first(ids, among):
    expected, seen = [], {}
    for identifier in ids.tolist():
        rows = np.flatnonzero(among == identifier).tolist()
        nth = seen[identifier] = seen.get(identifier, -1) + 1
        expected.append(-1 if not rows else rows[nth] if nth < len(rows) else rows[0])
    assert matching_rows(ids, among).tolist() == expected


@given(st.permutations(range(6)), st.permutations(range(6)), st.integers(0, 6), st.integers(0, 6))
def test_instances_are_found_in_any_order_and_number(now, before, count, count_before):
    now, before = now[:count], before[:count_before]
    other = scene_of(placed([10.0 + i for i in before], before))
    matrices = Correspondence(other).matrices(placed([float(i) for i in now], now))
    assert places(matrices) == [10.0 + i if i in before else float(i) for i in now]


def test_a_batch_with_the_same_version_is_not_looked_at():
    batch = placed([1.0])
    broken = replace(batch, matrices=np.empty((0, 4, 4)), ids=np.empty(0, np.int64))
    assert Correspondence(scene_of(broken)).matrices(batch) is batch.matrices


def test_where_nothing_moved_the_matrices_are_the_very_same_array():
    batch = placed([1.0, 2.0])
    other = placed([2.0, 1.0], [1, 0])
    assert Correspondence(scene_of(other)).matrices(batch) is batch.matrices


def test_a_zero_of_the_other_sign_is_no_motion():
    batch, other = placed([0.0]), placed([-0.0])
    assert Correspondence(scene_of(other)).matrices(batch) is batch.matrices


def test_an_instance_that_got_another_material_is_still_itself():
    now = placed([1.0, 2.0], [1, 2], key="q red", materials=("red",))
    red, white = placed([11.0], [1], key="q red"), placed([12.0, 13.0], [2, 3], key="q white")
    assert places(Correspondence(scene_of(white, red)).matrices(now)) == [11.0, 12.0]


def test_an_id_in_two_batches_belongs_to_the_batch_of_the_same_key():
    first, second = placed([11.0], [1], key="a"), placed([12.0], [1], key="b")
    found = Correspondence(scene_of(first, second)).matrices(placed([2.0], [1], key="b"))
    assert places(found) == [12.0]


def test_asked_again_the_answer_is_the_same_object():
    now, mesh = placed([1.0]), builders.quad("q")
    correspondence = Correspondence(builders.scene(mesh, batches=(placed([11.0]),)))
    assert correspondence.matrices(now) is correspondence.matrices(now)
    moved = changed(mesh, positions=mesh.positions + np.float32(1.0))
    assert correspondence.positions(moved) is correspondence.positions(moved)


def test_other_meshes_are_others():
    now = placed([1.0], mesh="r")
    assert Correspondence(scene_of(placed([11.0]), meshes=("q", "r"))).matrices(now) is now.matrices


def test_empty_batches():
    empty = placed([])
    assert len(Correspondence(scene_of(placed([1.0]))).matrices(empty)) == 0
    now = placed([1.0])
    assert Correspondence(scene_of(empty)).matrices(now) is now.matrices


def test_what_was_found_is_not_written_into_the_scenes():
    now, before = placed([1.0, 2.0]), placed([11.0], [0])
    Correspondence(scene_of(before)).matrices(now)
    assert (places(now.matrices), places(before.matrices)) == ([1.0, 2.0], [11.0])


def test_vertices_are_where_they_were():
    mesh = builders.quad("q")
    moved = changed(mesh, positions=mesh.positions + np.float32(1.0))
    assert Correspondence(builders.scene(mesh)).positions(moved) is mesh.positions


def test_triangles_are_compared_and_not_their_array():
    mesh = builders.quad("q")
    moved = changed(mesh, positions=mesh.positions + np.float32(1.0), triangles=mesh.triangles.copy())
    assert Correspondence(builders.scene(mesh)).positions(moved) is mesh.positions


def test_vertices_that_did_not_move_are_the_very_same_array():
    mesh = builders.quad("q")
    recolored = changed(mesh, positions=mesh.positions.copy())
    assert Correspondence(builders.scene(mesh)).positions(recolored) is recolored.positions


def test_a_mesh_with_the_same_version_is_not_looked_at():
    mesh = builders.quad("q")
    assert Correspondence(builders.scene(replace(mesh, positions=None))).positions(mesh) is mesh.positions


@pytest.mark.parametrize(
    "arrays",
    [
        {"triangles": np.array([(0, 1, 2), (0, 3, 2)], np.uint32)},
        {"triangles": np.array([(0, 1, 2)], np.uint32), "slots": (SlotRange(0, 0, 1),)},
        {"positions": np.ones((5, 3), np.float32), "normals": np.ones((5, 3), np.float32)},
        {"key": "r"},
    ],
    ids=["turned", "fewer", "more vertices", "another mesh"],
)
def test_vertices_of_another_topology_have_no_counterpart(arrays):
    mesh = builders.quad("q")
    other = changed(mesh, **{"positions": mesh.positions + np.float32(1.0), **arrays})
    assert Correspondence(builders.scene(mesh)).positions(other) is other.positions
