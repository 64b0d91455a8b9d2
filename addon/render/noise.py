# SPDX-License-Identifier: GPL-3.0-or-later
"""How noisy a picture still is, as Cycles' Noise Threshold means it."""

import numpy as np

from ..scene.arrays import Float32Array

BLOCK = 32
"""Pixels along each side of the blocks that are judged, about."""

_BLACK = 1e-4
"""What Cycles adds to the brightness, so that black has an error."""


def noise_left(half: Float32Array, whole: Float32Array) -> float:
    """The noise in the noisiest part of a picture, relative to what the eye makes of its brightness; 0 is none.

    `whole` (H, W, 3): scene-linear mean of all samples so far, of which the first half have the mean `half`. Their
    difference is as large as the noise that is left in `whole`: both have the variance of one sample over their number.
    The error of a pixel is the difference, summed over red, green and blue, over the square root of their sum (over
    the sum itself above 1), as in Cycles; that of the picture is the greatest mean over a block, after Dammertz et al.
    2010, "A Hierarchical Automatic Stopping Condition for Monte Carlo Global Illumination".
    Not a number where a pixel is not finite. Raises ValueError where the pictures differ in shape or are empty.
    """
    if half.shape != whole.shape or not whole.size:
        raise ValueError(f"pictures of shapes {half.shape} and {whole.shape} cannot be compared")
    with np.errstate(invalid="ignore", over="ignore"):
        difference = np.abs(whole.astype(np.float64) - half).sum(axis=-1)
        brightness = np.maximum(whole.astype(np.float64).sum(axis=-1), 0.0)
        return float(_block_means(difference / (_BLACK + np.maximum(np.sqrt(brightness), brightness))).max())


def _block_means(errors: np.ndarray) -> np.ndarray:
    """Means over the blocks of (H, W) errors; blocks differ in size by one row and column at most."""
    sums, counts = errors, np.ones_like(errors)
    for axis, size in enumerate(errors.shape):
        starts = np.linspace(0, size, max(1, round(size / BLOCK)), endpoint=False).astype(int)
        sums, counts = (np.add.reduceat(values, starts, axis) for values in (sums, counts))
    return sums / counts
