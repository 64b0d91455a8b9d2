# SPDX-License-Identifier: GPL-3.0-or-later
"""The pattern of samples within a pixel: a low-discrepancy sequence and the pixel filter."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..scene.arrays import Float64Array

_DIMENSIONS = 2
_FILTER_TABLE_SIZE = 1024


@dataclass(frozen=True)
class Sample:
    """Where in every pixel one sample looks: `index` 0, 1, …; `pixel_offset` (x, y) from the pixel centre, pixels."""

    index: int
    pixel_offset: tuple[float, float]


def film_sample(index: int, filter_radius: float, seed: int) -> Sample:
    """Sample `index` of a pixel whose Blackman–Harris filter has `filter_radius` (pixels).

    Sample 0 goes through the pixel centre, whatever the seed.
    """
    x, y = sequence_point(index, seed)
    return Sample(index, (filter_offset(x, filter_radius), filter_offset(y, filter_radius)))


def sequence_point(index: int, seed: int) -> tuple[float, float]:
    """Point `index` in [0, 1)² of the Kronecker sequence with the generalised golden ratio.

    Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences": α_j = φ^−(j+1), φ³ = φ + 1. A seed
    other than 0 starts at another stretch of the same sequence; point 0 is always the centre.
    """
    if index == 0:
        return (0.5, 0.5)
    point = np.modf(0.5 + (_start(seed) + index) * _kronecker_steps())[0]
    return (float(point[0]), float(point[1]))


def _start(seed: int) -> int:
    """Where the sequences of a seed begin."""
    return int(np.random.default_rng(seed).integers(1 << 24)) if seed else 0


@lru_cache(maxsize=1)
def _kronecker_steps() -> Float64Array:
    ratio = 1.0
    for _ in range(64):
        ratio = (1.0 + ratio) ** (1.0 / (_DIMENSIONS + 1))
    return ratio ** -np.arange(1.0, _DIMENSIONS + 1)


def filter_offset(u: float, radius: float) -> float:
    """Offset from the pixel centre (pixels) whose distribution is the Blackman–Harris filter, for u in [0, 1)."""
    cumulative, offsets = _blackman_harris_cdf()
    return float(np.interp(u, cumulative, offsets)) * radius


@lru_cache(maxsize=1)
def _blackman_harris_cdf() -> tuple[Float64Array, Float64Array]:
    """Cumulative distribution over offsets −1…1. Coefficients: Harris 1978, 4-term minimum, −92 dB."""
    offsets = np.linspace(-1.0, 1.0, _FILTER_TABLE_SIZE + 1)
    middle = 0.5 * (offsets[1:] + offsets[:-1])
    phase = np.pi * (middle + 1.0)
    weights = 0.35875 - 0.48829 * np.cos(phase) + 0.14128 * np.cos(2 * phase) - 0.01168 * np.cos(3 * phase)
    cumulative = np.concatenate([[0.0], np.cumsum(weights)])
    return cumulative / cumulative[-1], offsets


def pixel_shift(index: int, seed: int = 0) -> tuple[float, float]:
    """(x, y) in [0, 1) by which the random numbers of all pixels differ in sample `index`: other steps than
    `sequence_point`'s, the square roots of 2 and 3."""
    x, y = np.modf((_start(seed) + index) * np.sqrt([2.0, 3.0]))[0]
    return float(x), float(y)
