# SPDX-License-Identifier: GPL-3.0-or-later
from itertools import pairwise
from math import inf, nan, sqrt

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from addon.render.grid import points as grid_points
from addon.render.grid.points import REACH, surface_points
from addon.scene import SlotRange
from blender_tests import builders

pytestmark = pytest.mark.filterwarnings("error")

SINGLE = float(np.finfo(np.float32).eps)
FEW = settings(max_examples=50)
SEEDS = st.integers(0, 2**32 - 1)
EXPONENTS = st.integers(-30, 30)
COORDINATES = st.one_of(
    st.floats(-10.0, 10.0, width=32),
    st.sampled_from([0.0, 1.0, nan, 1e-45, -1e-38, 1e-20, 3e15, -1e30, 1e38]),
)
TRIANGLES = st.lists(st.tuples(*[COORDINATES] * 9), max_size=3)


def soup(corners, **arguments):
    """A mesh of triangles (T, 3, 3) that share no corners."""
    corners = np.asarray(corners, np.float32).reshape(-1, 3)
    return builders.mesh("soup", corners, np.arange(len(corners)), normals=np.zeros_like(corners), **arguments)


def any_soup(generator, count, exponent=0):
    """Triangles of very unequal sizes, in the places that their own size has."""
    corners = generator.normal(size=(count, 3, 3)) * 10.0 ** generator.uniform(-2.0, 1.0, (count, 1, 1))
    return soup(corners * 10.0**exponent)


def level_triangle(z):
    """Corners (3, 3) of half a square metre that faces +Z."""
    return np.array([(0.0, 0.0, z), (1.0, 0.0, z), (0.0, 1.0, z)])


def points_of(mesh, density, box=None):
    """Points on a mesh's first slot."""
    return surface_points(mesh, mesh.slots[0], density, None if box is None else np.array(box, np.float64))


def points_inside(mesh, density, box=None):
    """Points on a mesh's first slot without those along edges."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(grid_points, "_MOST_ON_EDGES", 0.0)
        return points_of(mesh, density, box)


def surface_of(points):
    """Area that points stand for together."""
    return (points.reaches[:, 0, 3] / 255.0).sum() * points.area


def across(mesh):
    """(T, 3) twice the area of each triangle, along its normal."""
    a, b, c = (mesh.positions[mesh.triangles[:, corner]].astype(np.float64) for corner in range(3))
    return np.cross(b - a, c - a)


def areas_of(mesh):
    """(T,) area of each triangle."""
    return 0.5 * np.linalg.norm(across(mesh), axis=1)


def places_in(mesh, positions, triangles):
    """(N, 3) barycentric coordinates in triangles (N,), and (N,) the distances from their planes."""
    corners = mesh.positions[mesh.triangles[triangles]].astype(np.float64)
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    offsets = positions - corners[:, 0]
    inside = np.einsum("nij,nj->ni", np.linalg.pinv(edges), offsets)
    off = np.linalg.norm(offsets - np.einsum("nij,nj->ni", edges, inside), axis=1)
    return np.column_stack([1.0 - inside.sum(axis=1), inside]), off


def owners(mesh, points):
    """(N,) which triangle each point is of, when they follow the triangles' areas."""
    normals = across(mesh) / np.linalg.norm(across(mesh), axis=1, keepdims=True)
    return np.abs(normals[None] - points.normals[:, None]).sum(axis=2).argmin(axis=1)


@FEW
@given(st.integers(1, 8), EXPONENTS, st.floats(0.1, 300.0), SEEDS)
def test_points_stand_for_all_of_the_surface(count, exponent, wanted, seed):
    mesh = any_soup(np.random.default_rng(seed), count, exponent)
    total = areas_of(mesh).sum()
    points = points_of(mesh, wanted / total)
    assert surface_of(points) == pytest.approx(total, rel=1e-12)
    inside = points_inside(mesh, wanted / total).count
    assert wanted * (1.0 - 1e-12) <= inside <= wanted * (1.0 + 1e-12) + 1.0
    assert inside <= points.count <= 1.25 * inside
    assert (points.positions.dtype, points.positions.shape) == (np.float32, (points.count, 3))
    assert (points.normals.dtype, points.normals.shape) == (np.float32, (points.count, 3))
    assert (points.reaches.dtype, points.reaches.shape) == (np.uint8, (points.count, 2, 4))


