# SPDX-License-Identifier: GPL-3.0-or-later
"""How far lights reach where there are many, and which reach nothing that is seen. Pure: no OpenGL, no Blender.

Up to its full reach R0 a light is always there; farther out, where it is fainter than a threshold, with probability
p(d) = (R0/d)² and 1/p times as bright: Russian roulette (Arvo and Kirk 1990, "Particle Transport and Image Synthesis"),
as Cycles' light threshold. A number ξ is drawn for a light and all pixels: it is there where d < R0/√ξ.
"""

from collections.abc import Sequence
from math import hypot, inf, pi, tan
from zlib import crc32

import numpy as np

from ..scene import AreaShape, Camera, Light, LightKind, Scene
from ..scene.arrays import Float64Array, Int64Array
from .frustum import boxes_inside, boxes_near, frustum_planes, scene_boxes
from .light_table import FULL_SPREAD, NARROWEST_HALF_SPREAD
from .memory import Memory

MANY_LIGHTS = 16
"""With more lights than these, each is only there where it reaches, and pixels only ask those that reach their tile."""

_RANGE = 2**32
_LIGHT_STEP = 0x9E3779B9
"""2³² times the golden ratio's fraction, which spreads similar keys (Knuth, The Art of Computer Programming, 6.4)."""
_DRAW_STEP = 0x6A09E667
"""2³² times the fraction of √2, which no other sampling pattern steps by: draws share out the numbers of one light."""


def peak_intensity(light: Light) -> float:
    """Radiant intensity (W/sr) that no direction exceeds, of the strongest channel and factor; inf of a sun."""
    strongest = max(light.emission) * max(light.diffuse_factor, light.specular_factor)
    if light.kind is LightKind.SUN:
        return inf if strongest > 0.0 else 0.0
    if light.kind is not LightKind.AREA:
        return strongest
    area = light.size[0] * light.size[1] * (0.25 * pi if light.shape is AreaShape.ELLIPSE else 1.0)
    if light.spread >= FULL_SPREAD:
        return strongest * area
    half = max(0.5 * light.spread, NARROWEST_HALF_SPREAD)
    return strongest * area * tan(half) / (tan(half) - half)


def extent(light: Light) -> float:
    """Distance (m) from the middle of a light to its farthest point."""
    if light.kind is LightKind.AREA:
        return 0.5 * (max(light.size) if light.shape is AreaShape.ELLIPSE else hypot(*light.size))
    return light.radius


def full_reach(intensities: Float64Array, extents: Float64Array, threshold: float) -> Float64Array:
    """(L,) R0 in m: beyond it from its middle no light makes a white diffuse surface as bright as `threshold`.

    `intensities` (L,) W/sr, `extents` (L,) m, `threshold` W/(sr·m²): E/π with E ≤ I/d² of the nearest point.
    inf where there are at most `MANY_LIGHTS` or the threshold is 0; 0 where a light is off.
    """
    if threshold <= 0.0 or len(intensities) <= MANY_LIGHTS:
        return np.where(intensities > 0.0, inf, 0.0)
    return np.where(intensities > 0.0, extents + np.sqrt(intensities / (pi * threshold)), 0.0)


def roulette(keys: Sequence[str], draws: Int64Array, seed: int) -> Float64Array:
    """(L,) ξ in (0, 1] of the lights with these keys, each for the draw with its number in `draws` (L,).

    Even over successive draws of each light, whatever others do.
    """
    return _share(_light_steps(keys, seed) + _draw_steps(draws))


def sampled_reach(full: Float64Array, xi: Float64Array) -> Float64Array:
    """(L,) m: how far lights reach that reach `full` (L,) at the least, where roulette drew `xi` (L,)."""
    return full / np.sqrt(xi)


def rounded_reach(full: Float64Array, reach: Float64Array) -> Float64Array:
    """(L,) m: the least power of two times the full reach that `reach` (L,) does not exceed: a few values per light,
    so that what was drawn for one sample serves others."""
    with np.errstate(invalid="ignore"):
        steps = np.ceil(np.log2(np.where(full > 0.0, reach, 1.0) / np.where(full > 0.0, full, 1.0)))
    return full * 2.0 ** np.nan_to_num(steps)


def farthest_reach(full: Float64Array, keys: Sequence[str], draws: int, seed: int) -> Float64Array:
    """(L,) m: how far each light reaches at most in its first `draws` draws."""
    lights, steps = _light_steps(keys, seed), np.sort(_draw_steps(np.arange(draws)))
    # The smallest sum modulo 2³² is that of the first step that wraps around, or of none.
    wrapping = np.searchsorted(steps, _RANGE - lights)
    smallest = lights + np.append(steps, 0)[wrapping]
    return sampled_reach(full, _share(smallest))


def lights_out_of_reach(
    lights: Sequence[Light], farthest: Float64Array, scene: Scene, camera: Camera, memory: Memory
) -> list[tuple[int, str]]:
    """Which lights no surface in the picture can show, and why: their indices in ascending order, each with the reason.

    `farthest` (L,) m from `farthest_reach`, `camera` guard band included.
    """
    planes = frustum_planes(camera)
    seen = np.zeros((0, 2, 3))
    if np.isfinite(farthest).any():
        boxes = memory.recall("boxes", (scene,), lambda: scene_boxes(scene))
        seen = boxes[boxes_inside(boxes, planes)]
    groups = 0
    for batch in scene.batches:
        groups |= 1 << batch.link_group
    reasons = (_reason(light, reach, groups, seen, planes) for light, reach in zip(lights, farthest, strict=True))
    return [(index, reason) for index, reason in enumerate(reasons) if reason]


def _reason(light: Light, reach: float, groups: int, seen: Float64Array, planes: Float64Array) -> str:
    """Why nothing in the picture shows a light; empty where something may. `seen`: boxes within the planes."""
    if peak_intensity(light) <= 0.0:
        return "it is off: no power, or no influence on diffuse and glossy surfaces"
    if not light.receiver_groups & groups:
        return "it is linked to nothing that is there"
    if np.isinf(reach):
        return ""
    center = light.world_from_light[:3, 3]
    in_view = (planes[:, :3] @ center + planes[:, 3] >= -reach).all()
    if in_view and boxes_near(seen, center, reach).any():
        return ""
    return f"it is out of reach: beyond {reach:.3g} m it is fainter than the threshold"


def _share(steps: Int64Array) -> Float64Array:
    return (steps % _RANGE + 1) / _RANGE


def _light_steps(keys: Sequence[str], seed: int) -> Int64Array:
    start = int(np.random.default_rng(seed).integers(_RANGE)) if seed else 0
    return np.array([(start + _LIGHT_STEP * crc32(key.encode())) % _RANGE for key in keys], np.int64)


def _draw_steps(draws: Int64Array) -> Int64Array:
    return _DRAW_STEP * draws % _RANGE
