# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions as texels of an equirectangular map, laid out as `EnvironmentMap` says."""

import numpy as np

from .arrays import Float32Array, Float64Array


def texel_directions(height: int, width: int, rows: slice = slice(None)) -> Float64Array:
    """(rows, width, 3) float64: the unit direction at the centre of each texel, of all rows or of some."""
    elevation = ((np.arange(height)[rows] + 0.5) / height - 0.5) * np.pi
    azimuth = (0.5 - (np.arange(width) + 0.5) / width) * 2.0 * np.pi
    directions = np.empty((len(elevation), width, 3))
    directions[..., 0] = np.cos(elevation)[:, None] * np.cos(azimuth)
    directions[..., 1] = np.cos(elevation)[:, None] * np.sin(azimuth)
    directions[..., 2] = np.sin(elevation)[:, None]
    return directions


def texel_solid_angles(height: int, width: int) -> Float64Array:
    """(height,) float64: the solid angle (sr) of one texel in each row; all texels together cover 4π."""
    edges = np.sin((np.arange(height + 1) / height - 0.5) * np.pi)
    return np.diff(edges) * (2.0 * np.pi / width)


def texel_coordinates(directions: Float64Array, height: int, width: int) -> tuple[Float64Array, Float64Array]:
    """(column, row), each (...) float64: where unit directions (..., 3) lie; whole numbers at the centres of texels."""
    azimuth = np.arctan2(directions[..., 1], directions[..., 0])
    elevation = np.arctan2(directions[..., 2], np.hypot(directions[..., 0], directions[..., 1]))
    return (0.5 - azimuth / (2.0 * np.pi)) * width - 0.5, (elevation / np.pi + 0.5) * height - 0.5


def look_up(pixels: Float32Array, directions: Float64Array) -> Float64Array:
    """(..., C) float64: a map's (H, W, C) radiance in unit directions (..., 3), interpolated bilinearly.

    Azimuth wraps around; beyond the centres of the first and last row their values continue to the poles.
    """
    height, width = pixels.shape[:2]
    column, row = texel_coordinates(directions, height, width)
    return interpolated(pixels, column, np.clip(row, 0.0, height - 1.0))


def interpolated(values: Float32Array | Float64Array, column: Float64Array, row: Float64Array) -> Float64Array:
    """(..., C) float64: the bilinear interpolation of `values` (H, W, C) at these places, which wraps both ways.

    Whole numbers are the centres of texels.
    """
    height, width = values.shape[:2]
    left, below = np.floor(column), np.floor(row)
    right_share, above_share = (column - left)[..., None], (row - below)[..., None]
    columns = left.astype(np.int64) % width, (left.astype(np.int64) + 1) % width
    rows = below.astype(np.int64) % height, (below.astype(np.int64) + 1) % height
    lower, upper = (values[at, columns[0]] * (1.0 - right_share) + values[at, columns[1]] * right_share for at in rows)
    return lower * (1.0 - above_share) + upper * above_share


def box_sums(values: Float32Array | Float64Array, edges: Float64Array) -> Float64Array:
    """(..., n) float64: sums of `values` (..., m) over stretches between successive `edges` (n + 1,), in entries.

    Entries are spread evenly over their place; parts of them count in part.
    """
    count = values.shape[-1]
    whole = np.minimum(edges.astype(np.int64), count - 1)
    before = np.zeros((*values.shape[:-1], count + 1))
    np.cumsum(values, axis=-1, out=before[..., 1:])
    return np.diff(before[..., whole] + values[..., whole] * (edges - whole), axis=-1)


def coarsened(pixels: Float32Array, height: int, width: int) -> Float32Array:
    """(H / k, W / k, C) float32: means over the solid angle of k × k texels of a map (H, W, C).

    k is the largest number that divides both sizes and leaves at least `height` × `width` texels; 1 leaves the map as
    it is.
    """
    rows, columns = pixels.shape[:2]
    fitting = range(1, max(min(rows // height, columns // width), 1) + 1)
    factor = max(k for k in fitting if rows % k == 0 and columns % k == 0)
    if factor == 1:
        return pixels
    weights = texel_solid_angles(rows, 1).reshape(-1, factor)
    weights = (weights / weights.sum(axis=1, keepdims=True) / factor).astype(np.float32)
    means = np.zeros((rows // factor, columns // factor, pixels.shape[2]), np.float32)
    for row in range(factor):
        for column in range(factor):
            means += pixels[row::factor, column::factor] * weights[:, row, None, None]
    return means