@FEW
@given(st.integers(1, 8), EXPONENTS, SEEDS)
def test_points_lie_in_their_triangles_with_their_normals(count, exponent, seed):
    mesh = any_soup(np.random.default_rng(seed), count, exponent)
    points = points_of(mesh, 100.0 / areas_of(mesh).sum())
    triangle = owners(mesh, points)
    unit = across(mesh)[triangle]
    np.testing.assert_allclose(points.normals, unit / np.linalg.norm(unit, axis=1, keepdims=True), atol=2 * SINGLE)
    corners = mesh.positions[mesh.triangles[triangle]].astype(np.float64)
    size = np.abs(corners).max(axis=(1, 2))
    inside, off = places_in(mesh, points.positions, triangle)
    assert (off <= SINGLE * size).all()
    lowest_height = np.linalg.norm(unit, axis=1) / np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(
        axis=1
    )
    assert (inside.min(axis=1) * lowest_height >= -SINGLE * size).all()


@FEW
@given(st.integers(1, 12), st.floats(0.5, 500.0), SEEDS)
def test_triangles_have_points_by_their_area_whatever_their_sizes(count, wanted, seed):
    """Equal steps along the areas: of each triangle, and of all that lie together, less than one more or fewer."""
    mesh = any_soup(np.random.default_rng(seed), count)
    areas = areas_of(mesh)
    points = points_inside(mesh, wanted / areas.sum())
    triangle = owners(mesh, points)
    assert (np.diff(triangle) >= 0).all()
    found = np.concatenate([[0], np.cumsum(np.bincount(triangle, minlength=count))])
    expected = np.concatenate([[0.0], np.cumsum(areas)]) / points.area
    assert np.abs(found - expected).max() <= 0.5 + 1e-9
    for first in range(count):
        assert (np.abs((found - found[first]) - (expected - expected[first])) <= 1.0 + 1e-9).all()


