# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.render.caster_clusters import MOST_INSTANCES, SMALLEST, WHOLE_VIEWS, CasterClusters
from addon.render.clusters import CLUSTER_TRIANGLES, cluster, placed_boxes, runs
from addon.render.frustum import boxes_inside, frustum_planes
from addon.scene import SlotRange
from blender_tests import builders


def random_mesh(generator, slots, *, spread=10.0, size=0.3, coincident=0):
    """Small triangles all over a cube, of slots with so many each; some of them in one place."""
    total = sum(slots)
    middles = generator.uniform(-spread, spread, (total, 1, 3))
    middles[generator.permutation(total)[: coincident * total // 100]] = 1.0
    positions = middles + generator.uniform(-size, size, (total, 3, 3))
    firsts = np.cumsum([0, *slots])
    ranges = tuple(SlotRange(3 * i, int(firsts[i]), count) for i, count in enumerate(slots))
    triangles = generator.permutation(3 * total).reshape(-1, 3)
    corners = positions.reshape(-1, 3)[np.argsort(triangles.ravel())]
    return builders.mesh("mesh", corners, triangles, normals=np.zeros_like(corners), slots=ranges)


def grid(cells):
    """A flat grid of cells × cells squares about the origin, 1 m wide, of two triangles each."""
    side = cells + 1
    y, x = np.mgrid[:side, :side] / cells - 0.5
    corner = (np.arange(cells)[:, None] * side + np.arange(cells)).ravel()
    below = np.column_stack([corner, corner + 1, corner + side])
    above = np.column_stack([corner + 1, corner + side + 1, corner + side])
    positions = np.column_stack([x.ravel(), y.ravel(), np.zeros(side * side)])
    return builders.mesh("grid", positions, np.concatenate([below, above]), normals=np.zeros((side * side, 3)))


def visible_runs(clusters, planes):
    """Stretches of triangles in the clusters whose boxes reach into half spaces, object space."""
    visible = boxes_inside(clusters.boxes.astype(np.float64), planes)
    found = runs(visible, np.zeros(len(visible), np.int64), clusters.first, clusters.count)
    return [(first, count) for _, first, count in found]


def covered(stretches, total):
    """(total,) bool: which of so many indices some stretch holds."""
    drawn = np.zeros(total, bool)
    for first, count in stretches:
        drawn[first : first + count] = True
    return drawn


SLOTS = st.lists(st.integers(0, 400), min_size=0, max_size=3).map(tuple)


@given(SLOTS, st.sampled_from([0, 50, 100]), st.integers(0, 2**32 - 1))
def test_clusters_are_the_triangles_of_each_slot_in_another_order(slots, coincident, seed):
    mesh = random_mesh(np.random.default_rng(seed), slots, coincident=coincident)
    clusters = cluster(mesh)
    for slot in mesh.slots:
        part = slice(slot.first, slot.first + slot.count)
        assert sorted(clusters.triangles[part].tolist()) == sorted(mesh.triangles[part].tolist())
    assert clusters.triangles.dtype == np.uint32
    assert np.array_equal(clusters.first, np.cumsum([0, *clusters.count])[:-1])
    assert clusters.count.sum() == len(mesh.triangles)
    assert ((clusters.count > 0) & (clusters.count <= CLUSTER_TRIANGLES)).all()
    assert {slot.first for slot in mesh.slots if slot.count} <= set(clusters.first.tolist())
    corners = mesh.positions[clusters.triangles]
    for first, count, box in zip(clusters.first, clusters.count, clusters.boxes, strict=True):
        assert np.array_equal(box[0], corners[first : first + count].min(axis=(0, 1)))
        assert np.array_equal(box[1], corners[first : first + count].max(axis=(0, 1)))


def test_clusters_of_a_grid_are_squares_that_hardly_overlap():
    clusters = cluster(grid(128))
    sizes = clusters.boxes[:, 1, :2] - clusters.boxes[:, 0, :2]
    assert len(clusters.first) <= 2 * 128 * 128 / (CLUSTER_TRIANGLES / 2)
    assert np.prod(sizes, axis=1).sum() < 1.5
    assert (sizes.max(axis=1) <= 3.0 * sizes.min(axis=1)).all()


@given(SLOTS, st.integers(0, 2**32 - 1))
def test_no_triangle_that_reaches_into_the_view_is_missing(slots, seed):
    generator = np.random.default_rng(seed)
    mesh = random_mesh(generator, slots)
    clusters = cluster(mesh)
    camera = builders.camera(z=generator.uniform(-9.0, 9.0), half_width=0.5, clip_end=8.0)
    planes = frustum_planes(camera)
    found = visible_runs(clusters, planes)
    inside = (mesh.positions.astype(np.float64) @ planes[:, :3].T + planes[:, 3] >= 0.0).all(axis=1)
    assert covered(found, len(mesh.triangles))[inside[clusters.triangles].any(axis=1)].all()
    assert all(end[0] + end[1] < start[0] for end, start in pairwise(found))


def test_a_small_view_draws_a_small_part():
    clusters = cluster(grid(256))
    camera = builders.camera(z=1.0, half_width=0.05)
    drawn = sum(count for _, count in visible_runs(clusters, frustum_planes(camera)))
    assert 0.01 * len(clusters.triangles) <= drawn <= 0.04 * len(clusters.triangles)


def test_stretches_end_where_something_is_missing_between():
    first, count = np.array([0, 3, 6, 10, 12]), np.array([3, 3, 3, 2, 5])
    one, two = np.zeros(5, np.int64), np.array([4, 4, 4, 7, 9])
    assert runs(np.array([1, 1, 0, 0, 1], bool), one, first, count) == [(0, 0, 6), (0, 12, 5)]
    assert runs(np.ones(5, bool), one, first, count) == [(0, 0, 9), (0, 10, 7)]
    assert runs(np.ones(5, bool), two, first, count) == [(4, 0, 9), (7, 10, 2), (9, 12, 5)]
    assert runs(np.zeros(5, bool), one, first, count) == []


def test_placed_boxes_hold_the_placed_corners():
    generator = np.random.default_rng(4)
    boxes = np.sort(generator.normal(size=(50, 2, 3)), axis=1).astype(np.float32)
    matrix = np.eye(4)
    matrix[:3] = generator.normal(size=(3, 4))
    placed = placed_boxes(boxes, matrix)
    corners = np.stack(
        [
            np.stack([boxes[:, i, 0], boxes[:, j, 1], boxes[:, k, 2]], axis=-1)
            for i in (0, 1)
            for j in (0, 1)
            for k in (0, 1)
        ],
        axis=1,
    )
    corners = corners @ matrix[:3, :3].T + matrix[:3, 3]
    assert np.allclose(placed[:, 0], corners.min(axis=1), rtol=0.0, atol=1e-12)
    assert np.allclose(placed[:, 1], corners.max(axis=1), rtol=0.0, atol=1e-12)


def caster(mesh, matrices=None):
    """What there is to draw of instances of a mesh, slot by slot."""
    batch = builders.batch(mesh.key, matrices)
    return [SimpleNamespace(batch=batch, first_index=3 * s.first, index_count=3 * s.count) for s in mesh.slots]


def look(clusters, times, casters, planes):
    """What it draws the last of so many times."""
    return [clusters.seen(np.array(casters), planes) for _ in range(times)][-1]


def test_a_mesh_is_cut_once_enough_views_have_drawn_it_whole():
    mesh = grid(64)
    draws, meshes = caster(mesh), {mesh.key: mesh}
    planes = frustum_planes(builders.camera(z=1.0, half_width=0.1))
    clusters = CasterClusters()
    clusters.begin(draws, meshes)
    (whole,) = look(clusters, WHOLE_VIEWS, [0], planes)
    assert whole.triangles is mesh.triangles
    assert whole.runs == [(0, 3 * len(mesh.triangles))]
    (part,) = look(clusters, 1, [0], planes)
    assert sum(count for _, count in part.runs) < 0.2 * 3 * len(mesh.triangles)
    assert part.runs == [(3 * first, 3 * count) for first, count in visible_runs(cluster(mesh), planes)]
    clusters.begin(caster(mesh), dict(meshes))
    (kept,) = look(clusters, 1, [0], planes)
    assert kept.triangles is part.triangles
    changed = replace(mesh, version=2)
    clusters.begin(caster(changed), {mesh.key: changed})
    (again,) = look(clusters, 1, [0], planes)
    assert again.triangles is mesh.triangles


def test_every_slot_and_instance_is_drawn_where_it_is_seen():
    mesh = random_mesh(np.random.default_rng(6), (600, 300), spread=1.0, size=0.02)
    beside = [builders.translation(x=0.0), builders.translation(x=40.0), builders.translation(x=80.0)]
    draws, meshes = caster(mesh, beside), {mesh.key: mesh}
    clusters = CasterClusters()
    clusters.begin(draws, meshes)
    both = look(clusters, WHOLE_VIEWS + 1, [0, 1], frustum_planes(builders.camera(z=3.0, half_width=100.0)))
    assert [(part.caster, part.runs) for part in both] == [(0, [(0, 1800)]), (1, [(1800, 900)])]
    around = builders.camera(z=3.0, half_width=0.2)
    at_third = replace(around, world_from_camera=builders.translation(x=80.5, z=3.0))
    alone = cluster(mesh)
    expected = visible_runs(alone, frustum_planes(at_third) @ beside[2])
    found = look(clusters, 1, [0, 1], frustum_planes(at_third))
    assert [part.caster for part in found] == [0, 1]
    drawn = covered((run for part in found for run in part.runs), 2700)
    assert 0 < drawn.sum() < 2700
    assert np.array_equal(drawn, covered(((3 * first, 3 * count) for first, count in expected), 2700))
    away = replace(around, world_from_camera=builders.translation(x=20.0, z=3.0))
    assert look(clusters, 1, [0, 1], frustum_planes(away)) == []


@pytest.mark.parametrize(
    ("cells", "instances"), [(int((SMALLEST / 2) ** 0.5) - 1, 1), (64, MOST_INSTANCES + 1)], ids=["small", "many"]
)
def test_small_meshes_and_many_instances_are_drawn_whole(cells, instances):
    mesh = grid(cells)
    clusters = CasterClusters()
    clusters.begin(caster(mesh, [np.eye(4)] * instances), {mesh.key: mesh})
    (part,) = look(clusters, 3 * WHOLE_VIEWS, [0], frustum_planes(builders.camera(z=1.0, half_width=0.1)))
    assert part.runs == [(0, 3 * len(mesh.triangles))]
