# SPDX-License-Identifier: GPL-3.0-or-later
"""What a comparison with Cycles found: the pictures, and the numbers between them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..scene.arrays import Float32Array
from .comparison import FIRST, OURS, SECOND, Render
from .metrics import Errors, blackened, difference, errors
from .pictures import combined
from .reference import noise_of_mean

NOISY = 0.5
"""Noise of the reference from this share of the error on is worth telling: it is a quarter of the squared error."""


@dataclass(frozen=True)
class Numbers:
    """`resolution`: width, height. `samples`: of Cycles, both halves. Seconds as `job.py` measures a first render.

    `noise_rmse`: root mean square noise that is left in Cycles' own picture, scene-linear.
    """

    resolution: tuple[int, int]
    samples: int
    our_seconds: float
    cycles_seconds: float
    errors: Errors
    noise_rmse: float

    @property
    def noise_counts(self) -> bool:
        """Whether Cycles' own noise is a good part of the error."""
        return self.noise_rmse > 0.0 and self.noise_rmse >= NOISY * self.errors.rmse


@dataclass(frozen=True)
class Compared:
    """Scene-linear RGB (H, W, 3) float32, top row first: `difference` is |ours − cycles|. And the numbers."""

    ours: Float32Array
    cycles: Float32Array
    difference: Float32Array
    numbers: Numbers


def compare(renders: Mapping[str, Render], samples: int) -> Compared:
    """Judge the renders of a comparison whose halves have `samples` each.

    Pixels of Cycles that are not finite count as black. Raises OSError where a picture cannot be read,
    ValueError where it has no colours or they differ in size.
    """
    ours = combined(renders[OURS].picture)
    first, second = (blackened(combined(renders[name].picture))[0] for name in (FIRST, SECOND))
    noise = noise_of_mean(first, second)
    cycles = ((first + second) * np.float32(0.5)).astype(np.float32)
    height, width = cycles.shape[:2]
    numbers = Numbers(
        resolution=(width, height),
        samples=2 * samples,
        our_seconds=renders[OURS].seconds,
        cycles_seconds=renders[FIRST].seconds + renders[SECOND].seconds,
        errors=errors(ours, cycles),
        noise_rmse=noise,
    )
    return Compared(ours, cycles, difference(ours, cycles), numbers)
