# SPDX-License-Identifier: GPL-3.0-or-later
"""What a camera can see, as half spaces: tests of boxes and balls that never lose any that is seen."""

import numpy as np

from ..scene import Camera, Scene
from ..scene.arrays import BoolArray, Float64Array


def frustum_planes(camera: Camera) -> Float64Array:
    """(6, 4) float64, world space, unit normals: x is inside where n·x + w ≥ 0 for all of left, right, bottom, top,
    near and far; `planes @ world_from_object` are the same in an object's space, their normals of any length."""
    left, right, bottom, top = camera.window
    (left, right), (bottom, top) = sorted((left, right)), sorted((bottom, top))
    rows = np.zeros((6, 4))
    if camera.orthographic:
        rows[:4] = [(1, 0, 0, -left), (-1, 0, 0, right), (0, 1, 0, -bottom), (0, -1, 0, top)]
    else:
        rows[:4] = [(1, 0, left, 0), (-1, 0, -right, 0), (0, 1, bottom, 0), (0, -1, -top, 0)]
    rows[4:] = [(0, 0, -1, -camera.clip_start), (0, 0, 1, camera.clip_end)]
    rows /= np.linalg.norm(rows[:, :3], axis=1, keepdims=True)
    normals = rows[:, :3] @ camera.rotation.T
    return np.column_stack([normals, rows[:, 3] - normals @ camera.position])


def boxes_inside(boxes: Float64Array, planes: Float64Array) -> BoolArray:
    """(N,) which boxes (N, 2, 3), lowest and highest corners, reach into all half spaces (P, 4).

    One that is outside but beyond no single plane counts as inside.
    """
    normals, offsets = planes[:, :3], planes[:, 3]
    middles, extents = 0.5 * (boxes[:, 0] + boxes[:, 1]), 0.5 * (boxes[:, 1] - boxes[:, 0])
    return np.all(middles @ normals.T + extents @ np.abs(normals).T + offsets >= 0.0, axis=1)


def boxes_near(boxes: Float64Array, center: Float64Array, radius: float) -> BoolArray:
    """(N,) which boxes (N, 2, 3) come within `radius` of a point (3,)."""
    outside = np.maximum(np.maximum(boxes[:, 0] - center, center - boxes[:, 1]), 0.0)
    return (outside**2).sum(axis=1) <= radius**2


def scene_boxes(scene: Scene, most: int = 256) -> Float64Array:
    """(N, 2, 3) float64, world space: boxes around all instances, those of successive ones united to about `most`."""
    placed: list[Float64Array] = []
    for batch in scene.batches:
        low, high = scene.meshes[batch.mesh].bounds
        linear = batch.matrices[:, :3, :3]
        middles = linear @ (0.5 * (low + high)) + batch.matrices[:, :3, 3]
        extents = np.abs(linear) @ (0.5 * (high - low))
        placed.append(np.stack([middles - extents, middles + extents], axis=1))
    total = sum(len(boxes) for boxes in placed)
    united = [_united(boxes, -(-total // most)) for boxes in placed if len(boxes)]
    return np.concatenate(united) if united else np.zeros((0, 2, 3))


def _united(boxes: Float64Array, successive: int) -> Float64Array:
    starts = np.arange(0, len(boxes), successive)
    low, high = np.minimum.reduceat(boxes[:, 0], starts), np.maximum.reduceat(boxes[:, 1], starts)
    return np.stack([low, high], axis=1)
