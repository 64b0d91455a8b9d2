# SPDX-License-Identifier: GPL-3.0-or-later
"""Linearly transformed cosines that stand for the GGX BRDF; `tooling/fit_ltc.py` fits them."""

from pathlib import Path

import numpy as np

from ..scene.arrays import Float32Array, Float64Array

TABLE_SIZE = 32
LTC_FILE = Path(__file__).with_name("ltc_table.npz")

_SMALLEST_COSINE = 1e-2


def node_roughnesses() -> Float64Array:
    """(32,) perceptual roughness of the table's columns."""
    return np.linspace(0.0, 1.0, TABLE_SIZE)


def node_cosines() -> Float64Array:
    """(32,) n·v of the table's rows, 1 − (i/31)²: lobes change fastest at grazing angles."""
    return np.maximum(1.0 - np.linspace(0.0, 1.0, TABLE_SIZE) ** 2, _SMALLEST_COSINE)


def ltc_table() -> Float32Array:
    """(32, 32, 4) float32, [√(1 − n·v) · 31, perceptual roughness · 31]: elements a, b, c, d of M⁻¹.

    M⁻¹ = ((a, 0, b), (0, 1, 0), (c, 0, d)) in the frame whose x axis is the view's projection onto the surface and z
    its normal; it takes the directions that GGX times n·l reflects to ones distributed as a clamped cosine.
    """
    with np.load(LTC_FILE) as file:
        return file["inverse_matrix"]
