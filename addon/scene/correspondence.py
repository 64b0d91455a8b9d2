# SPDX-License-Identifier: GPL-3.0-or-later
"""What of one scene is what of another: the same things at two times."""

import numpy as np

from .arrays import Float32Array, Float64Array, Int64Array
from .geometry import InstanceBatch, Mesh
from .scene import Scene


class Correspondence:
    """Where the instances and vertices of a scene are in an `other` one, of the same world at another time.

    Instances correspond by mesh key and id, vertices by their row in meshes of the same key and topology. Equal
    versions are equal data, so what did not change costs no more than a look at them.
    """

    def __init__(self, other: Scene) -> None:
        self._meshes = other.meshes
        self._matrices: dict[tuple[str, int], Float64Array] = {}
        self._positions: dict[tuple[str, int], Float32Array] = {}
        self._versions = {batch.key: batch.version for batch in other.batches}
        self._batches: dict[str, list[InstanceBatch]] = {}
        for batch in other.batches:
            self._batches.setdefault(batch.mesh, []).append(batch)

    def matrices(self, batch: InstanceBatch) -> Float64Array:
        """(N, 4, 4) float64 world-from-object matrices, in the other scene, of the instances of `batch`.

        An instance that the other scene does not have keeps its own matrix. Where nothing moved, the result is
        `batch.matrices` itself. Asked again, it is the same object.
        """
        if self._versions.get(batch.key) == batch.version:
            return batch.matrices
        key = (batch.key, batch.version)
        if key not in self._matrices:
            matrices = self._matched(batch)
            self._matrices[key] = batch.matrices if np.array_equal(matrices, batch.matrices) else matrices
        return self._matrices[key]

    def positions(self, mesh: Mesh) -> Float32Array:
        """(V, 3) float32 object-space positions, in the other scene, of the vertices of `mesh`.

        `mesh.positions` itself where nothing moved, and where the other scene does not have the mesh or has it with
        other triangles.
        """
        other = self._meshes.get(mesh.key)
        if other is None or other.version == mesh.version:
            return mesh.positions
        key = (mesh.key, mesh.version)
        if key not in self._positions:
            still = not same_topology(mesh, other) or np.array_equal(other.positions, mesh.positions)
            self._positions[key] = mesh.positions if still else other.positions
        return self._positions[key]

    def _matched(self, batch: InstanceBatch) -> Float64Array:
        """The matrices; ids are looked for in the batch with the same key before all others of the same mesh."""
        matrices = batch.matrices.copy()
        missing = np.arange(batch.count)
        for other in sorted(self._batches.get(batch.mesh, ()), key=lambda other: other.key != batch.key):
            rows = matching_rows(batch.ids[missing], other.ids)
            found = rows >= 0
            matrices[missing[found]] = other.matrices[rows[found]]
            missing = missing[~found]
            if len(missing) == 0:
                break
        return matrices


def same_topology(first: Mesh, second: Mesh) -> bool:
    """Whether two meshes have as many vertices and the same triangles."""
    if len(first.positions) != len(second.positions):
        return False
    return first.triangles is second.triangles or np.array_equal(first.triangles, second.triangles)


def matching_rows(ids: Int64Array, among: Int64Array) -> Int64Array:
    """(N,) int64: for each of `ids` (N,) the row of `among` (M,) that holds it, −1 where none does.

    Ids that occur repeatedly match in their order; those that occur more often than in `among` match the first there.
    """
    if np.array_equal(ids, among):
        return np.arange(len(ids))
    if len(among) == 0:
        return np.full(len(ids), -1)
    order = np.argsort(among, kind="stable")
    ordered = among[order]
    first, end = np.searchsorted(ordered, ids), np.searchsorted(ordered, ids, side="right")
    nth = first + _occurrences(ids)
    place = np.minimum(np.where(nth < end, nth, first), len(among) - 1)
    return np.where(first < end, order[place], -1)


def _occurrences(ids: Int64Array) -> Int64Array:
    """(N,) int64: how often each id occurs before its own row."""
    order = np.argsort(ids, kind="stable")
    ordered = ids[order]
    ranks = np.arange(len(ids))
    starts = np.where(np.diff(ordered, prepend=ordered[:1] - 1) != 0, ranks, 0)
    occurrences = np.empty_like(ranks)
    occurrences[order] = ranks - np.maximum.accumulate(starts)
    return occurrences
