# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh's triangles in groups of neighbours, so that a view of a small part of it need not draw it all.

Pure: no OpenGL, no Blender.
"""

from dataclasses import dataclass

import numpy as np

from ..scene import Mesh
from ..scene.arrays import BoolArray, Float32Array, Float64Array, Int64Array, UInt32Array

CLUSTER_TRIANGLES = 64
"""The most that a cluster has."""

_AXIS_BITS = 10
_INDEX_BITS = 32


@dataclass(frozen=True)
class Clusters:
    """The triangles of a mesh, sorted into clusters of neighbours within each slot.

    `triangles` (T, 3) uint32: those of the mesh, in the mesh's slots, in another order.
    `first` (C,), `count` (C,): the triangles of each cluster, one after the other.
    `boxes` (C, 2, 3) float32: lowest and highest corner of each, object space.
    """

    triangles: UInt32Array
    first: Int64Array
    count: Int64Array
    boxes: Float32Array


def cluster(mesh: Mesh) -> Clusters:
    """Sort a mesh's triangles along a Morton curve through their middles and cut it into clusters.

    They are the largest cells of an octree that hold few enough: their boxes overlap far less than those of equal
    stretches of the curve, and as little as those of a binary tree by the surface area heuristic.
    """
    low, high = _triangle_boxes(mesh)
    codes = _morton_codes(low + high, 2.0 * mesh.bounds)
    orders, firsts = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for slot in mesh.slots:
        # The index in the lowest bits makes equal codes differ: any sort gives the same order.
        keys = np.sort(codes[slot.first : slot.first + slot.count] << _INDEX_BITS | np.arange(slot.count))
        orders.append(slot.first + (keys & (1 << _INDEX_BITS) - 1))
        firsts.append(slot.first + _cuts(keys >> _INDEX_BITS))
    order, first = np.concatenate(orders), np.concatenate(firsts)
    count = np.diff(first, append=len(order))
    if len(order) == 0:
        return Clusters(mesh.triangles, first, count, np.zeros((0, 2, 3), np.float32))
    boxes = [np.minimum.reduceat(low[order], first), np.maximum.reduceat(high[order], first)]
    return Clusters(mesh.triangles[order], first, count, np.stack(boxes, axis=1))


def placed_boxes(boxes: Float32Array, world_from_object: Float64Array) -> Float64Array:
    """(C, 2, 3) float64, world space: boxes about boxes (C, 2, 3) of an object that is placed by a matrix (4, 4)."""
    linear = world_from_object[:3, :3]
    middles = boxes.mean(axis=1, dtype=np.float64) @ linear.T + world_from_object[:3, 3]
    extents = 0.5 * (boxes[:, 1].astype(np.float64) - boxes[:, 0]) @ np.abs(linear).T
    return np.stack([middles - extents, middles + extents], axis=1)


def runs(chosen: BoolArray, owner: Int64Array, first: Int64Array, count: Int64Array) -> list[tuple[int, int, int]]:
    """(owner, first, count) of the stretches of what is chosen (N,): of the same owner, each beginning where the one
    before ends."""
    at = np.flatnonzero(chosen)
    if len(at) == 0:
        return []
    owners, starts, ends = owner[at], first[at], first[at] + count[at]
    begins = np.append(True, (starts[1:] != ends[:-1]) | (owners[1:] != owners[:-1]))
    closes = np.append(begins[1:], True)
    starts = starts[begins]
    return list(zip(owners[begins].tolist(), starts.tolist(), (ends[closes] - starts).tolist(), strict=True))


def _triangle_boxes(mesh: Mesh) -> tuple[Float32Array, Float32Array]:
    """Lowest and highest corner (T, 3) of each triangle."""
    a, b, c = (mesh.positions[corner] for corner in mesh.triangles.T)
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _morton_codes(points: Float32Array, bounds: Float64Array) -> Int64Array:
    """(N,) the bits of the coordinates (N, 3) in turn, as shares of the longest side of bounds (2, 3)."""
    side = max(float((bounds[1] - bounds[0]).max()), 1e-30)
    codes = np.zeros(len(points), np.int64)
    for axis in range(3):
        share = (points[:, axis] - np.float32(bounds[0, axis])) * np.float32((1 << _AXIS_BITS) / side)
        codes |= _spread(np.clip(share, 0.0, (1 << _AXIS_BITS) - 1).astype(np.int64)) << axis
    return codes


def _spread(values: Int64Array) -> Int64Array:
    """Ten bits with two empty ones between each."""
    for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
        values = (values | values << shift) & mask
    return values


def _cuts(codes: Int64Array) -> Int64Array:
    """(C,) where clusters begin among ascending Morton codes (N,): where cells do, and inside of the smallest cells."""
    differing = np.frexp((codes[1:] ^ codes[:-1]).astype(np.float64))[1].astype(np.int8)  # bits up to the highest
    starts = np.zeros(min(len(codes), 1), np.int64)
    for level in range(3 * _AXIS_BITS, 0, -1):
        large = np.diff(starts, append=len(codes)) > CLUSTER_TRIANGLES
        if not large.any():
            return starts
        borders = np.flatnonzero(differing == level) + 1
        starts = np.sort(np.append(starts, borders[large[np.searchsorted(starts, borders, side="right") - 1]]))
    pieces = -(-np.diff(starts, append=len(codes)) // CLUSTER_TRIANGLES)
    piece = np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    return np.repeat(starts, pieces) + CLUSTER_TRIANGLES * piece
