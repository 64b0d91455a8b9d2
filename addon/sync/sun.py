# SPDX-License-Identifier: GPL-3.0-or-later
"""The sun of a physical sky: its disc, and the light that it is."""

from __future__ import annotations

import numpy as np

from ..scene import Light, LightKind, SunDisc
from ..scene.arrays import Color, Float64Array
from .lights import rigid_matrix
from .sky import SMALLEST_SUN, Sky, single_scattering_sun
from .sky_multiple import multiple_scattering_sun

_LIMB_DARKENING = 0.6
_RINGS, _SPOKES = 32, 64
_SEA_LEVEL = 6371e3  # m, the radius beyond which the Earth hides the sun
_ZENITH = np.array([0.0, 0.0, 1.0])


def sun_light(key: str, name: str, sky: Sky, size: float, color: Color, environment_from_world: Float64Array) -> Light:
    """The sun of `sky`, of angular diameter `size` (rad) and with `color` as factor, as a light.

    `environment_from_world` (3, 3), a rotation, turns world space into the sky's.
    """
    size = max(size, SMALLEST_SUN)
    matrix = np.eye(4)
    matrix[:3, 2] = environment_from_world.T @ sky.sun_direction
    matrix[:3, 1] = environment_from_world.T @ _ZENITH
    red, green, blue = sun_irradiance(sky, size) * color
    emission = float(red), float(green), float(blue)
    return Light(key, name, LightKind.SUN, rigid_matrix(matrix), emission, angle=size)


def sun_disc(sky: Sky, size: float, color: Color, environment_from_world: Float64Array) -> SunDisc:
    """What the camera sees of the light that `sun_light` makes of the same arguments.

    The disc darkens towards its limb and brightens from its lowest to its highest point, as in Cycles, and ends at the
    horizon of the point from which it is seen. (Before Blender 5.0 Cycles shows it instead of the sky behind it, which
    makes 1 % of a disc that is 11° wide, and 0.001 % of the sun's.)
    """
    half = 0.5 * max(size, SMALLEST_SUN)
    # Radiance is irradiance over a solid angle that Cycles computes in single precision: that makes 0.15 % for the
    # sun's size, and a factor of 1.9 for the narrowest.
    solid_angle = 2.0 * np.pi * (1.0 - float(np.float32(np.cos(half))))
    lowest, highest = _edges(sky, half, solid_angle) * color
    setting = sky.before_5 and sky.sun_elevation <= half
    return SunDisc(
        direction=_triple(environment_from_world.T @ sky.sun_direction),
        zenith=_triple(environment_from_world.T @ _ZENITH),
        half_angle=half,
        lowest=_triple(lowest),
        highest=_triple(highest),
        lowest_elevation=-sky.sun_elevation if setting else -half,
        horizon=_horizon(sky) - sky.sun_elevation,
        limb_darkening=_LIMB_DARKENING,
    )


def sun_irradiance(sky: Sky, size: float) -> Float64Array:
    """(3,) scene-linear irradiance (W/m²) of the sun's disc on a surface that faces its centre."""
    disc = sun_disc(sky, size, (1.0, 1.0, 1.0), np.eye(3))
    rings = (np.arange(_RINGS) + 0.5) / _RINGS
    cosine = 1.0 - rings * (1.0 - np.cos(disc.half_angle))
    angle = np.arccos(cosine)[:, None]
    around = (np.arange(_SPOKES) + 0.5) * (2.0 * np.pi / _SPOKES)
    sine = np.sin(sky.sun_elevation) * np.cos(angle) + np.cos(sky.sun_elevation) * np.sin(angle) * np.cos(around)
    radiance = _shown(disc, angle, np.arcsin(np.clip(sine, -1.0, 1.0)) - sky.sun_elevation)
    solid_angle = 2.0 * np.pi * (1.0 - np.cos(disc.half_angle))
    return np.mean(radiance * cosine[:, None, None], axis=(0, 1)) * solid_angle


def _shown(disc: SunDisc, angle: Float64Array, elevation: Float64Array) -> Float64Array:
    """(..., 3) radiance of a disc `angle` (rad) from its centre and `elevation` (rad) above it; both broadcast."""
    height = (elevation - disc.lowest_elevation) / max(disc.half_angle - disc.lowest_elevation, 1e-9)
    lowest, highest = np.array(disc.lowest), np.array(disc.highest)
    limb = 1.0 - disc.limb_darkening * (1.0 - np.sqrt(np.maximum(1.0 - (angle / disc.half_angle) ** 2, 0.0)))
    return (lowest + (highest - lowest) * height[..., None]) * (limb * (elevation > disc.horizon))[..., None]


def _triple(values: Float64Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _edges(sky: Sky, half: float, solid_angle: float) -> Float64Array:
    """(2, 3) radiance of the disc's lowest and highest point."""
    elevations = sky.sun_elevation + np.array([-half, half])
    if sky.multiple:
        return multiple_scattering_sun(sky, elevations, solid_angle)
    if elevations[1] <= 0.0:
        return np.zeros((2, 3))
    return single_scattering_sun(sky, np.maximum(elevations, 0.0), solid_angle)


def _horizon(sky: Sky) -> float:
    """Elevation (rad) below which the Earth hides the sun."""
    if sky.before_5:
        return 0.0
    return float(np.arcsin(_SEA_LEVEL / (_SEA_LEVEL + max(sky.air.altitude, 0.0)))) - 0.5 * np.pi
