# SPDX-License-Identifier: GPL-3.0-or-later
"""Directional albedo of the GGX BRDF, integrated once and looked up by shaders."""

import numpy as np

from ..scene.arrays import Float32Array, Float64Array

ROUGHNESSES = COSINES = 32
REFLECTANCES = 16

_SAMPLES = 512  # half vectors per node
_SMALLEST = 1e-3  # n·v and roughness: at 0 the integrand is 0/0
_LARGEST_ROOT = 0.99  # √F0 of a dielectric: at 1 its index of refraction is infinite


def ggx_albedo_table() -> Float32Array:
    """(16, 32, 32, 4) float32, [√F0 · 15, n·v · 31, perceptual roughness · 31]; `common/ggx.glsl` reads it.

    Of the share of unit light from everywhere that GGX reflects by scattering once (all for reflectance 1):
    E · what of it Schlick's weight (1 − cosθ)⁵ takes, in E · s, so that a dielectric of this F0 reflects
    E (F0 + (1 − F0) s) · mean of E over the hemisphere, 2 ∫ E(μ) μ dμ. Only s depends on F0; it is below 0 where
    the dip at Brewster's angle outweighs grazing light.

    Half vectors are drawn from the visible normals (Heitz 2018; by the spherical caps of Dupuy and Benyoub 2023),
    which leaves Fresnel times G₂/G₁ to average, with height-correlated masking (Heitz 2014, eq. 99).
    """
    roughness = np.maximum(np.linspace(0.0, 1.0, ROUGHNESSES), _SMALLEST)
    cosines = np.maximum(np.linspace(0.0, 1.0, COSINES), _SMALLEST)
    roots = np.minimum(np.linspace(0.0, 1.0, REFLECTANCES), _LARGEST_ROOT)
    table = np.empty((REFLECTANCES, COSINES, ROUGHNESSES, 4))
    order = np.arange(_SAMPLES)
    samples = np.stack([np.modf(order * 0.6180339887498949)[0], (order + 0.5) / _SAMPLES], axis=-1)  # golden ratio
    for column, alpha in enumerate(roughness**2):
        normals = visible_normals(alpha, cosines, samples)
        view = np.stack([np.sqrt(1.0 - cosines**2), cosines], axis=-1)
        cosine = np.clip(np.einsum("nmk,nk->nm", normals[..., ::2], view), 0.0, 1.0)
        weight = reflection_weight(alpha, cosines[:, None], 2.0 * cosine * normals[..., 2] - cosines[:, None])
        single = weight.mean(axis=1)
        table[:, :, column, 0] = single
        table[:, :, column, 1] = (weight * (1.0 - cosine) ** 5).mean(axis=1)
        for row, root in zip(table[1:, :, column, 2], roots[1:], strict=True):
            reflected = (weight * dielectric_fresnel(cosine, (1.0 + root) / (1.0 - root))).mean(axis=1) / single
            row[:] = (reflected - root**2) / (1.0 - root**2)
        table[:, :, column, 3] = _hemispherical_mean(single)
    table[0, :, :, 2] = 0.0  # nothing refracts, nothing is reflected
    return table.astype(np.float32)


def _hemispherical_mean(values: Float64Array) -> float:
    """2 ∫ f(μ) μ dμ of f at the nodes i/(N − 1), linear between them."""
    nodes = np.linspace(0.0, 1.0, len(values))
    # The exact integral of hat functions times μ: the end nodes have half a hat.
    weights = 2.0 * nodes * nodes[1]
    weights[0], weights[-1] = nodes[1] ** 2 / 3.0, nodes[1] - nodes[1] ** 2 / 3.0
    return float(values @ weights)


def visible_normals(alpha: float, n_dot_v: Float64Array, uniform: Float64Array) -> Float64Array:
    """(N, M, 3) normals of microfacets as views of n·v (N,) in the plane of x and z see them, by numbers (M, 2) in 0…1.

    `alpha`: GGX roughness.
    """
    cosine = n_dot_v[:, None]
    sine = np.sqrt(1.0 - cosine**2)
    # In the space where the surface is a hemisphere: a uniform point of the cap that the view sees, plus the view.
    stretch = 1.0 / np.hypot(alpha * sine, cosine)
    height = (1.0 - uniform[:, 1]) * (1.0 + cosine * stretch) - cosine * stretch
    around = np.sqrt(np.maximum(1.0 - height**2, 0.0))
    angle = 2.0 * np.pi * uniform[:, 0]
    normals = np.stack(
        [
            alpha * (around * np.cos(angle) + alpha * sine * stretch),
            alpha * around * np.sin(angle),
            height + cosine * stretch,
        ],
        axis=-1,
    )
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def reflection_weight(alpha: float, n_dot_v: Float64Array, n_dot_l: Float64Array) -> Float64Array:
    """G₂/G₁, 0 below the surface: the BRDF times n·l, without Fresnel, over the density of `visible_normals`."""
    a2 = alpha**2
    lit = n_dot_l > 0.0
    light = np.where(lit, n_dot_l, 1.0)
    towards_view = np.sqrt(a2 + (1.0 - a2) * n_dot_v**2) / n_dot_v  # 1 + 2Λ
    towards_light = np.sqrt(a2 + (1.0 - a2) * light**2) / light
    return np.where(lit, (1.0 + towards_view) / (towards_view + towards_light), 0.0)


def dielectric_fresnel(cosine: Float64Array, ior: float) -> Float64Array:
    """Unpolarised reflectance of a smooth interface for light from the side of index 1; shape of `cosine`."""
    inside = np.sqrt(ior**2 - 1.0 + cosine**2)
    across = (cosine - inside) / (cosine + inside)
    along = (ior**2 * cosine - inside) / (ior**2 * cosine + inside)
    return 0.5 * (across**2 + along**2)