@pytest.mark.parametrize("count", [256, 1000, 4096, 20000])
def test_points_are_spread_over_a_triangle_more_evenly_than_by_chance(count):
    """In each of 16 equal parts of it as many as elsewhere, but for the standard deviation of independent points."""
    mesh = soup([(0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (1.0, 2.0, 0.0)])
    points = points_inside(mesh, (count - 0.5) / 3.0)
    assert points.count == count
    inside, _ = places_in(mesh, points.positions, np.zeros(count, np.int64))
    parts = np.floor(4.0 * inside.clip(0.0, 1.0 - SINGLE)).astype(np.int64)
    _, counts = np.unique(parts, axis=0, return_counts=True)
    assert len(counts) == 16
    assert np.abs(counts - count / 16.0).max() <= sqrt(count * 15.0) / 16.0


@pytest.mark.parametrize("box", [None, [[-0.5] * 3, [0.5] * 3]])
def test_a_large_triangle_has_points_along_its_edges_and_none_where_it_is_cut(box):
    """No farther apart than they reach both ways, after those inside."""
    mesh, density = soup([(-0.4, -0.4, 0.0), (4.0, -0.4, 0.0), (-0.4, 4.0, 0.0)]), 4800.0
    points = points_of(mesh, density, box)
    added = points.positions[points_inside(mesh, density, box).count :]
    inside, _ = places_in(mesh, added, np.zeros(len(added), np.int64))
    assert (inside.min(axis=1) < 1e-6).all()
    farthest = 2.0 * REACH * sqrt(points.area)
    for axis in (0, 1):
        along = np.sort(added[added[:, 1 - axis] < -0.4 + 1e-6, axis])
        along = np.concatenate([[-0.4], along[along < 0.5], [0.5]])
        assert np.diff(along).max() < farthest


def test_a_small_triangle_has_no_points_along_its_edges():
    mesh = soup([level_triangle(0.0)])
    assert points_of(mesh, 100.0).count == points_inside(mesh, 100.0).count == 50


def test_neighbouring_small_triangles_share_points_as_evenly_as_a_large_one_has_them():
    """A square of 5000 triangles in rows with 500 points: a tenth of them in each tenth of the rows."""
    y, x = np.mgrid[:50, :50].reshape(2, -1, 1) / 50.0
    low, high = np.array([[0, 0], [1, 0], [0, 1]]) / 50.0, np.array([[1, 0], [1, 1], [0, 1]]) / 50.0
    corners = np.stack(
        [np.stack([x + t[:, 0], y + t[:, 1], 0 * x + 0 * t[:, 0]], axis=-1) for t in (low, high)], axis=1
    )
    points = points_of(soup(corners), 500.0)
    assert points.count in {500, 501}  # float32
    counts, _ = np.histogram(points.positions[:, 1], np.linspace(0.0, 1.0, 11))
    assert np.abs(counts - 50).max() <= 1


def points_of_anything(triangles, density, box=None):
    """Points, few at most, on triangles with a map and colours; fails where a number is not finite."""
    uvs = np.tile([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], (len(triangles), 1))
    mesh = soup(triangles, uvs=uvs, colors=np.ones((3 * len(triangles), 4)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(grid_points, "MOST_POINTS", 500)
        points = points_of(mesh, density, box)
    assert points.count <= 1.25 * 500
    assert np.isfinite(points.area)
    for array in (points.positions, points.normals, points.uvs, points.uv_scale, points.colors):
        assert len(array) == points.count
        assert np.isfinite(array).all()
    assert len(points.reaches) == points.count
    np.testing.assert_allclose(np.linalg.norm(points.normals, axis=1), 1.0, atol=4 * SINGLE)
    return points


@FEW
@given(TRIANGLES, st.sampled_from([1e-30, 0.5, 30.0, 1e30, inf]))
@example([(1e-45, 0.0, 0.0, 0.0, 1e-45, 0.0, 0.0, 0.0, 1e-45)], inf)
@example([(1e38, 0.0, 0.0, 0.0, 1e38, 0.0, 0.0, 0.0, 1e38)], inf)
@example([(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0), (1.0,) * 9], 30.0)
@example([], 30.0)
def test_whatever_triangles_there_are_points_are_finite_and_nothing_warns(triangles, density):
    """None where a position is not a number, which no mesh's are."""
    points = points_of_anything(triangles, density)
    areas = areas_of(soup(triangles)) if triangles else np.zeros(0)
    assert (points.count > 0) == (bool(np.isfinite(areas).all()) and areas.sum() > 0.0)


@FEW
@given(TRIANGLES.map(lambda triangles: np.clip(triangles, -1e3, 1e3).tolist()))
@example([(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0), (0.5,) * 9])
@example([(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, nan)])
@example([])
def test_near_a_box_too(triangles):
    points = points_of_anything(triangles, 30.0, [[-1.0] * 3, [1.0] * 3])
    usable = [corners for corners in np.reshape(triangles, (-1, 3, 3)) if np.isfinite(corners).all()]
    if any(area_within(corners, np.array([[-1.0] * 3, [1.0] * 3])) > 1e-6 for corners in usable):  # not by rounding
        assert points.count > 0


@pytest.mark.parametrize("position", [0, 1, 2])
def test_triangles_without_area_have_no_points_between_others(position):
    flat = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]])
    corners = [level_triangle(5.0), level_triangle(6.0)]
    corners.insert(position, flat)
    points = points_of(soup(corners, uvs=np.tile([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], (3, 1))), 40.0)
    assert np.unique(points.positions[:, 2], return_counts=True)[1].tolist() == [20, 20]
    assert (points.normals == (0.0, 0.0, 1.0)).all()


def test_only_the_slots_triangles_have_points():
    corners = [level_triangle(z) for z in (0.0, 1.0, 2.0)]
    slots = (SlotRange(0, 0, 1), SlotRange(1, 1, 1), SlotRange(2, 2, 0), SlotRange(3, 2, 1))
    mesh = soup(corners, slots=slots)
    found = [set(surface_points(mesh, slot, 20.0).positions[:, 2].tolist()) for slot in slots]
    assert found == [{0.0}, {1.0}, set(), {2.0}]


