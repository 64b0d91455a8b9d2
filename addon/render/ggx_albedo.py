# SPDX-License-Identifier: GPL-3.0-or-later
"""Directional albedo of the GGX BRDF, integrated once and looked up by shaders."""

import numpy as np

from ..scene.arrays import Float32Array

TABLE_SIZE = 32
_SAMPLES = 512
_SMALLEST = 1e-3  # n·v and roughness: at 0 the integrand is 0/0


def ggx_albedo_table() -> Float32Array:
    """(32, 32, 2) float32: scale A and bias B so that unit light from everywhere is reflected as F0·A + F90·B.

    Row i is n·v = i/31, column j the perceptual roughness j/31; `lookup_ggx_albedo` in `common/bsdf.glsl` reads it so.
    Karis 2013, "Real Shading in Unreal Engine 4", equations 7 and 8, with the height-correlated masking of the
    shader's own BRDF (Heitz 2014, eq. 99); half vectors are drawn from the distribution of normals.
    """
    nodes = np.maximum(np.linspace(0.0, 1.0, TABLE_SIZE), _SMALLEST)
    n_dot_v = nodes[:, None, None]
    a2 = nodes[None, :, None] ** 4
    first = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    second = np.modf(np.arange(_SAMPLES) * 0.6180339887498949)[0]  # golden ratio
    n_dot_h = np.sqrt((1.0 - first) / (1.0 + (a2 - 1.0) * first))
    sine_h = np.sqrt(1.0 - n_dot_h**2)
    v_dot_h = sine_h * np.cos(2.0 * np.pi * second) * np.sqrt(1.0 - n_dot_v**2) + n_dot_h * n_dot_v
    n_dot_l = np.maximum(2.0 * v_dot_h * n_dot_h - n_dot_v, 0.0)
    masking = n_dot_l * np.sqrt(n_dot_v**2 * (1.0 - a2) + a2)
    shadowing = n_dot_v * np.sqrt(n_dot_l**2 * (1.0 - a2) + a2)
    weight = np.where(n_dot_l > 0.0, 2.0 * n_dot_l * np.maximum(v_dot_h, 0.0) / ((masking + shadowing) * n_dot_h), 0.0)
    fresnel = (1.0 - np.clip(v_dot_h, 0.0, 1.0)) ** 5
    table = np.stack([(weight * (1.0 - fresnel)).mean(axis=2), (weight * fresnel).mean(axis=2)], axis=-1)
    return table.astype(np.float32)
