# SPDX-License-Identifier: GPL-3.0-or-later
"""What the camera sees, as boxes that shadow maps are fitted to."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..scene import Camera
from ..scene.arrays import BoolArray, Float32Array, Float64Array

MOST_TILES = 1024
"""More tiles than this are merged by fours: fitting maps to them takes time for every light."""

FACE_AXES = np.array([sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]) + 0.0
"""(6, 3) the directions of a cube's faces: +X, −X, +Y, −Y, +Z, −Z."""

FACE_SIDES = np.array([[axis, *(axis + side for side in FACE_AXES if axis @ side == 0.0)] for axis in FACE_AXES])
"""(6, 5, 3) normals of the half spaces whose intersection is what a cube's face shows: ahead of it, and its sides."""

SIDES, SIDE_OF_FACE = np.unique(FACE_SIDES.reshape(-1, 3), axis=0, return_inverse=True)
SIDE_OF_FACE = SIDE_OF_FACE.reshape(6, 5)
"""(18, 3) the different ones of them, and (6, 5) which of these they are."""

_DEPTH_MARGIN = 0.01
"""Share of its view depth by which a tile is grown: sub-pixel jitter shows a little more than pixel centres do."""


@dataclass(frozen=True)
class Receivers:
    """Tiles of the picture with the view depths they show, as pieces of the view frustum.

    `origins`, `rays` (P, 4, 3) float64: world space; the corners at view depth z are origins + z · rays.
    `near`, `far` (P,): view depths, m. `pixel_slope`, `pixel_size`: a pixel covers pixel_size + z · pixel_slope metres.
    """

    origins: Float64Array
    rays: Float64Array
    near: Float64Array
    far: Float64Array
    pixel_slope: float
    pixel_size: float

    @property
    def count(self) -> int:
        """Number of tiles that show anything."""
        return len(self.near)

    @property
    def pixels(self) -> Float64Array:
        """(P,) metres that a pixel covers at each tile's nearest."""
        return self.pixel_size + self.near * self.pixel_slope

    @cached_property
    def corners(self) -> Float64Array:
        """(P, 8, 3) world space."""
        near = self.origins + self.near[:, None, None] * self.rays
        return np.concatenate([near, self.origins + self.far[:, None, None] * self.rays], axis=1)

    @cached_property
    def balls(self) -> tuple[Float64Array, Float64Array]:
        """Centres (P, 3) in world space and radii (P,) of balls that hold the tiles."""
        center = self.corners.mean(axis=1)
        return center, np.linalg.norm(self.corners - center[:, None], axis=-1).max(axis=1, initial=0.0)

    @cached_property
    def ends(self) -> Float64Array:
        """(18, P) how far each tile reaches along `FACE_SIDES`, those that are there twice as one: `SIDE_OF_FACE`."""
        return np.ascontiguousarray((self.corners @ SIDES.T).max(axis=1, initial=-np.inf).T)

    def between(self, start: float, end: float) -> "Receivers":
        """What of them is within a range of view depths, m."""
        kept = (self.far >= start) & (self.near <= end)
        return self._part(kept, np.maximum(self.near[kept], start), np.minimum(self.far[kept], end))

    def _part(self, kept: BoolArray, near: Float64Array, far: Float64Array) -> "Receivers":
        return Receivers(self.origins[kept], self.rays[kept], near, far, self.pixel_slope, self.pixel_size)


def visible_receivers(
    tiles: Float32Array, tile_size: int, camera: Camera, size: tuple[int, int], margin: float
) -> Receivers:
    """What `tiles` (layers, h, w, 2), each its nearest and farthest view depth, say of a picture of `size` pixels.

    `camera` sees the whole picture. `margin` (pixels) by which tiles are grown for jitter.
    """
    while tiles.shape[0] * tiles.shape[1] * tiles.shape[2] > MOST_TILES:
        tiles, tile_size = _merged(tiles), 2 * tile_size
    layers, rows, columns, _ = tiles.shape
    left, right, bottom, top = camera.window
    pixel = np.array([(right - left) / size[0], (top - bottom) / size[1]])
    x = left + pixel[0] * (np.array([-margin, tile_size + margin]) + tile_size * np.arange(columns)[:, None])
    y = bottom + pixel[1] * (np.array([-margin, tile_size + margin]) + tile_size * np.arange(rows)[:, None])
    corner_x = np.broadcast_to(x[None, :, [0, 1, 1, 0]], (rows, columns, 4))
    corner_y = np.broadcast_to(y[:, None, [0, 0, 1, 1]], (rows, columns, 4))
    flat = np.stack([corner_x, corner_y, np.zeros_like(corner_x)], axis=-1) @ camera.rotation.T
    forward = -camera.rotation[:, 2]
    if camera.orthographic:
        origins, rays = camera.position + flat, np.broadcast_to(forward, flat.shape)
    else:
        origins, rays = np.broadcast_to(camera.position, flat.shape), flat + forward
    depths = tiles.astype(np.float64)
    shown = np.isfinite(depths[..., 0])
    near = depths[..., 0][shown] * (1.0 - _DEPTH_MARGIN)
    far = depths[..., 1][shown] * (1.0 + _DEPTH_MARGIN)
    footprint = float(np.abs(pixel).max())
    return Receivers(
        np.broadcast_to(origins, (layers, *origins.shape))[shown],
        np.broadcast_to(rays, (layers, *rays.shape))[shown],
        near,
        far,
        pixel_slope=0.0 if camera.orthographic else footprint,
        pixel_size=footprint if camera.orthographic else 0.0,
    )


def _merged(tiles: Float32Array) -> Float32Array:
    """Tiles twice as wide and high."""
    layers, rows, columns, _ = tiles.shape
    even = np.empty((layers, rows + rows % 2, columns + columns % 2, 2), np.float32)
    even[:] = (np.inf, -np.inf)
    even[:, :rows, :columns] = tiles
    fours = even.reshape(layers, even.shape[1] // 2, 2, even.shape[2] // 2, 2, 2)
    return np.stack([fours[..., 0].min(axis=(2, 4)), fours[..., 1].max(axis=(2, 4))], axis=-1)
