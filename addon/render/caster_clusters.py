# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles of the casters a shadow map has to draw. Pure: no OpenGL, no Blender."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..scene import Mesh
from ..scene.arrays import Float64Array, Int64Array, UInt32Array
from .clusters import CLUSTER_TRIANGLES, Clusters, cluster, placed_boxes, runs
from .draws import Draw
from .frustum import boxes_inside

MOST_INSTANCES = 8
"""Batches of more instances are drawn whole: all of them need what any of them does."""

SMALLEST = 4 * CLUSTER_TRIANGLES
"""Triangles below which a mesh is drawn whole."""

WHOLE_VIEWS = 16
"""Views that draw a mesh whole before it is cut into clusters, which takes about as long as they do: one that changes
from picture to picture and is in few shadow maps never is."""


@dataclass(frozen=True)
class CasterPart:
    """What of a caster, given by its index, is to be drawn.

    `triangles` (T, 3) uint32: the mesh's, in its own order or in another. `runs`: (first index, index count) into them.
    """

    caster: int
    triangles: UInt32Array
    runs: list[tuple[int, int]]


@dataclass(frozen=True)
class _Placed:
    """The clusters of all casters that have any, caster after caster: (M,) each one's caster, first index and index
    count. `boxes` (K, 2, 3) float64, world space, of every instance of each cluster, which `owner` (K,) names."""

    caster: Int64Array
    first: Int64Array
    count: Int64Array
    boxes: Float64Array
    owner: Int64Array


class CasterClusters:
    """The clusters of casters' meshes, made when they pay and kept as long as the meshes are there."""

    def __init__(self) -> None:
        self._draws: Sequence[Draw] = ()
        self._meshes: Mapping[str, Mesh] = {}
        self._whole_views: dict[tuple[str, int], int] = {}
        self._clusters: dict[tuple[str, int], Clusters] = {}
        self._placed = _join([])

    def begin(self, draws: Sequence[Draw], meshes: Mapping[str, Mesh]) -> None:
        """These are the casters now, and the meshes by key."""
        if draws is self._draws and meshes is self._meshes:
            return
        self._draws, self._meshes = draws, meshes
        held = {_identity(meshes[draw.batch.mesh]) for draw in draws}
        self._whole_views = {identity: views for identity, views in self._whole_views.items() if identity in held}
        self._clusters = {identity: clusters for identity, clusters in self._clusters.items() if identity in held}
        self._place()

    def seen(self, casters: Int64Array, planes: Float64Array) -> list[CasterPart]:
        """What to draw of casters, given by ascending index, in a view that sees what is inside of planes (P, 4), world
        space."""
        self._cut({self._draws[index].batch.mesh for index in casters.tolist() if _is_worth(self._draws[index])})
        found = self._visible_runs(casters, planes)
        parts = [self._part(index, found.get(index, [])) for index in casters.tolist()]
        return [part for part in parts if part.runs]

    def _visible_runs(self, casters: Int64Array, planes: Float64Array) -> dict[int, list[tuple[int, int]]]:
        """Stretches of indices of the clusters that any instance of which is inside, by caster."""
        placed = self._placed
        chosen = np.zeros(len(placed.caster), np.bool_)
        chosen[placed.owner[boxes_inside(placed.boxes, planes)]] = True
        wanted = np.zeros(len(self._draws), np.bool_)
        wanted[casters] = True
        chosen &= wanted[placed.caster]
        found: dict[int, list[tuple[int, int]]] = {}
        for index, first, count in runs(chosen, placed.caster, placed.first, placed.count):
            found.setdefault(index, []).append((first, count))
        return found

    def _part(self, index: int, found: list[tuple[int, int]]) -> CasterPart:
        draw = self._draws[index]
        mesh = self._meshes[draw.batch.mesh]
        clusters = self._clusters.get(_identity(mesh))
        if clusters is None or not _is_worth(draw):
            return CasterPart(index, mesh.triangles, [(draw.first_index, draw.index_count)])
        return CasterPart(index, clusters.triangles, found)

    def _cut(self, meshes: set[str]) -> None:
        """Make clusters of those of these meshes, in one more view, that have been in enough."""
        before = len(self._clusters)
        for mesh in (self._meshes[key] for key in meshes):
            identity = _identity(mesh)
            if identity in self._clusters or len(mesh.triangles) < SMALLEST:
                continue
            self._whole_views[identity] = self._whole_views.get(identity, 0) + 1
            if self._whole_views[identity] > WHOLE_VIEWS:
                self._clusters[identity] = cluster(mesh)
        if len(self._clusters) > before:
            self._place()

    def _place(self) -> None:
        """Find where the clusters of all casters are."""
        self._placed = _join(
            [
                _place(index, draw, clusters)
                for index, draw in enumerate(self._draws)
                if _is_worth(draw) and (clusters := self._clusters.get(_identity(self._meshes[draw.batch.mesh])))
            ]
        )


def _place(index: int, draw: Draw, clusters: Clusters) -> _Placed:
    """The clusters of one caster."""
    ends = np.searchsorted(3 * clusters.first, [draw.first_index, draw.first_index + draw.index_count])
    own = slice(*ends.tolist())
    boxes = [placed_boxes(clusters.boxes[own], matrix) for matrix in draw.batch.matrices]
    first, count = 3 * clusters.first[own], 3 * clusters.count[own]
    owner = np.tile(np.arange(len(first)), len(boxes))
    return _Placed(np.full(len(first), index), first, count, np.concatenate(boxes), owner)


def _join(parts: Sequence[_Placed]) -> _Placed:
    """The clusters of several casters."""
    starts = np.cumsum([0, *(len(part.first) for part in parts)])
    owners = [part.owner + start for part, start in zip(parts, starts, strict=False)]
    none = np.zeros(0, np.int64)
    return _Placed(
        np.concatenate([none, *(part.caster for part in parts)]),
        np.concatenate([none, *(part.first for part in parts)]),
        np.concatenate([none, *(part.count for part in parts)]),
        np.concatenate([np.zeros((0, 2, 3)), *(part.boxes for part in parts)]),
        np.concatenate([none, *owners]),
    )


def _is_worth(draw: Draw) -> bool:
    return draw.batch.count <= MOST_INSTANCES


def _identity(mesh: Mesh) -> tuple[str, int]:
    return mesh.key, mesh.version
