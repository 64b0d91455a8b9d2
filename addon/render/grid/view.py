# SPDX-License-Identifier: GPL-3.0-or-later
"""What a view's radiance grid is fitted to: the scene, what of it the camera sees, and how many faces it may have."""

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np

from ...scene import IndirectSettings, Mesh, Scene
from ...scene.arrays import Float64Array
from ..casters import instance_bounds
from ..layout import DEPTH_TILES_TARGET, TILE_SIZE
from ..passes.base import Frame
from ..readback import read_target
from ..receivers import visible_receivers
from .levels import COARSER, GridLevel, cell_size, expected_faces, grid_levels
from .textures import bytes_per_face

_SAME_CELLS = 1.5
"""A viewport keeps its cells until they are so many times larger or smaller than they should be."""

_CLOSEST = 4.0
"""A camera that comes near something typical of the scene gets cells so many times finer than where it sees all."""

_SEEN_SHARE = 0.8
"""Share of the picture whose depth decides how fine the cells are: what is farther may be any distance away."""

_MOST_COARSE_FACES = 15.0
"""Times the square of the cells along what is seen. Light bounces between all faces but those of the finest level,
which is what a grid costs; a camera that sees little of a scene with much surface around it gets larger cells in place
of more of them. Sponza has 12 where all of it is seen; near a wall it would have 55."""


@dataclass(frozen=True)
class GridView:
    """`bounds`: box (2, 3) in world space around the scene. `center` (3,): of what is seen. `cell` (m): the finest."""

    bounds: Float64Array
    center: Float64Array
    cell: float

    def levels(self, indirect: IndirectSettings, lattice: int) -> tuple[GridLevel, ...]:
        """Where the grid is. `lattice`: number of one of many that are equally good."""
        memory = indirect.grid_memory << 20
        return grid_levels(self.bounds, self.center, self.cell, indirect.cells, memory, lattice)


class GridFitting:
    """Fits grids to views; what it finds out about meshes is kept."""

    def __init__(self) -> None:
        self._areas: dict[Hashable, Float64Array] = {}
        self._before: tuple[IndirectSettings, float] | None = None

    def fit(self, frame: Frame) -> GridView:
        """The grid that a view needs. A viewport with the settings of the view before keeps cells that nearly fit."""
        scene, indirect = frame.scene, frame.settings.indirect
        boxes, areas = self._surface(scene)
        bounds = np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
        seen = _seen_box(frame)
        seen = bounds if seen is None else seen
        typical = float(np.median((boxes[:, 1] - boxes[:, 0]).max(axis=1)))
        cell = indirect.cell_size or max(cell_size(seen, indirect.cells), typical / (_CLOSEST * indirect.cells))
        view = GridView(bounds, seen.mean(axis=0), cell)
        while _is_costly(view.levels(indirect, 0), indirect, boxes, areas):
            view = GridView(bounds, view.center, COARSER * view.cell)
        if frame.continuous and self._before is not None and self._before[0] == indirect and not indirect.cell_size:
            same = GridView(bounds, view.center, self._before[1])
            nearly = 1.0 / _SAME_CELLS <= same.cell / view.cell <= _SAME_CELLS
            if nearly and not _is_costly(same.levels(indirect, 0), indirect, boxes, areas):
                view = same
        self._before = indirect, view.cell
        return view

    def _surface(self, scene: Scene) -> tuple[Float64Array, Float64Array]:
        """(N, 2, 3) boxes around all instances, world space, at least one, and (N,) about how much surface (m²) each
        has."""
        held, self._areas = self._areas, {}
        boxes, areas = [np.zeros((0, 2, 3))], [np.zeros(0)]
        for batch in scene.batches:
            mesh = scene.meshes[batch.mesh]
            key = mesh.key, mesh.version
            if key not in self._areas:
                self._areas[key] = held[key] if key in held else _areas_across(mesh)
            boxes.append(instance_bounds(mesh, batch))
            areas.append(_placed_areas(self._areas[key], batch.matrices))
        if sum(map(len, areas)) == 0:
            return np.zeros((1, 2, 3)), np.zeros(1)
        return np.nan_to_num(np.concatenate(boxes)), np.nan_to_num(np.concatenate(areas))


def _is_costly(
    levels: tuple[GridLevel, ...], indirect: IndirectSettings, boxes: Float64Array, areas: Float64Array
) -> bool:
    """Whether the faces of so much surface take too much memory, or time where the user chose no size."""
    memory = expected_faces(levels, boxes, areas) * bytes_per_face(indirect.cell_rays)
    if memory > indirect.grid_memory << 20:
        return True
    most = _MOST_COARSE_FACES * indirect.cells**2
    return not indirect.cell_size and expected_faces(levels[1:], boxes, areas) > most


def _placed_areas(area: Float64Array, matrices: Float64Array) -> Float64Array:
    """(N,) about how much surface (m²) instances have: `area` (3,), shared among the axes, times what the matrices
    (N, 4, 4) make of squares across each."""
    x, y, z = (matrices[:, :3, axis] for axis in range(3))
    scales = [np.linalg.norm(np.cross(*across), axis=1) for across in ((y, z), (z, x), (x, y))]
    return np.stack(scales, axis=1) @ area


def _areas_across(mesh: Mesh) -> Float64Array:
    """(3,) area of a mesh's triangles, m² of object space, shared among the axes as their normals point along them."""
    a, b, c = (mesh.positions[mesh.triangles[:, corner]].astype(np.float64) for corner in range(3))
    across = np.cross(b - a, c - a)
    shares = np.abs(across).sum(axis=0)
    return 0.5 * np.sqrt((across**2).sum(axis=1)).sum() * shares / max(shares.sum(), 1e-300)


def _seen_box(frame: Frame) -> Float64Array | None:
    """(2, 3) box in world space of the nearer part of what the camera sees; None where it sees nothing."""
    tiles = read_target(frame.pool, DEPTH_TILES_TARGET)[:1]
    seen = visible_receivers(tiles, TILE_SIZE, frame.view, frame.pool.size, 0.0)
    if seen.count == 0:
        return None
    corners = seen.between(0.0, float(np.quantile(seen.far, _SEEN_SHARE))).corners.reshape(-1, 3)
    return np.stack([corners.min(axis=0), corners.max(axis=0)])
