# SPDX-License-Identifier: GPL-3.0-or-later
"""How much a sequence flickers: what changes from frame to frame though it is the same place of the same surface."""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from ..scene.arrays import Float32Array, Float64Array, Int64Array

HEADING = 1.0 / 8.0
"""Of the picture's longer side: so near to where the camera is heading, a surface that comes nearer is not followed."""

ROUNDING = 8.0 * float(np.finfo(np.float32).eps)
"""Relative difference of two depths of one point that float32 may make."""


def flicker(
    pictures: Iterable[Float32Array], depths: Iterable[Float32Array], motions: Iterable[Float32Array]
) -> float | None:
    """Root mean square change along the motion vectors, over channels, pixels and pairs of consecutive frames.

    `pictures` (H, W, 3): in display space. `depths` (H, W): view depth in metres, +inf where nothing is seen. `motions`
    (H, W, 2): pixels moved since the frame before, x right and y up; the first frame's is not read. Rows from the top.
    The warping error of Lai et al. 2018, "Learning Blind Video Temporal Consistency", with the engine's own motion.

    The frame before is sampled bilinearly where the pixel was. A pixel counts where all texels that are read lie on
    the picture and show the same surface:
      - No other surface of this frame was there, too, and nearer. What differs no more than the depth does within two
        pixels in x and in y (towards that neighbour along each axis which is nearer in depth) is the pixel's own.
      - Their depth is the pixel's own but for that and what a surface can come nearer since. One that comes nearer by a
        share s of its depth moves by s · r pixels, r pixels from where the camera heads: allowed is the s that this
        motion means an eighth of the picture from there. It tells what was hidden by things that are gone.

    None where no pixel counts. Raises ValueError where the frames differ in size or number.
    """
    frames = zip(pictures, depths, motions, strict=True)
    total, count = 0.0, 0
    for before, now in pairwise(frames):
        _check(before, now)
        squares, counted = _change(before, now)
        total, count = total + squares, count + counted
    return float(np.sqrt(total / count)) if count else None


Frame = tuple[Float32Array, Float32Array, Float32Array]
"""Picture, depth, motion."""


def _check(before: Frame, now: Frame) -> None:
    """Raise ValueError where two frames do not fit."""
    size = now[0].shape[:2]
    if {array.shape[:2] for array in (*before, *now)} != {size}:
        raise ValueError("the frames of a sequence, their depths and motion vectors must be of one size")


def _change(before: Frame, now: Frame) -> tuple[float, int]:
    """Sum of the squared changes of the pixels that count, and the number of their values."""
    picture, depth, motion = now
    height, width = depth.shape
    rows, columns = np.indices(depth.shape)
    x, y = columns - motion[..., 0].astype(np.float64), rows + motion[..., 1].astype(np.float64)
    seen = np.isfinite(depth) & (x >= 0.0) & (x <= width - 1) & (y >= 0.0) & (y <= height - 1)
    here, own = depth[seen], _own(depth)[seen]
    allowed = own + _nearer(depth, motion)[seen]
    texels = _texels(x[seen], y[seen], depth.shape)
    first = np.full(depth.shape, np.inf)
    for place, weight in texels:
        read = weight > 0.0
        np.minimum.at(first, tuple(axis[read] for axis in place), here[read])
    sampled = np.zeros((len(here), picture.shape[-1]))
    same = np.ones(len(here), bool)
    for place, weight in texels:
        sampled += weight[:, None] * before[0][place]
        fits = (first[place] >= here - own) & (np.abs(before[1][place] - here) <= allowed)
        same &= fits | (weight == 0.0)
    apart = (picture[seen] - sampled)[same]
    return float(np.sum(apart * apart)), apart.size


def _texels(
    x: Float64Array, y: Float64Array, shape: tuple[int, ...]
) -> list[tuple[tuple[Int64Array, Int64Array], Float64Array]]:
    """Row and column of the four texels about each place in a picture, and their bilinear weights."""
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    right, bottom = np.minimum(left + 1, shape[1] - 1), np.minimum(top + 1, shape[0] - 1)
    return [
        ((row, column), row_weight * column_weight)
        for row, row_weight in ((top, 1.0 - (y - top)), (bottom, y - top))
        for column, column_weight in ((left, 1.0 - (x - left)), (right, x - left))
    ]


def _own(depth: Float32Array) -> Float64Array:
    """By how much, in metres, depths of the pixel's own surface (H, W) differ as near as two pixels in x and in y."""
    there = np.where(np.isfinite(depth), depth, np.nan).astype(np.float64)
    return 2.0 * (_slope(there) + _slope(there.T).T) + ROUNDING * np.nan_to_num(there)


def _nearer(depth: Float32Array, motion: Float32Array) -> Float64Array:
    """How much, in metres, a pixel's surface can have come nearer or gone away (H, W)."""
    moved = np.hypot(*np.moveaxis(motion.astype(np.float64), -1, 0))
    return moved / (HEADING * max(depth.shape)) * np.where(np.isfinite(depth), depth, 0.0)


def _slope(depth: Float64Array) -> Float64Array:
    """Change of the depth (H, W) by one row, towards the neighbour that is nearer in depth; 0 where there is none."""
    steps = np.abs(np.diff(depth, axis=0, prepend=np.nan, append=np.nan))
    return np.nan_to_num(np.fmin(steps[:-1], steps[1:]), nan=0.0)
