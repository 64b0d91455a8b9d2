# SPDX-License-Identifier: GPL-3.0-or-later
"""How far things move on screen between two frames, without drawing them."""

import math
from dataclasses import dataclass

import numpy as np

from .arrays import BoolArray, Float32Array, Float64Array
from .camera import Camera
from .correspondence import Correspondence
from .geometry import InstanceBatch, Mesh
from .sequence import Moment

LARGEST_DRIFT = 1.0
"""Pixels; beyond them nobody asks how far exactly."""


def pixel_drift(first: Moment, second: Moment, width: int, height: int) -> float:
    """A bound, in pixels, on how far anything that is seen in `second` is on screen from where it was in `first`.

    What only casts shadows is not seen. `width`, `height`: pixels of the picture that both cameras' windows show.
    Bounds hold per instance, for its bounding box, so they may be several times too large, but they vanish with the
    motion that causes them and are 0.0 where nothing moved at all. Never more than `LARGEST_DRIFT`, which is also the
    answer where one of the cameras is orthographic and the other is not.
    """
    if first.camera.orthographic != second.camera.orthographic:
        return LARGEST_DRIFT
    views = _Views(first.camera, second.camera, width, height)
    drift = math.hypot(*views.window_drift)
    correspondence = Correspondence(first.scene)
    meshes = second.scene.meshes
    seen = [batch for batch in second.scene.batches if batch.seen_by_camera]
    drawn = {batch.mesh for batch in seen}
    deformations = {key: _deformation(meshes[key], correspondence.positions(meshes[key])) for key in drawn}
    for batch in seen:
        if drift >= LARGEST_DRIFT:
            break
        moved = _moved(batch, correspondence.matrices(batch), meshes[batch.mesh], deformations[batch.mesh])
        drift = max(drift, views.drift(moved))
    return min(drift, LARGEST_DRIFT)


@dataclass(frozen=True)
class _Moved:
    """N instances of one mesh: matrices (N, 4, 4) then and now, and which of them (N,) are the same in both.

    `bounds` (2, 3) of the mesh now. `deformation` (3,): how far its vertices are at most from where they were.
    """

    before: Float64Array
    now: Float64Array
    same: BoolArray
    bounds: Float64Array
    deformation: Float64Array


def _moved(batch: InstanceBatch, before: Float64Array, mesh: Mesh, deformation: Float64Array) -> _Moved:
    same = np.ones(batch.count, np.bool_)
    if before is not batch.matrices:
        same = np.asarray((before == batch.matrices).all(axis=(1, 2)))
    return _Moved(before, batch.matrices, same, mesh.bounds, deformation)


def _deformation(mesh: Mesh, before: Float32Array) -> Float64Array:
    """(3,) how far the mesh's vertices are at most from `before`, along each axis of object space."""
    if before is mesh.positions:
        return np.zeros(3)
    return np.array(
        [np.abs(now - then).max() for now, then in zip(mesh.positions.T, before.T, strict=True)], np.float64
    )


class _Views:
    """Two cameras of one picture."""

    def __init__(self, first: Camera, second: Camera, width: int, height: int) -> None:
        self._first, self._second = first, second
        before, now = np.reshape(first.window, (2, 2)), np.reshape(second.window, (2, 2))
        self._pixels = np.array([width, height]) / np.abs(before[:, 1] - before[:, 0])
        self._reach = np.abs(now).max(axis=1)
        self.window_drift: Float64Array = np.abs(now - before).max(axis=1) * self._pixels
        self._same_pose = np.array_equal(first.world_from_camera, second.world_from_camera)
        self._turn, self._shift = self._camera_motion()

    def drift(self, moved: _Moved) -> float:
        """The bound for some instances, pixels; infinite where one may have come through the camera's plane."""
        if self._same_pose and not moved.deformation.any():
            moving = ~moved.same
            moved = _Moved(moved.before[moving], moved.now[moving], moved.same[moving], moved.bounds, moved.deformation)
        if len(moved.now) == 0:
            return 0.0
        before, now = _seen(self._first, moved.before), _seen(self._second, moved.now)
        visible, nearest = self._visible(now, moved.bounds)
        bent = np.abs(before[:, :, :3]) @ moved.deformation
        low, high = _range(now - before, moved.bounds)
        motion = np.maximum(np.abs(low), np.abs(high)) + bent
        if self._second.orthographic:
            shift = motion[:2]
        else:
            ratio = motion / nearest
            still = self._turn[:, None] + (self._shift[:, None] + bent) / nearest
            ratio = np.where(moved.same, np.minimum(ratio, still), ratio)
            shift = self._across(ratio)
        pixels = np.hypot(*(shift * self._pixels[:, None] + self.window_drift[:, None]))
        return float(np.where(visible, pixels, 0.0).max())

    def _across(self, ratio: Float64Array) -> Float64Array:
        """(2, N) how far points move in the image plane at depth 1, from how far they move (3, N) per view depth.

        A point at (x, y, −z) that was at (x − u, y − v, −z + w) has moved by (u − x·w/z) / (z − w) across the plane,
        infinitely far where w may be z or more.
        """
        with np.errstate(divide="ignore"):
            return (ratio[:2] + self._reach[:, None] * ratio[2]) / np.maximum(1.0 - ratio[2], 0.0)

    def _camera_motion(self) -> tuple[Float64Array, Float64Array]:
        """How far a point that stands still moves in camera space, per axis: at most turn · depth + shift."""
        rotation = np.zeros((3, 3))
        if not np.array_equal(self._first.rotation, self._second.rotation):
            rotation = np.eye(3) - self._first.rotation.T @ self._second.rotation
        left, right, bottom, top = self._second.window
        rays = np.array([(x, y, -1.0) for x in (left, right) for y in (bottom, top)])
        shift = self._first.rotation.T @ (self._second.position - self._first.position)
        return np.abs(rotation @ rays.T).max(axis=1), np.abs(shift)

    def _visible(self, now: Float64Array, bounds: Float64Array) -> tuple[BoolArray, Float64Array]:
        """(N,) whose box reaches into the second camera's view, and the depth (m) at which it begins there."""
        camera = self._second
        x, y, z = now
        depth_low, depth_high = _range(-z, bounds)
        visible = (depth_high >= camera.clip_start) & (depth_low <= camera.clip_end)
        # The plane through each edge of the window: at depth 1 in perspective, everywhere in an orthographic view.
        scale = np.zeros_like(z) if camera.orthographic else -z
        scale[:, 3] += 1.0 if camera.orthographic else 0.0
        left, right, bottom, top = camera.window
        for axis, first, last in ((x, left, right), (y, bottom, top)):
            visible &= _range(axis - min(first, last) * scale, bounds)[1] >= 0.0
            visible &= _range(max(first, last) * scale - axis, bounds)[1] >= 0.0
        return visible, np.maximum(depth_low, camera.clip_start)


def _seen(camera: Camera, matrices: Float64Array) -> Float64Array:
    """(3, N, 4) camera-from-object rows of (N, 4, 4) matrices; positions are subtracted before they are rotated."""
    relative = matrices[:, :3, :].copy()
    relative[:, :, 3] -= camera.position
    return np.tensordot(camera.rotation.T, relative, axes=(1, 1))


def _range(rows: Float64Array, bounds: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Lowest and highest value (…) that affine functions (…, 4) take in a box (2, 3)."""
    middle = rows[..., :3] @ (0.5 * (bounds[0] + bounds[1])) + rows[..., 3]
    extent = np.abs(rows[..., :3]) @ (0.5 * (bounds[1] - bounds[0]))
    return middle - extent, middle + extent
