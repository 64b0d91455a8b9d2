# SPDX-License-Identifier: GPL-3.0-or-later
"""How Cycles renders what pictures are judged by, and how much noise is left in that."""

import numpy as np

from ..scene.arrays import Float32Array

UNBIASED = {
    "use_adaptive_sampling": "False",
    "time_limit": "0",
    "sample_clamp_direct": "0",
    "sample_clamp_indirect": "0",
}
"""Cycles with nothing stopped early and nothing cut off: the mean over samples tends to the truth."""

REFERENCE_SETTINGS = {**UNBIASED, "use_denoising": "False"}
"""Settings of Cycles for a reference; everything else is the file's."""


def noise_of_mean(even: Float32Array, odd: Float32Array) -> float:
    """Root mean square noise of the mean of two independent pictures (H, W, 3) of as many samples each, scene-linear.

    Their difference has the variance of both, their mean a quarter of that. Raises ValueError where they differ in
    shape or are empty.
    """
    apart = _apart(even, odd)
    return float(np.sqrt(np.mean(apart * apart)) / 2.0)


def noise_of(reference: Float32Array, first: Float32Array, second: Float32Array) -> float:
    """Root mean square noise of `reference` by two independent pictures, all (H, W, 3) and scene-linear.

    Three independent errors r, a and b of mean 0 have E[(a − r)(b − r)] = E[r²]. 0 where chance makes that negative.
    Raises ValueError as `noise_of_mean`.
    """
    return float(np.sqrt(max(0.0, np.mean(_apart(first, reference) * _apart(second, reference)))))


def _apart(one: Float32Array, other: Float32Array) -> np.ndarray:
    """The difference of two pictures of one shape with pixels, float64."""
    if one.shape != other.shape or not one.size:
        raise ValueError(f"pictures of shapes {one.shape} and {other.shape} cannot be compared")
    return one.astype(np.float64) - other