@pytest.mark.parametrize(("most", "count"), [(7, 7), (1000, 400)])
def test_there_are_no_more_points_than_the_most_and_they_stand_for_more_then(monkeypatch, most, count):
    monkeypatch.setattr(grid_points, "MOST_POINTS", most)
    points = points_inside(builders.quad("quad"), 100.0)
    assert points.count == count
    assert points.area == pytest.approx(4.0 / count)


@FEW
@given(SEEDS)
def test_maps_and_colours_are_those_of_the_place(seed):
    """Of a map and colours that are linear in the position; the map's scale is the root of its determinant."""
    generator = np.random.default_rng(seed)
    corners = np.column_stack([generator.normal(size=(9, 2)), np.zeros(9)]).astype(np.float32)
    to_uv, to_color = generator.normal(size=(2, 2)), generator.normal(size=(2, 4))
    mesh = soup(corners, uvs=corners[:, :2] @ to_uv, colors=corners[:, :2] @ to_color)
    points = points_of(mesh, 20.0, [[-0.3] * 3, [0.3] * 3] if seed % 2 else None)
    slack = 16 * SINGLE * np.abs(corners).max()
    np.testing.assert_allclose(points.uvs, points.positions[:, :2] @ to_uv, atol=slack * np.abs(to_uv).max())
    np.testing.assert_allclose(points.colors, points.positions[:, :2] @ to_color, atol=slack * np.abs(to_color).max())
    least = areas_of(mesh).min() / np.abs(corners).max() ** 2
    np.testing.assert_allclose(
        points.uv_scale**2, abs(np.linalg.det(to_uv)), atol=400 * SINGLE * np.abs(to_uv).max() ** 2 / least
    )


def test_without_a_map_and_colours_there_are_none():
    points = points_of(builders.quad("quad", uvs=None), 20.0)
    assert points.uvs is None
    assert points.colors is None
    assert not points.uv_scale.any()
    assert points_of(soup(np.zeros((1, 3, 3))), 20.0).uvs is None


def area_within(triangle, box):
    """Area of what of a triangle (3, 3) is in a box (Sutherland and Hodgman 1974)."""
    polygon = list(triangle)
    for axis in range(3):
        for sign, end in ((1.0, box[1, axis]), (-1.0, -box[0, axis])):
            clipped = []
            for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True):
                inside, outside = end - sign * a[axis], end - sign * b[axis]
                if inside >= 0.0:
                    clipped.append(a)
                if (inside >= 0.0) != (outside >= 0.0):
                    clipped.append(a + (b - a) * (inside / (inside - outside)))
            polygon = clipped
    fan = [np.cross(b - polygon[0], c - polygon[0]) for b, c in pairwise(polygon[1:])]
    return 0.5 * float(np.linalg.norm(np.sum(fan, axis=0))) if fan else 0.0


@FEW
@given(st.integers(1, 4), st.floats(-1.0, 1.0), SEEDS)
def test_a_box_leaves_out_no_surface_in_it_and_what_is_beyond_half_its_side(count, exponent, seed):
    """What has more than a point is cut until it is half as large as the box; less is left as it is."""
    generator = np.random.default_rng(seed)
    mesh, low = any_soup(generator, count), generator.normal(size=3)
    box = np.stack([low, low + 10.0**exponent * generator.uniform(0.1, 1.0, 3)])
    corners = mesh.positions[mesh.triangles].astype(np.float64)
    extents = np.ptp(corners, axis=1).max(axis=1)
    half, thinnest = 0.5 * np.ptp(box, axis=0).max(), (areas_of(mesh) / extents**2).min()
    least = sum(area_within(triangle, box) for triangle in corners)
    density = 4.0 / (half**2 * max(thinnest, 0.01))
    points = points_of(mesh, density, box)
    kept = surface_of(points)
    assert kept >= least * (1.0 - 1e-9)
    if thinnest > 0.01:
        near = box + half * np.array([[-1.0], [1.0]])
        most = sum(area_within(triangle, near) for triangle in corners)
        assert kept <= most * (1.0 + 1e-9)
        slack = SINGLE * np.abs(corners).max()
        assert ((points.positions >= near[0] - slack) & (points.positions <= near[1] + slack)).all()


