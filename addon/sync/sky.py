# SPDX-License-Identifier: GPL-3.0-or-later
"""The clear sky of the Sky Texture's single-scattering model, and what all physical skies share.

Light is scattered once, by molecules (Rayleigh) and haze (Mie), on its way from the sun through a spherical atmosphere:
Nishita et al. 1993, "Display of the Earth Taking into Account Atmospheric Scattering", with the constants, the steps
along rays and the table of 512 × 128 directions that Cycles uses, so that the picture is Cycles'.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..scene.arrays import BoolArray, Float64Array
from ..scene.equirectangular import interpolated

SMALLEST_SUN = 0.0005
"""Radians; narrower suns are shown so wide, as in Cycles."""


@dataclass(frozen=True)
class Air:
    """The air around a point `altitude` metres above the sea; densities of its parts relative to Earth's."""

    altitude: float
    molecules: float
    aerosols: float
    ozone: float


@dataclass(frozen=True)
class Sky:
    """A physical sky. `sun_elevation`, `sun_rotation` (clockwise from +Y seen from above), rad.

    `rgb_from_xyz` (3, 3), row by row: scene-linear colour of CIE XYZ. `multiple`: light is scattered more than once.
    `before_5`: shown as Cycles did before Blender 5.0, where rows near the horizon differ a little.
    """

    air: Air
    sun_elevation: float
    sun_rotation: float
    rgb_from_xyz: tuple[float, ...]
    multiple: bool
    before_5: bool

    @property
    def sun_direction(self) -> Float64Array:
        """(3,) towards the sun."""
        horizontal = np.cos(self.sun_elevation)
        return np.array(
            [
                np.sin(self.sun_rotation) * horizontal,
                np.cos(self.sun_rotation) * horizontal,
                np.sin(self.sun_elevation),
            ]
        )

    def color(self, xyz: Float64Array) -> Float64Array:
        """(..., 3) scene-linear RGB ≥ 0 of CIE XYZ (..., 3)."""
        return np.maximum(xyz @ np.array(self.rgb_from_xyz).reshape(3, 3).T, 0.0)

    def azimuth_from_sun(self, directions: Float64Array) -> Float64Array:
        """(...) in 0…π: the angle about the vertical between unit directions (..., 3) and the sun."""
        turned = np.arctan2(directions[..., 0], directions[..., 1]) - self.sun_rotation
        return np.abs((turned + np.pi) % (2.0 * np.pi) - np.pi)


_EARTH_RADIUS, _ATMOSPHERE_RADIUS = 6360e3, 6420e3  # m
_RAYLEIGH_HEIGHT, _MIE_HEIGHT = 8000.0, 1200.0  # m in which densities fall to 1/e
_MIE_SCATTERING, _MIE_EXTINCTION = 2e-5, 1.11 * 2e-5  # 1/m at sea level
_MIE_ASYMMETRY = 0.76
_STEPS = 32  # along a view ray
_GROUND_FADE = -0.4  # z of directions below which there is nothing
_TABLE_COLUMNS, _TABLE_ROWS = 512, 128
_OUR_COLUMNS = 33  # from the sun to opposite of it: without the phase functions, radiance varies slowly

_SPECTRUM = np.array(
    # From 380 to 780 nm: irradiance of the sun above the atmosphere, W/(m²·nm); Rayleigh scattering at sea level, 1/m;
    # absorption where ozone is densest, 1/m; CIE 1931 2° colour matching functions x, y, z.
    [
        (1.457568299, 5.424820088e-05, 3.251268499e-09, 0.001368, 0.000039, 0.006450001),
        (1.565963056, 4.418549867e-05, 5.853953650e-09, 0.01431, 0.000396, 0.06785001),
        (1.651484491, 3.635151910e-05, 1.977191155e-08, 0.13438, 0.004, 0.6456),
        (1.714962427, 3.017929012e-05, 7.309568763e-08, 0.34828, 0.023, 1.74706),
        (1.757979838, 2.526320227e-05, 2.008456151e-07, 0.2908, 0.06, 1.6692),
        (1.782564079, 2.130859311e-05, 4.038395810e-07, 0.09564, 0.13902, 0.8129501),
        (1.790951085, 1.809838025e-05, 6.355133591e-07, 0.0049, 0.323, 0.272),
        (1.785415501, 1.547057129e-05, 9.670704118e-07, 0.06327, 0.71, 0.07824999),
        (1.768155549, 1.330284977e-05, 1.547974004e-06, 0.2904, 0.954, 0.0203),
        (1.741220696, 1.150184784e-05, 2.090386472e-06, 0.5945, 0.995, 0.0039),
        (1.706471272, 9.995574300e-06, 2.461280562e-06, 0.9163, 0.87, 0.001650001),
        (1.665560875, 8.727999736e-06, 2.735512995e-06, 1.0622, 0.631, 0.0008),
        (1.619934372, 7.655137010e-06, 2.151258631e-06, 0.8544499, 0.381, 0.00019),
        (1.570835974, 6.742172038e-06, 1.590518408e-06, 0.4479, 0.175, 0.00002),
        (1.519323351, 5.961341258e-06, 1.123561980e-06, 0.1649, 0.061, 0),
        (1.466284950, 5.290345981e-06, 7.352755149e-07, 0.04677, 0.017, 0),
        (1.412458527, 4.711156876e-06, 4.645013036e-07, 0.01135916, 0.004102, 0),
        (1.358449620, 4.209104811e-06, 3.309607992e-07, 0.002899327, 0.001047, 0),
        (1.304749138, 3.772183813e-06, 2.251261229e-07, 0.0006900786, 0.0002492, 0),
        (1.251749633, 3.390512555e-06, 1.487912927e-07, 0.0001661505, 0.00006, 0),
        (1.199759988, 3.055915317e-06, 1.682862336e-07, 0.00004150994, 0.00001499, 0),
    ]
)
_WAVELENGTH_STEP = 20.0  # nm
_IRRADIANCE, _RAYLEIGH, _OZONE = _SPECTRUM[:, :3].T
_EXTINCTION = np.stack([_RAYLEIGH, np.full_like(_RAYLEIGH, _MIE_EXTINCTION), _OZONE])
_XYZ_FROM_IRRADIATED = _IRRADIANCE[:, None] * _SPECTRUM[:, 3:] * _WAVELENGTH_STEP

