# SPDX-License-Identifier: GPL-3.0-or-later
"""Points on the surface of meshes that the radiance grid is filled with. Pure: no OpenGL, no Blender."""

from dataclasses import dataclass

import numpy as np

from ...scene import Mesh, SlotRange
from ...scene.arrays import Float32Array, Float64Array, Int64Array, UInt8Array, UInt32Array

POINTS_PER_CELL = 12.0
"""Points on as much surface as a side of a cell has: 8 leave holes (a closed ball of albedo .8 has .97 of its light,
with 12 it has .99)."""

REACH = 1.5
"""Times the points' spacing: how far from each its surface is taken to go on, unless its triangle ends before."""

MOST_POINTS = 1 << 22
"""Points inside the triangles of one slot of one mesh at most; where that is too few, they are farther apart."""

_MOST_ON_EDGES = 0.25
"""Points along the edges of a triangle over those inside it at most: of smaller triangles edges have none."""

_SHARE_ON_EDGES = 64
"""Of the 255 that a point inside stands for: enough to close a strip, little beside what else a cell has."""

_HALVINGS = 40
"""Triangles that are larger than a box by more than so many have no exact place in it."""


@dataclass(frozen=True)
class SurfacePoints:
    """Points in object space, evenly over the area of the triangles.

    `positions`, `normals` (N, 3) float32: normals of the triangles, unit. `uvs` (N, 2) float32, `colors` (N, 4) float32
    or None where the mesh has none. `uv_scale` (N,) float32: how much of the UV map a metre of the triangle covers.
    `area` (m²): what each point inside its triangle stands for. `reaches` (N, 2, 4) uint8: how far the surface around
    a point goes on towards −x, −y, −z and +x, +y, +z, 255 for `REACH` times the points' spacing; it ends at the box
    around its triangle; and, in both rows, the share of `area` that the point stands for, 255 for all of it.
    """

    positions: Float32Array
    normals: Float32Array
    uvs: Float32Array | None
    colors: Float32Array | None
    uv_scale: Float32Array
    reaches: UInt8Array
    area: float

    @property
    def count(self) -> int:
        """Number of points."""
        return len(self.positions)


def surface_points(mesh: Mesh, slot: SlotRange, density: float, box: Float64Array | None = None) -> SurfacePoints:
    """Points on a slot's triangles, `density` of them per m² of object space.

    `box` (2, 3), object space: what of the surface is well outside may be left out; None for all of it.
    Points follow the triangles' areas at equal steps, and within them Roberts' R2 sequence, so that neighbouring small
    triangles share points as evenly as a large one has them. Large triangles have points along their edges, too: a cell
    that no more than a strip of a wall is in would have none, and light would leave a closed room there.
    """
    triangles = mesh.triangles[slot.first : slot.first + slot.count]
    corners = mesh.positions[triangles].astype(np.float64)
    source = np.arange(len(triangles))
    places = np.broadcast_to(np.eye(3), (len(triangles), 3, 3))
    if box is not None:
        corners, source, places = _near_box(corners, box, density)
    across = _across(corners)
    double = np.sqrt((across**2).sum(axis=1))
    total = 0.5 * float(double.sum())
    if not (total > 0.0 and np.isfinite(total)):
        return _none(mesh)
    count = int(min(max(np.ceil(total * density), 1.0), MOST_POINTS))
    cumulative = np.cumsum(double)
    numbers = np.arange(count)
    chosen = np.searchsorted(cumulative, (numbers + 0.5) * (cumulative[-1] / count), side="right")
    chosen = np.minimum(chosen, len(double) - 1)
    on_edges, edge_lattice = _on_edges(corners, places, 0.5 * double, count / total)
    chosen = np.concatenate([chosen, on_edges])
    lattice = np.concatenate([_triangle_lattice(numbers), edge_lattice])
    weights = (lattice[:, :, None] * places[chosen]).sum(axis=1)
    shares = np.concatenate([np.full(count, 255), np.full(len(on_edges), _SHARE_ON_EDGES)])
    area = 255.0 * total / float(shares.sum())
    chosen_triangles = triangles[source[chosen]]

    def interpolated(values: Float32Array) -> Float32Array:
        corner = values[chosen_triangles]
        return np.ascontiguousarray((weights[..., None] * corner).sum(axis=1), np.float32)

    uvs = None if mesh.uvs is None else interpolated(mesh.uvs)
    positions, normals = interpolated(mesh.positions), across[chosen] / double[chosen, None]
    return SurfacePoints(
        positions,
        normals.astype(np.float32),
        uvs,
        None if mesh.colors is None else interpolated(mesh.colors),
        _uv_scale(mesh, triangles, corners, source, places)[chosen],
        _reaches(positions, mesh.positions[chosen_triangles].astype(np.float64), normals, double[chosen], area, shares),
        area,
    )


