# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh's triangles in groups of neighbours, so that a view of a small part of it need not draw it all.

Pure: no OpenGL, no Blender.
"""

from dataclasses import dataclass

import numpy as np

from ..scene import Mesh
from ..scene.arrays import BoolArray, Float32Array, Float64Array, Int64Array, UInt32Array
from .frustum import boxes_inside

CLUSTER_TRIANGLES = 64

_AXIS_BITS = 10
_WIDEST_GAP = 1


@dataclass(frozen=True)
class Clusters:
    """The triangles of a mesh, sorted into clusters of neighbours within each slot.

    `triangles` (T, 3) uint32: those of the mesh, in the mesh's slots, in another order.
    `first` (C,): the first triangle of each cluster in ascending order; it ends where the next begins.
    `boxes` (C, 2, 3) float32: lowest and highest corner of each, object space.
    """

    triangles: UInt32Array
    first: Int64Array
    boxes: Float32Array


def cluster(mesh: Mesh) -> Clusters:
    """Sort a mesh's triangles along a Morton curve through their middles and cut it into clusters."""
    corners = mesh.positions[mesh.triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    codes = _morton_codes(low + high, 2.0 * mesh.bounds)
    order = np.argsort(codes | _slots(mesh) << 3 * _AXIS_BITS, kind="stable")
    firsts = [np.arange(slot.first, slot.first + slot.count, CLUSTER_TRIANGLES) for slot in mesh.slots]
    first = np.concatenate(firsts) if firsts else np.zeros(0, np.int64)
    if len(order) == 0:
        return Clusters(mesh.triangles, first, np.zeros((0, 2, 3), np.float32))
    boxes = [np.minimum.reduceat(low[order], first), np.maximum.reduceat(high[order], first)]
    return Clusters(mesh.triangles[order], first, np.stack(boxes, axis=1))


def _slots(mesh: Mesh) -> Int64Array:
    """(T,) the place of each triangle's slot among all."""
    return np.repeat(np.arange(len(mesh.slots)), [slot.count for slot in mesh.slots])


def _morton_codes(points: Float32Array, bounds: Float64Array) -> Int64Array:
    """(N,) the bits of the coordinates (N, 3) in turn, as shares of the longest side of bounds (2, 3)."""
    side = max(float((bounds[1] - bounds[0]).max()), np.finfo(np.float32).tiny)
    steps = ((points - bounds[0].astype(np.float32)) * np.float32((1 << _AXIS_BITS) / side)).astype(np.int64)
    x, y, z = (_spread(axis) for axis in np.clip(steps, 0, (1 << _AXIS_BITS) - 1).T)
    return x | y << 1 | z << 2


def _spread(values: Int64Array) -> Int64Array:
    """Ten bits with two empty ones between each."""
    for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
        values = (values | values << shift) & mask
    return values