# Gauss–Laguerre quadrature with 8 nodes, cut at 25 e-foldings: optical depths fall off exponentially along a ray.
_LAGUERRE_NODES, _LAGUERRE_WEIGHTS = np.polynomial.laguerre.laggauss(8)
_LAGUERRE_WEIGHTS = _LAGUERRE_WEIGHTS * np.exp(_LAGUERRE_NODES) / 25.0
_LAGUERRE_NODES = _LAGUERRE_NODES / 25.0


def single_scattering_radiance(sky: Sky, directions: Float64Array) -> Float64Array:
    """(n, 3) float64 scene-linear radiance of a sky, without the sun's disc, in unit directions (n, 3).

    The ground below the horizon is what Cycles shows: the horizon's colour, fading to black. Cycles reads its table
    half a texel off in azimuth and elevation, which moves the sky near the horizon visibly; so do we.
    """
    elevation = np.arcsin(np.clip(directions[:, 2], -1.0, 1.0))
    row = np.copysign(np.sqrt(np.abs(elevation) / (0.5 * np.pi)) * _TABLE_ROWS, elevation) - 0.5
    ground = np.minimum(directions[:, 2], 0.0) if sky.before_5 else np.sin(_row_elevations(np.minimum(row, 0.0)))
    row = np.clip(row, 0.0, _TABLE_ROWS - 1.0)
    azimuth = np.minimum(sky.azimuth_from_sun(directions) + np.pi / _TABLE_COLUMNS, np.pi)
    column = np.minimum(azimuth / np.pi * (_OUR_COLUMNS - 1), _OUR_COLUMNS - 1 - 1e-9)
    scattered = interpolated(_table(sky.air, sky.sun_elevation, sky.before_5), column, row)
    shown = _row_elevations(row, sky.before_5)
    cosine = np.cos(shown) * np.cos(azimuth) * np.cos(sky.sun_elevation) + np.sin(shown) * np.sin(sky.sun_elevation)
    xyz = scattered[:, :3] * _rayleigh_phase(cosine)[:, None] + scattered[:, 3:] * _mie_phase(cosine)[:, None]
    fade = np.maximum(1.0 - ground / _GROUND_FADE, 0.0) ** 3
    return sky.color(xyz) * fade[:, None]


def single_scattering_sun(sky: Sky, elevations: Float64Array, solid_angle: float) -> Float64Array:
    """(n, 3) float64 scene-linear radiance of a sun of `solid_angle` (sr) seen at these elevations (n,), rad.

    Ozone is left out, as in Cycles.
    """
    depths = _optical_depths(
        np.array([0.0, 0.0, _EARTH_RADIUS + _altitude(sky.air)])[None],
        np.stack([np.cos(elevations), np.zeros_like(elevations), np.sin(elevations)], axis=-1),
    )
    depths = depths * (sky.air.molecules, sky.air.aerosols, 0.0)
    return sky.color(np.exp(-depths @ _EXTINCTION) @ _XYZ_FROM_IRRADIATED / solid_angle)


def _altitude(air: Air) -> float:
    return min(max(air.altitude, 1.0), _ATMOSPHERE_RADIUS - _EARTH_RADIUS - 1.0)


