# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a picture is from its reference. Pictures are scene-linear RGB (H, W, 3) float32, top row first."""

from dataclasses import dataclass

import numpy as np

from ..scene.arrays import Float32Array

RELATIVE_FLOOR = 0.01
"""Added to the squared reference in the relative error, so that black pixels do not decide it (Rousselle et al. 2011)."""

FIREFLY_PERCENTILE = 99.9


@dataclass(frozen=True)
class Errors:
    """`rmse`: root mean square of the error, over pixels and channels. `relative_mse`: mean of error² / (reference² + 0.01).

    `psnr`: decibels, in display space (infinite for equal pictures). `bias`: mean signed error per channel.
    `fireflies`: the 99.9th percentile of how much brighter than the reference (luminance) a pixel is, at least 0.
    `invalid`: pixels that are not finite; they count as black.
    """

    rmse: float
    relative_mse: float
    psnr: float
    bias: tuple[float, float, float]
    fireflies: float
    invalid: int