@pytest.mark.parametrize("width", [0.0, 1e-30, 1e-4])
def test_needles_through_a_box_are_not_cut_without_end(width, monkeypatch):
    """Of a triangle without area all parts along its length lie upon one another."""
    cut = []
    quartered = grid_points._quartered
    monkeypatch.setattr(grid_points, "_quartered", lambda corners: cut.append(len(corners)) or quartered(corners))
    mesh = soup([(-1e4, 0.0, 0.0), (-1e4, width, 0.0), (1e4, 0.0, 0.0)])
    points = points_of(mesh, 1200.0, [[-0.5] * 3, [0.5] * 3])
    assert (points.count > 0) == (width > 0.0)
    assert sum(cut) <= 4 * 1200.0 * areas_of(mesh).sum()


@pytest.mark.parametrize("seed", range(8))
def test_in_a_box_points_of_a_large_triangle_are_as_even_as_everywhere(seed):
    """In each of 16 parts of the box as many as elsewhere but for twice the standard deviation of independent points;
    without any of the triangles that it is cut into, of at least a quarter of the box's side, it is more."""
    generator = np.random.default_rng(seed)
    angles = generator.uniform(0.0, 6.0) + np.arange(3) * 2.0944
    corners = 10.0 ** generator.uniform(1.0, 4.0) * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])
    density = 16.0 * 400.0
    points = points_of(soup(corners), density, [[-0.5] * 3, [0.5] * 3])
    assert 1.0 / points.area == pytest.approx(density, rel=1e-2)
    sides = np.linspace(-0.5, 0.5, 5)
    counts, *_ = np.histogram2d(points.positions[:, 0], points.positions[:, 1], (sides, sides))
    assert np.abs(counts * points.area * density - 400.0).max() <= 2.0 * sqrt(400.0)


@pytest.mark.parametrize("half", [1e3, 1e6, 1e9, 1e11])
def test_surface_in_a_box_has_points_however_large_its_triangles_are(half):
    points = points_of(builders.quad("quad", half=half), 3.0, [[-1.0, -0.5, -1.0], [1.0, 1.5, 1.0]])
    assert 4.0 <= surface_of(points) <= 16.0


def test_a_box_that_holds_all_or_nothing():
    mesh = any_soup(np.random.default_rng(1), 5)
    density = 100.0 / areas_of(mesh).sum()
    whole, every = points_of(mesh, density), points_of(mesh, density, [[-1e3] * 3, [1e3] * 3])
    for name in ("positions", "normals", "uv_scale", "reaches", "area"):
        assert np.array_equal(getattr(whole, name), getattr(every, name))
    assert points_of(mesh, density, [[500.0] * 3, [501.0] * 3]).count == 0
    assert points_of(mesh, density, [[nan] * 3, [nan] * 3]).count == 0


def test_reaches_end_at_the_box_around_the_triangle_or_where_the_next_points_are():
    """In steps of a 255th of the farthest, rounded up; 0 across the triangle's plane."""
    mesh = soup([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
    points = points_of(mesh, 200.0)
    farthest = REACH * sqrt(points.area)
    for side, ends in enumerate((points.positions, (2.0, 0.0, 1.0) - points.positions)):
        expected = np.minimum(ends[:, [0, 2]], farthest)
        reaches = points.reaches[:, side, [0, 2]] * (farthest / 255.0)
        assert (reaches >= expected - 0.01 * farthest / 255.0).all()
        assert (reaches <= expected + farthest / 255.0).all()
    assert not points.reaches[..., 1].any()
    assert points.reaches[..., :3].max() == 255


def test_a_point_of_a_triangle_smaller_than_what_it_stands_for_reaches_half_way_to_the_next():
    points = points_of(soup([(0.0, 0.0, 0.0), (1e-3, 0.0, 0.0), (0.0, 1e-3, 0.0)]), 1e-3)
    assert points.area == pytest.approx(5e-7)
    many = soup(np.tile([[(0.0, 0.0, 0.0), (1e-3, 0.0, 0.0), (0.0, 1e-3, 0.0)]], (100, 1, 1)))
    points = points_of(many, 0.99e5)
    assert points.count == 5
    assert (points.reaches[..., :2] == np.ceil(255.0 * 0.5 / REACH)).all()
    assert not points.reaches[..., 2].any()
