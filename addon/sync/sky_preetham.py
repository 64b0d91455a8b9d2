# SPDX-License-Identifier: GPL-3.0-or-later
"""The Sky Texture's Preetham model: Preetham, Shirley and Smits 1999, "A Practical Analytic Model for Daylight"."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scene.arrays import Color, Float64Array

_BRIGHTNESS = 0.06  # Cycles' radiance per cd/m² · 10⁻³ of the model
_HORIZON = 0.5 * np.pi - 0.001  # zenith angle at which the model is asked for everything below

# Perez coefficients A…E of luminance Y and chromaticities x, y as slope · turbidity + offset; paper, appendix A.2.
_PEREZ_SLOPES = np.array(
    [
        [0.1787, -0.3554, -0.0227, 0.1206, -0.0670],
        [-0.0193, -0.0665, -0.0004, -0.0641, -0.0033],
        [-0.0167, -0.0950, -0.0079, -0.0441, -0.0109],
    ]
)
_PEREZ_OFFSETS = np.array(
    [
        [-1.4630, 0.4275, 5.3251, -2.5771, 0.3703],
        [-0.2592, 0.0008, 0.2125, -0.8989, 0.0452],
        [-0.2608, 0.0092, 0.2102, -1.6537, 0.0529],
    ]
)
# Zenith chromaticities: rows by turbidity², turbidity, 1; columns by θ³, θ², θ, 1 of the sun's zenith angle.
_ZENITH_X = np.array(
    [
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
    ]
)
_ZENITH_Y = np.array(
    [
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ]
)


@dataclass(frozen=True)
class PreethamSky:
    """`sun` towards the sun, of any length; `rgb_from_xyz` (3, 3), row by row: scene-linear colour of CIE XYZ."""

    sun: Color
    turbidity: float
    rgb_from_xyz: tuple[float, ...]


def preetham_radiance(sky: PreethamSky, directions: Float64Array) -> Float64Array:
    """(n, 3) float64 scene-linear radiance in unit directions (n, 3); below the horizon that of the horizon."""
    sun = np.array(sky.sun) / max(float(np.linalg.norm(sky.sun)), 1e-30)
    sun_zenith = float(np.arccos(np.clip(sun[2], -1.0, 1.0)))
    perez = _PEREZ_SLOPES * sky.turbidity + _PEREZ_OFFSETS
    zenith = np.minimum(np.arccos(np.clip(directions[:, 2], -1.0, 1.0)), _HORIZON)
    angle = np.arccos(np.clip(directions @ sun, -1.0, 1.0))
    relative = _perez(perez, zenith, angle) / _perez(perez, np.zeros(1), np.array([sun_zenith]))
    luminance, x, y = (relative * _zenith_color(sun_zenith, sky.turbidity)).T
    y = np.where(y == 0.0, 1.0, y)
    xyz = np.stack([x * luminance / y, luminance, (1.0 - x - y) * luminance / y], axis=-1)
    return np.maximum(xyz @ np.array(sky.rgb_from_xyz).reshape(3, 3).T, 0.0)


def _perez(coefficients: Float64Array, zenith: Float64Array, angle: Float64Array) -> Float64Array:
    """(n, 3) relative luminance and chromaticities, `zenith` (n,) from the zenith and `angle` (n,) from the sun."""
    a, b, c, d, e = coefficients.T
    gradation = 1.0 + a * np.exp(b / np.cos(zenith)[:, None])
    return gradation * (1.0 + c * np.exp(d * angle[:, None]) + e * np.cos(angle)[:, None] ** 2)


def _zenith_color(sun_zenith: float, turbidity: float) -> Float64Array:
    """(3,) luminance and chromaticities of the zenith; paper, appendix A.2."""
    tilt = (4.0 / 9.0 - turbidity / 120.0) * (np.pi - 2.0 * sun_zenith)
    luminance = _BRIGHTNESS * ((4.0453 * turbidity - 4.9710) * np.tan(tilt) - 0.2155 * turbidity + 2.4192)
    powers = np.array([sun_zenith**3, sun_zenith**2, sun_zenith, 1.0])
    by_turbidity = np.array([turbidity**2, turbidity, 1.0])
    return np.array([luminance, by_turbidity @ _ZENITH_X @ powers, by_turbidity @ _ZENITH_Y @ powers])
