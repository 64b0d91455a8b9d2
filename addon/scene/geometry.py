# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangle meshes and where they are placed."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .arrays import Float32Array, Float64Array, Int32Array, Int64Array, UInt32Array


@dataclass(frozen=True)
class SlotRange:
    """The triangles of one material slot: rows `first` … `first + count - 1` of `Mesh.triangles`."""

    slot: int
    first: int
    count: int


@dataclass(frozen=True)
class Mesh:
    """An indexed triangle mesh in object space.

    `positions` (V, 3) float32, metres; finite.
    `normals` (V, 3) float32, unit length or zero where undefined (the shader falls back to the geometric normal).
    `uvs` (V, 2) float32 of the first UV map, or None. `colors` (V, 4) float32 scene-linear, or None.
    `triangles` (T, 3) uint32 rows of `positions`, counter-clockwise from the front, grouped by slot.
    `slots` ranges in ascending order that together cover `triangles`.
    `velocities` (V, 3) float32, metres per frame in object space, or None where nobody knows them.
    `version` differs whenever any array differs from that of an earlier mesh with the same `key`.
    """

    key: str
    name: str
    version: int
    positions: Float32Array
    normals: Float32Array
    triangles: UInt32Array
    slots: tuple[SlotRange, ...]
    uvs: Float32Array | None = None
    colors: Float32Array | None = None
    velocities: Float32Array | None = None

    @cached_property
    def bounds(self) -> Float64Array:
        """(2, 3) float64: lowest and highest corner of the box around `positions`; zero where there are none."""
        if len(self.positions) == 0:
            return np.zeros((2, 3))
        axes = self.positions.T  # one by one, which is several times faster than row by row
        return np.array([[axis.min() for axis in axes], [axis.max() for axis in axes]], np.float64)


@dataclass(frozen=True)
class InstanceBatch:
    """Placements of one mesh with one assignment of materials; drawn as one instanced draw per slot.

    `key` is stable across syncs and orders the draws, so that the picture does not depend on submission order.
    `materials` holds a key into `Scene.materials` per slot of the mesh (slot i uses `materials[min(i, last)]`).
    `matrices` (N, 4, 4) float64, row-major world-from-object, acting on column vectors.
    `object_index` (N,) int32: Blender's pass index.
    `ids` (N,) int64: which instance each row is, the same from frame to frame whatever other rows come or go;
    rows of two frames with equal `mesh` and id show the same thing at two times.
    `version` differs whenever any array differs from that of an earlier batch with the same `key`.
    `seen_by_camera`, `casts_shadow`: whether the instances are in the picture, and in front of lights.
    `link_group` 0…63: which bit of a light's groups stands for them; 0 where nothing is linked.
    """

    key: str
    mesh: str
    materials: tuple[str, ...]
    version: int
    matrices: Float64Array
    object_index: Int32Array
    ids: Int64Array
    seen_by_camera: bool = True
    casts_shadow: bool = True
    link_group: int = 0

    @property
    def count(self) -> int:
        """Number of instances."""
        return len(self.matrices)
