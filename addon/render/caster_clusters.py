# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles of the casters a shadow map has to draw. Pure: no OpenGL, no Blender."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..scene import Mesh
from ..scene.arrays import BoolArray, Float64Array, Int64Array, UInt32Array
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
    """The clusters that a caster consists of, and which of all boxes are theirs, instance after instance."""

    triangles: UInt32Array
    first: Int64Array
    count: Int64Array
    boxes: slice

    def runs(self, visible: BoolArray) -> list[tuple[int, int]]:
        """Stretches of indices of the clusters that are visible as any instance, by all boxes."""
        chosen = np.logical_or.reduce(visible[self.boxes].reshape(-1, len(self.first)))
        return runs(chosen, 3 * self.first, 3 * self.count)


class CasterClusters:
    """The clusters of casters' meshes, made when they pay and kept as long as the meshes are there."""

    def __init__(self) -> None:
        self._draws: Sequence[Draw] = ()
        self._meshes: Mapping[str, Mesh] = {}
        self._whole_views: dict[tuple[str, int], int] = {}
        self._clusters: dict[tuple[str, int], Clusters] = {}
        self._placed: dict[int, _Placed] = {}
        self._boxes = np.zeros((0, 2, 3))

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
        """What to draw of casters, given by index, in a view that sees what is inside of planes (P, 4), world space."""
        self._cut({self._draws[index].batch.mesh for index in casters.tolist() if _is_worth(self._draws[index])})
        visible = boxes_inside(self._boxes, planes)
        parts = [self._part(index, visible) for index in casters.tolist()]
        return [part for part in parts if part.runs]

    def _part(self, index: int, visible: BoolArray) -> CasterPart:
        placed = self._placed.get(index)
        if placed is not None:
            return CasterPart(index, placed.triangles, placed.runs(visible))
        draw = self._draws[index]
        return CasterPart(index, self._meshes[draw.batch.mesh].triangles, [(draw.first_index, draw.index_count)])

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
        boxes: list[Float64Array] = [np.zeros((0, 2, 3))]
        self._placed = {}
        total = 0
        for index, draw in enumerate(self._draws):
            clusters = self._clusters.get(_identity(self._meshes[draw.batch.mesh]))
            if clusters is None or not _is_worth(draw):
                continue
            ends = np.searchsorted(3 * clusters.first, [draw.first_index, draw.first_index + draw.index_count])
            own = slice(*ends.tolist())
            placed = [placed_boxes(clusters.boxes[own], matrix) for matrix in draw.batch.matrices]
            count = sum(map(len, placed))
            where = slice(total, total + count)
            self._placed[index] = _Placed(clusters.triangles, clusters.first[own], clusters.count[own], where)
            boxes += placed
            total += count
        self._boxes = np.concatenate(boxes)


def _is_worth(draw: Draw) -> bool:
    return draw.batch.count <= MOST_INSTANCES


def _identity(mesh: Mesh) -> tuple[str, int]:
    return mesh.key, mesh.version