def _row_elevations(row: Float64Array, before_5: bool = False) -> Float64Array:
    """Elevation (rad) of rows of the table, negative for negative ones: most rows lie near the horizon."""
    top = 0.5 * np.pi * (1.0 + 0.5 / _TABLE_ROWS) if before_5 else 0.5 * np.pi
    return np.copysign(top * (row / _TABLE_ROWS) ** 2, row)


@lru_cache(maxsize=4)
def _table(air: Air, sun_elevation: float, before_5: bool) -> Float64Array:
    """(128, 33, 6) CIE XYZ of what molecules and what haze scatter towards a point, before their phase functions.

    Rows as `_row_elevations` says, columns from the sun's azimuth to the opposite one.
    """
    elevation = _row_elevations(np.arange(_TABLE_ROWS, dtype=float), before_5)[:, None]
    azimuth = np.linspace(0.0, np.pi, _OUR_COLUMNS)
    rays = np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.broadcast_to(np.sin(elevation), (_TABLE_ROWS, _OUR_COLUMNS)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    sun = np.array([np.cos(sun_elevation), 0.0, np.sin(sun_elevation)])
    return _scattered_once(rays, sun, air).reshape(_TABLE_ROWS, _OUR_COLUMNS, 6)


def _scattered_once(rays: Float64Array, sun: Float64Array, air: Air) -> Float64Array:
    """(n, 6) CIE XYZ by molecules, then by haze, without phase functions, of the rays (n, 3) from a point in `air`."""
    densities = np.array([air.molecules, air.aerosols, air.ozone])
    origin = np.array([0.0, 0.0, _EARTH_RADIUS + _altitude(air)])
    step = _distance_to_space(origin[None], rays) / _STEPS
    depth = np.zeros((len(rays), 3))
    scattered = np.zeros((len(rays), 2, len(_RAYLEIGH)))
    for index in range(_STEPS):
        points = origin + ((index + 0.5) * step)[:, None] * rays
        amount = _densities(np.linalg.norm(points, axis=-1) - _EARTH_RADIUS) * densities * step[:, None]
        depth += amount
        lit = _sun_reaches(points, sun)
        transmitted = np.zeros((len(rays), len(_RAYLEIGH)))
        to_sun = _optical_depths(points[lit], sun[None]) * densities
        transmitted[lit] = np.exp(-(depth[lit] + to_sun) @ _EXTINCTION)
        scattered += transmitted[:, None, :] * amount[:, :2, None]
    scattered[:, 0] *= _RAYLEIGH
    scattered[:, 1] *= _MIE_SCATTERING
    return (scattered @ _XYZ_FROM_IRRADIATED).reshape(-1, 6)


def _densities(height: Float64Array) -> Float64Array:
    """(..., 3) relative densities of molecules, haze and ozone `height` metres above the sea."""
    ozone = np.maximum(1.0 - np.abs(height - 25000.0) / 15000.0, 0.0)
    return np.stack([np.exp(-height / _RAYLEIGH_HEIGHT), np.exp(-height / _MIE_HEIGHT), ozone], axis=-1)


def _distance_to_space(points: Float64Array, rays: Float64Array) -> Float64Array:
    """(n,) metres along unit rays (n, 3) from points (n, 3) in the atmosphere to its end."""
    along = np.sum(points * rays, axis=-1)
    return np.sqrt(along**2 - np.sum(points**2, axis=-1) + _ATMOSPHERE_RADIUS**2) - along


def _sun_reaches(points: Float64Array, sun: Float64Array) -> BoolArray:
    """(n,) whether the Earth does not lie between points (n, 3) and the sun (3,)."""
    along = points @ sun
    return (sun[2] >= 0.0) | (along**2 < np.sum(points**2, axis=-1) - _EARTH_RADIUS**2)


def _optical_depths(points: Float64Array, rays: Float64Array) -> Float64Array:
    """(n, 3) metres of sea-level density of molecules, haze and ozone between points (n, 3) and space along rays."""
    length = _distance_to_space(points, rays)
    depth = np.zeros((len(length), 3))
    for node, weight in zip(_LAGUERRE_NODES, _LAGUERRE_WEIGHTS, strict=True):
        heights = np.linalg.norm(points + (node * length)[:, None] * rays, axis=-1) - _EARTH_RADIUS
        depth += weight * _densities(heights)
    return depth * length[:, None]


def _rayleigh_phase(cosine: Float64Array) -> Float64Array:
    return 3.0 / (16.0 * np.pi) * (1.0 + cosine**2)


def _mie_phase(cosine: Float64Array) -> Float64Array:
    """Cornette and Shanks 1992, eq. 5."""
    g = _MIE_ASYMMETRY
    return (
        3.0
        / (8.0 * np.pi)
        * (1.0 - g * g)
        / (2.0 + g * g)
        * (1.0 + cosine**2)
        / (1.0 + g * g - 2.0 * g * cosine) ** 1.5
    )
