# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights as rows of a float texture that shaders read."""

from collections.abc import Sequence

import numpy as np

from ..scene import ALL_GROUPS, AreaShape, Light, LightKind, World
from ..scene.arrays import Float32Array, Float64Array
from .mesh_lights import MeshLight

TEXELS_PER_LIGHT = 7
TEXELS_PER_SAMPLE = 3
LIGHTS_PER_ROW = 256

KIND_CODES = {LightKind.POINT: 0, LightKind.SUN: 1, LightKind.SPOT: 2, LightKind.AREA: 3}
MESH_CODE = 4
WORLD_CODE = 5
_SHAPE_CODES = {AreaShape.RECTANGLE: 0, AreaShape.ELLIPSE: 1}
GREATEST_EMISSION = 1e30
"""Brighter lights would be infinite in float32 once they are near something."""

_NARROWEST_SOFT_EDGE = 1e-6
FULL_SPREAD = np.pi - 1e-4
"""Emission angle (rad) of area lights from which on they emit all around."""

WIDEST_SUN = 0.5 * np.pi - 1e-3
"""Half angle (rad) of the largest sun: half the sky, but for what would have no tangent."""

NARROWEST_HALF_SPREAD = 1e-3
"""Half of the narrowest emission angle (rad) that is kept, as in Cycles."""


def light_rows(lights: Sequence[Light], origin: Float64Array) -> Float32Array:
    """(L, 7, 4) float32: 7 texels a light, positions relative to the camera `origin` (3,).

    The texels of a light, as `lights.glsl` reads them:
    0 position, kind · 1 emission axis, radius (m; sun: half angle, rad) · 2 emission, cosine of the spot's half angle
    3 half x axis (m), soft width of the spot in cosines · 4 half y axis (m), shape
    5 diffuse factor, specular factor; area: spread slope T = tan h, spread norm T − h (0: emits all around);
      point, spot: whether it is a disk, 0 · 6 receiver groups, 16 bits each.
    """
    rows = np.zeros((len(lights), TEXELS_PER_LIGHT, 4), np.float32)
    for row, light in zip(rows, lights, strict=True):
        rotation = light.world_from_light[:3, :3]
        row[0] = (*(light.world_from_light[:3, 3] - origin), KIND_CODES[light.kind])
        half_angle = min(0.5 * light.angle, WIDEST_SUN)
        row[1] = (*-rotation[:, 2], half_angle if light.kind is LightKind.SUN else light.radius)
        row[2, :3] = np.minimum(light.emission, GREATEST_EMISSION)
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
        if light.kind is LightKind.AREA and light.spread < FULL_SPREAD:
            half = max(0.5 * light.spread, NARROWEST_HALF_SPREAD)
            row[5, 2:] = (np.tan(half), np.tan(half) - half)
        row[6] = _group_words(light.receiver_groups)
    return rows


def mesh_light_rows(lights: Sequence[MeshLight]) -> Float32Array:
    """(L, 7, 4) float32 of emissive surfaces: kind, emission, and their area in place of a radius.

    The texels 5.z and 5.w tell whether front and back shine.
    """
    rows = np.zeros((len(lights), TEXELS_PER_LIGHT, 4), np.float32)
    for row, light in zip(rows, lights, strict=True):
        row[0, 3], row[1, 3] = MESH_CODE, light.surface.area
        row[2, :3] = np.minimum(light.emission, GREATEST_EMISSION)
        row[5] = (1.0, 1.0, light.front, light.back)
        row[6] = _group_words(ALL_GROUPS)
    return rows


def world_rows(directions: Float64Array, weights: Float64Array, world: World) -> Float32Array:
    """(L, 7, 4) float32: the world as lights from `directions` (L, 3), each with irradiance `weights` (L, 3), W/m²."""
    rows = np.zeros((len(directions), TEXELS_PER_LIGHT, 4), np.float32)
    rows[:, 0, 3] = WORLD_CODE
    rows[:, 1, :3], rows[:, 2, :3] = -directions, weights
    rows[:, 5, 0], rows[:, 5, 1] = world.seen_by_diffuse, world.seen_by_glossy
    rows[:, 6] = _group_words(ALL_GROUPS)
    return rows


def as_texels(rows: Float32Array) -> Float32Array:
    """Rows (N, texels, 4) of lights or maps as an image (height, 256 · texels, 4), 256 a row, at least one row."""
    count, texels, _ = rows.shape
    height = max(-(-count // LIGHTS_PER_ROW), 1)
    image = np.zeros((height * LIGHTS_PER_ROW, texels, 4), np.float32)
    image[:count] = rows
    return image.reshape(height, LIGHTS_PER_ROW * texels, 4)


def _group_words(groups: int) -> tuple[float, ...]:
    """64 bits as four numbers that float32 holds exactly."""
    return tuple(float(groups >> shift & 0xFFFF) for shift in (0, 16, 32, 48))
