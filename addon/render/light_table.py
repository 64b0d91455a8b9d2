# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights as rows of a float texture that shaders read."""

import numpy as np

from ..scene import AreaShape, Light, LightKind
from ..scene.arrays import Float32Array, Float64Array

TEXELS_PER_LIGHT = 6
LIGHTS_PER_ROW = 256

KIND_CODES = {LightKind.POINT: 0, LightKind.SUN: 1, LightKind.SPOT: 2, LightKind.AREA: 3}
_SHAPE_CODES = {AreaShape.RECTANGLE: 0, AreaShape.ELLIPSE: 1}
_NARROWEST_SOFT_EDGE = 1e-6
_FULL_SPREAD = np.pi - 1e-4


def light_table(lights: tuple[Light, ...], origin: Float64Array) -> Float32Array:
    """(rows, 256 · 6, 4) float32: 256 lights a row, 6 texels a light, positions relative to the camera `origin` (3,).

    The texels of a light, as `lights.glsl` reads them:
    0 position, kind · 1 emission axis, radius (m; sun: half angle, rad) · 2 emission, cosine of the spot's half angle
    3 half x axis (m), soft width of the spot in cosines · 4 half y axis (m), shape
    5 diffuse factor, specular factor; area: spread slope T = tan h, spread norm T − h (0: emits all around);
      point, spot: whether it is a disk, 0.
    """
    rows = -(-len(lights) // LIGHTS_PER_ROW)
    table = np.zeros((rows * LIGHTS_PER_ROW, TEXELS_PER_LIGHT, 4), np.float32)
    for row, light in zip(table, lights, strict=False):
        rotation = light.world_from_light[:3, :3]
        row[0] = (*(light.world_from_light[:3, 3] - origin), KIND_CODES[light.kind])
        row[1] = (*-rotation[:, 2], 0.5 * light.angle if light.kind is LightKind.SUN else light.radius)
        row[2, :3] = light.emission
        if light.kind is LightKind.SPOT:
            cosine = np.cos(0.5 * light.angle)
            row[2, 3] = cosine
            row[3, 3] = max((1.0 - cosine) * light.blend, _NARROWEST_SOFT_EDGE)
        if light.kind is LightKind.AREA:
            row[3, :3] = 0.5 * light.size[0] * rotation[:, 0]
            row[4] = (*(0.5 * light.size[1] * rotation[:, 1]), _SHAPE_CODES[light.shape])
        row[5, :2] = (light.diffuse_factor, light.specular_factor)
        if light.kind in (LightKind.POINT, LightKind.SPOT):
            row[5, 2] = light.soft_falloff
        if light.kind is LightKind.AREA and light.spread < _FULL_SPREAD:
            half = max(0.5 * light.spread, 1e-3)
            row[5, 2:] = (np.tan(half), np.tan(half) - half)
    return table.reshape(rows, LIGHTS_PER_ROW * TEXELS_PER_LIGHT, 4)
