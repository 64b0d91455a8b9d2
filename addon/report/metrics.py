# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a picture is from its reference. Pictures are scene-linear RGB (H, W, 3) float32, top row first."""

import math
from dataclasses import dataclass

import numpy as np

from ..scene.arrays import Float32Array, Float64Array

RELATIVE_FLOOR = 0.01
"""Added to the squared reference in relative errors, so that black pixels do not decide it (Rousselle et al. 2011)."""

FIREFLY_PERCENTILE = 99.9

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of red, green and blue; ITU-R BT.709."""


@dataclass(frozen=True)
class Errors:
    """`rmse`: root mean square error, over pixels and channels. `relative_mse`: mean of error² / (reference² + 0.01).

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


def errors(picture: Float32Array, reference: Float32Array) -> Errors:
    """How far `picture` is from `reference`, both (H, W, 3) and scene-linear.

    Raises ValueError where they differ in shape, have no pixels, or the reference is not finite.
    """
    _check(picture, reference)
    valid, invalid = blackened(picture)
    truth = reference.astype(np.float64)
    error = valid - truth
    squared = error * error
    shown = display(valid).astype(np.float64) - display(reference)
    red, green, blue = (float(error[..., channel].mean()) for channel in range(3))
    return Errors(
        rmse=float(np.sqrt(squared.mean())),
        relative_mse=float(np.mean(squared / (truth * truth + RELATIVE_FLOOR))),
        psnr=decibels(float(np.mean(shown * shown))),
        bias=(red, green, blue),
        fireflies=max(0.0, float(np.percentile(error @ LUMINANCE, FIREFLY_PERCENTILE))),
        invalid=invalid,
    )


def difference(picture: Float32Array, reference: Float32Array) -> Float32Array:
    """|picture − reference| of each channel, scene-linear; `picture` where it is not finite counts as black.

    Raises ValueError as `errors`.
    """
    _check(picture, reference)
    apart: Float64Array = np.abs(blackened(picture)[0] - reference.astype(np.float64))
    return np.minimum(apart, np.finfo(np.float32).max).astype(np.float32)


def blackened(picture: Float32Array) -> tuple[Float32Array, int]:
    """A picture (…, 3) whose pixels are black where any channel is not finite, and the number of those pixels."""
    broken = ~np.isfinite(picture).all(axis=-1, keepdims=True)
    return np.where(broken, np.float32(0.0), picture), int(np.count_nonzero(broken))


def display(linear: Float32Array) -> Float32Array:
    """Scene-linear values (…, 3) as Blender's view transform Standard shows them, 0…1 float32.

    Cut to 0…1 and encoded after IEC 61966-2-1 (sRGB); pixels that are not finite are black.
    """
    values = np.clip(blackened(linear)[0], 0.0, 1.0)
    encoded = 1.055 * values ** np.float32(1.0 / 2.4) - 0.055
    return np.where(values <= 0.0031308, 12.92 * values, encoded).astype(np.float32)


def decibels(shown_mse: float) -> float:
    """Peak signal to noise ratio of a mean square error in display space, whose peak is 1; infinite for 0."""
    return -10.0 * math.log10(shown_mse) if shown_mse > 0.0 else math.inf


def _check(picture: Float32Array, reference: Float32Array) -> None:
    """Raise ValueError where the two cannot be compared."""
    if picture.shape != reference.shape:
        raise ValueError(f"the picture is {_size(picture)} and its reference {_size(reference)}")
    if reference.ndim != 3 or reference.shape[-1] != 3 or not reference.size:
        raise ValueError(f"there are no RGB pixels in {_size(reference)}")
    if not np.isfinite(reference).all():
        raise ValueError("the reference has pixels that are not finite")


def _size(picture: Float32Array) -> str:
    """Width × height × channels, in words."""
    return "×".join(str(extent) for extent in (*picture.shape[1::-1], *picture.shape[2:]))