def _reaches(
    positions: Float32Array,
    corners: Float64Array,
    normals: Float64Array,
    double: Float64Array,
    area: float,
    shares: Int64Array,
) -> UInt8Array:
    """`SurfacePoints.reaches` of points in triangles (N, 3, 3) of twice these areas (N,)."""
    spacing = float(np.sqrt(area))
    across = np.sqrt(np.maximum(1.0 - normals**2, 0.0))
    # Of triangles that are smaller than what a point stands for, few have points: those stand for the others.
    least = np.where(double < 8.0 * area, 0.5 * spacing, 0.0)[:, None] * across
    low, high = positions - corners.min(axis=1), corners.max(axis=1) - positions
    reaches = np.zeros((len(positions), 2, 4))
    for side, extent in enumerate((low, high)):
        reaches[:, side, :3] = np.clip(np.maximum(extent, least), 0.0, REACH * spacing * across)
    steps = np.ceil(reaches * (255.0 / (REACH * spacing)) - 1e-3).clip(0, 255)
    steps[..., 3] = shares[:, None]
    return steps.astype(np.uint8)


def _triangle_lattice(numbers: Int64Array) -> Float64Array:
    """(N, 3) barycentric coordinates, uniform over the triangle (Turk 1990), along the R2 sequence (Roberts 2018)."""
    u = np.modf(0.5 + numbers[:, None] * np.array([0.7548776662466927, 0.5698402909980532]))[0]
    root = np.sqrt(u[:, 0])
    return np.stack([1.0 - root, root * (1.0 - u[:, 1]), root * u[:, 1]], axis=1)


def _on_edges(
    corners: Float64Array, places: Float64Array, areas: Float64Array, density: float
) -> tuple[Int64Array, Float64Array]:
    """Triangle (E,) and barycentric coordinates (E, 3) of points along the edges of the large ones among triangles
    (T, 3, 3) with `areas` (T,), `REACH` times the spacing of `density` points per unit of area apart.

    `places` (T, 3, 3): barycentric coordinates of their corners in what they were cut from; cuts have no points.
    """
    whole = ((places == 0.0) & (np.roll(places, -1, axis=1) == 0.0)).any(axis=2)
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2) * whole
    counts = np.ceil(lengths * (np.sqrt(density) / REACH))
    large = np.flatnonzero(counts.sum(axis=1) <= _MOST_ON_EDGES * areas * density)
    of_edges = counts[large].astype(np.int64).ravel()
    edges = np.repeat(np.arange(len(of_edges)), of_edges)
    number = np.arange(len(edges)) - np.repeat(np.cumsum(of_edges) - of_edges, of_edges)
    along = (number + 0.5) / of_edges[edges]
    lattice = np.zeros((len(edges), 3))
    lattice[np.arange(len(edges)), edges % 3] = 1.0 - along
    lattice[np.arange(len(edges)), (edges + 1) % 3] = along
    return large[edges // 3], lattice


def _across(corners: Float64Array) -> Float64Array:
    """(T, 3) along the normals of triangles (T, 3, 3), as long as twice their areas."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _near_box(
    corners: Float64Array, box: Float64Array, density: float
) -> tuple[Float64Array, Int64Array, Float64Array]:
    """Triangles (T, 3, 3) cut into smaller ones of which those that may touch a box are left.

    Also which one each came from, and the barycentric coordinates (·, 3, 3) there of its corners. What has no more than
    a point is not cut: the parts of a triangle without area would lie upon one another, ever more of them.
    """
    source = np.arange(len(corners))
    places = np.broadcast_to(np.eye(3), (len(corners), 3, 3))
    side = float((box[1] - box[0]).max())
    done: list[tuple[Float64Array, Int64Array, Float64Array]] = []
    for _ in range(_HALVINGS):
        touches = (corners.min(axis=1) <= box[1]).all(axis=1) & (corners.max(axis=1) >= box[0]).all(axis=1)
        corners, source, places = corners[touches], source[touches], places[touches]
        large = (corners.max(axis=1) - corners.min(axis=1)).max(axis=1) > 0.5 * side
        large[large] = np.sqrt((_across(corners[large]) ** 2).sum(axis=1)) * density > 2.0
        done.append((corners[~large], source[~large], places[~large]))
        if not large.any():
            break
        corners, places = _quartered(corners[large]), _quartered(places[large])
        source = np.repeat(source[large], 4)
    parts = zip(*done, strict=True)
    return tuple(np.concatenate(part) for part in parts)  # pyright: ignore[reportReturnType]


def _quartered(corners: Float64Array) -> Float64Array:
    """(4T, 3, 3) of (T, 3, 3): each triangle's four quarters one after another."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.stack([np.stack(quarter, axis=1) for quarter in quarters], axis=1).reshape(-1, 3, 3)


def _uv_scale(
    mesh: Mesh, triangles: UInt32Array, corners: Float64Array, source: Int64Array, places: Float64Array
) -> Float32Array:
    """(T,) square roots of the triangles' areas on the UV map over those on the surface; 0 without a map."""
    if mesh.uvs is None:
        return np.zeros(len(corners), np.float32)
    uvs = (places[..., None] * mesh.uvs[triangles[source]].astype(np.float64)[:, None]).sum(axis=2)
    a, b = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    area = np.sqrt((_across(corners) ** 2).sum(axis=1))
    scale = np.sqrt(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / np.maximum(area, 1e-300))
    return np.minimum(scale, np.finfo(np.float32).max).astype(np.float32)


def _none(mesh: Mesh) -> SurfacePoints:
    def empty(width: int) -> Float32Array:
        return np.zeros((0, width), np.float32)

    uvs = None if mesh.uvs is None else empty(2)
    colors = None if mesh.colors is None else empty(4)
    return SurfacePoints(empty(3), empty(3), uvs, colors, np.zeros(0, np.float32), np.zeros((0, 2, 4), np.uint8), 0.0)
