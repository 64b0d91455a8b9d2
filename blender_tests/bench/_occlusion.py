# SPDX-License-Identifier: GPL-3.0-or-later
"""A fixed occlusion estimate on layers that were read back: what a screen-space effect would make of them.

Ambient obscurance after McGuire et al. 2011, "The Alchemy Screen-Space Ambient Obscurance Algorithm", with the taps of
McGuire et al. 2012, "Scalable Ambient Obscurance", and on several layers after Mara et al. 2016: every tap takes the
layer that occludes most.
"""

import math

import numpy as np

from addon.scene import Camera
from addon.scene.arrays import Float32Array, Float64Array

RADIUS = 0.75
"""Metres."""
BIAS = 0.023
"""Metres."""
TAPS = 19
TURNS = 7
"""Of the spiral of taps."""
NEAREST_TAP = 0.75
"""Pixels."""
SMALLEST_DISK = 3.0
"""Pixels; a disk this small or smaller occludes nothing, one a pixel larger fully."""
STEP = 8
"""Every eighth pixel in x and y is estimated."""


def obscurance(depths: Float32Array, normals: Float32Array, camera: Camera) -> Float64Array:
    """Openness 0…1 of every `STEP`-th pixel: (h, w), NaN where nothing is seen.

    `depths` (n, H, W): view depth of the layers, +inf where empty. `normals` (H, W, 3): world-space, of layer 0.
    `camera`: perspective, that drew them.
    """
    _, height, width = depths.shape
    left, right, _, _ = camera.window
    ys, xs = np.mgrid[STEP // 2 : height : STEP, STEP // 2 : width : STEP]
    depth = depths[0, ys, xs]
    seen = np.isfinite(depth)
    ys, xs = ys[seen], xs[seen]
    here = _positions(xs, ys, depth[seen], camera, width, height)
    normal = normals[ys, xs].astype(np.float64) @ camera.rotation
    disk = RADIUS / -here[:, 2] * width / abs(right - left)
    spin = 10.0 * ((3 * xs) ^ (ys + xs * ys))
    total = np.zeros(len(xs))
    for tap in range(TAPS):
        fraction = (tap + 0.5) / TAPS
        angle = math.tau * fraction * TURNS + spin
        distance = np.maximum(fraction * disk, NEAREST_TAP)
        tap_x = np.floor(xs + 0.5 + distance * np.cos(angle)).astype(np.int64)
        tap_y = np.floor(ys + 0.5 + distance * np.sin(angle)).astype(np.int64)
        inside = (tap_x >= 0) & (tap_x < width) & (tap_y >= 0) & (tap_y < height)
        tap_x, tap_y = tap_x[inside], tap_y[inside]
        most = np.zeros(len(tap_x))
        for layer in depths:
            there = layer[tap_y, tap_x]
            offset = _positions(tap_x, tap_y, np.where(np.isfinite(there), there, 1e9), camera, width, height)
            most = np.maximum(most, _occlusion(offset - here[inside], normal[inside]))
        total[inside] += most
    open_share = np.maximum(0.0, 1.0 - np.sqrt(math.pi / TAPS * total))
    result = np.full(depth.shape, np.nan)
    result[seen] = 1.0 - np.clip(disk - SMALLEST_DISK, 0.0, 1.0) * (1.0 - open_share)
    return result


def _occlusion(offset: Float64Array, normal: Float64Array) -> Float64Array:
    """How much a point at `offset` (m, N × 3) from a surface with `normal` occludes it."""
    squared = np.sum(offset * offset, axis=-1)
    height = np.sum(offset * normal, axis=-1) - BIAS
    return np.maximum(0.0, 1.0 - squared / RADIUS**2) * np.maximum(0.0, height / np.sqrt(squared + 1e-3))


def _positions(
    x: np.ndarray, y: np.ndarray, depth: np.ndarray, camera: Camera, width: int, height: int
) -> Float64Array:
    """Camera-space positions (N, 3) of view depths at pixel centres."""
    left, right, bottom, top = camera.window
    z = depth.astype(np.float64)
    return np.stack(
        [(left + (x + 0.5) / width * (right - left)) * z, (bottom + (y + 0.5) / height * (top - bottom)) * z, -z],
        axis=-1,
    )
