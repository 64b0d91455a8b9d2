# SPDX-License-Identifier: GPL-3.0-or-later
"""Which point of every light a sample of the film uses: the same for all pixels, so that its shadow can be drawn."""

from collections.abc import Sequence
from functools import lru_cache
from math import gcd
from zlib import crc32

import numpy as np

from ..scene.arrays import Float64Array, Int64Array

_RATIOS = (0.6180339887498949, 0.7548776662466927)
"""Golden ratios (of the plane's lattice and of space's): steps along an axis that fill it evenly, however many."""

_STRETCH = 17
"""Successive points that are spread evenly along every axis, whatever their number, are fewer than this."""

_MOST_STEPS = 512
"""How many orders of a pattern's points are tried."""

_MOST_SHIFTS = 4096
"""How many lights' shifts are remembered."""

_BALL_TABLE_SIZE = 4097


def points_used(light_count: int, samples: int, updates: int) -> int:
    """How many points of each of `light_count` lights `samples` samples use, `updates` of them a new one per sample."""
    return max(-(-(samples - 1) * min(updates, light_count) // max(light_count, 1)), 0) + 1


def held_points(light_count: int, sample: int, updates: int) -> Int64Array:
    """(L,) which of its points each light uses in a sample: 0 in the first, then `updates` lights go on per sample.

    All do where there are no more than that. In turn: whatever the numbers, no light falls behind by more than one.
    """
    if light_count <= updates:
        return np.full(light_count, sample, np.int64)
    return (sample * updates - 1 - np.arange(light_count)) // light_count + 1


def lattice_points(indices: Int64Array, count: int, shifts: Float64Array) -> Float64Array:
    """Points (N, 3) in [0, 1) with numbers `indices` (N,) of a rank-1 lattice of `count` points, each shifted (N, 3).

    Sloan and Joe 1994, "Lattice Methods for Multiple Integration". Any stretch of successive numbers is spread evenly,
    too: a film that is shown or stopped early is as even as it can be.
    """
    return np.modf(np.outer(indices % count, _generators(count)) / count + shifts)[0]


@lru_cache(maxsize=64)
def _generators(count: int) -> tuple[int, int, int]:
    """The lattice's steps along each axis, in parts of `count`.

    The first only orders the same lattice's points: that order is taken in which points that follow one another are
    far from one another along every axis.
    """
    second, third = (_coprime(count, ratio) for ratio in _RATIOS)
    steps = _possible_steps(count)
    multiples = np.arange(1, max(min(count, _STRETCH), 2))
    turns = np.multiply.outer(np.outer(steps, (1, second, third)) % count, multiples) % count / count
    evenness = multiples * np.minimum(turns, 1.0 - turns)
    step = int(steps[evenness.min(axis=(1, 2)).argmax()])
    return step, step * second % count, step * third % count


@lru_cache(maxsize=64)
def _spiral_step(count: int) -> int:
    """By how many of a spiral's `count` places to go on, so that the first few directions point everywhere alike."""
    steps = _possible_steps(count)
    length = min(count, 4 * _STRETCH)
    places = np.outer(steps, np.arange(length)) % count
    z, azimuth = (2 * places + 1) / count - 1.0, 2.0 * np.pi * _RATIOS[0] * places
    around = np.sqrt(1.0 - z * z)
    sums = np.cumsum([around * np.cos(azimuth), around * np.sin(azimuth), z], axis=-1)
    lopsided = np.linalg.norm(sums, axis=0) / np.sqrt(np.arange(1, length + 1))
    return int(steps[lopsided[:, 2:].max(axis=1, initial=0.0).argmin()])


def _possible_steps(count: int) -> Int64Array:
    """(S,) those from 1/3 of `count` on with which all of its numbers come once."""
    steps = (np.arange(min(count, _MOST_STEPS)) + count // 3) % count
    return steps[np.gcd(steps, count) == 1]


def _coprime(count: int, ratio: float) -> int:
    step = max(round(count * ratio), 1)
    while gcd(step, count) != 1:
        step += 1
    return step


def light_shifts(keys: Sequence[str], seed: int) -> Float64Array:
    """(L, 3) in [0, 1): where each light's lattice starts, by its key, so that other lights change nothing."""
    return np.array([_shift(key, seed) for key in keys], np.float64).reshape(-1, 3)


@lru_cache(maxsize=_MOST_SHIFTS)
def _shift(key: str, seed: int) -> tuple[float, float, float]:
    x, y, z = np.random.default_rng((crc32(key.encode()), seed)).random(3).tolist()
    return x, y, z


def folded(points: Float64Array) -> Float64Array:
    """Points in [0, 1) folded at ½, so that a lattice integrates what is smooth but not periodic as well as if it were.

    Hickernell 2002, "Obtaining O(N^−2+ε) Convergence for Lattice Quadrature Rules" (baker's transformation).
    """
    return 1.0 - np.abs(2.0 * points - 1.0)


def square_points(points: Float64Array) -> Float64Array:
    """Unit cube (N, 3) -> (x, y, 0) uniform in the square −1…1."""
    square = 2.0 * folded(points) - 1.0
    square[:, 2] = 0.0
    return square


def disk_points(points: Float64Array) -> Float64Array:
    """Unit cube (N, 3) -> (x, y, 0) uniform in the unit disk; smooth, and periodic in the angle by itself."""
    radius, angle = np.sqrt(folded(points[:, 0])), 2.0 * np.pi * points[:, 1]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros_like(radius)], axis=-1)


def ball_points(numbers: Int64Array, count: int, shifts: Float64Array) -> Float64Array:
    """Points (N, 3) of the unit ball that are uniform in a disk from whatever side they are seen; as `lattice_points`.

    Their density is 1/(π² √(1 − r²)), the inverse Abel transform of the disk's (Bracewell 1978, ch. 12): one point
    serves every receiver, who sees it on the disk that faces him. Each is followed by its mirror image, so that what is
    linear over the light is integrated exactly.
    """
    points = lattice_points(numbers // 2, (count + 1) // 2, shifts)
    share, radii = _ball_cdf()
    radius = np.interp(folded(points[:, 2]), share, radii) * np.where(numbers % 2, -1.0, 1.0)
    z = 1.0 - 2.0 * folded(points[:, 0])
    around = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    azimuth = 2.0 * np.pi * points[:, 1]
    return radius[:, None] * np.stack([around * np.cos(azimuth), around * np.sin(azimuth), z], axis=-1)


def spiral_points(indices: Int64Array, count: int, shift: float) -> Float64Array:
    """Points (N, 2) in [0, 1) with numbers `indices` (N,) of `count`: (azimuth, share of the sphere below).

    On the sphere they are a Fibonacci spiral (Swinbank and Purser 2006), the evenest of simple patterns, in such an
    order that any stretch of it is spread evenly, too. `shift`: turns it.
    """
    turn = indices * _spiral_step(count) % count
    return np.stack([np.modf(turn * _RATIOS[0] + shift)[0], (turn + 0.5) / count], axis=-1)


@lru_cache(maxsize=1)
def _ball_cdf() -> tuple[Float64Array, Float64Array]:
    """Share of the ball's points within a radius: (2/π)(asin r − r √(1 − r²)); dense where it rises steeply, near 1."""
    radii = np.sin(np.linspace(0.0, 0.5 * np.pi, _BALL_TABLE_SIZE))
    return (np.arcsin(radii) - radii * np.sqrt(1.0 - radii**2)) * (2.0 / np.pi), radii
