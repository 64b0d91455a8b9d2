# SPDX-License-Identifier: GPL-3.0-or-later
"""The clear sky of the Sky Texture's multiple-scattering model (Blender 5).

Fernando García Liñán's model (https://fgarlin.com/posts/2024-12-06-spectral_sky): single scattering at four wavelengths
that stand for the spectrum, plus what the ground reflects and a fit of all light that was scattered more than once.
Constants, steps along rays and tables are Cycles', so that the picture is.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..scene.arrays import Float64Array
from ..scene.equirectangular import interpolated
from .sky import Air, Sky

_EARTH_RADIUS, _THICKNESS = 6371.0, 100.0  # km
_SPACE = _EARTH_RADIUS + _THICKNESS
_STEPS = 64  # along rays
_TRANSMITTANCE_SHAPE = (64, 256)  # altitude, cosine of the zenith angle
_TABLE_ROWS, _COLUMNS = 256, 17

# At 630, 560, 490 and 430 nm; 1/km where nothing else is said.
_IRRADIANCE = np.array([1.679, 1.828, 1.986, 1.307])
_MOLECULAR_SCATTERING = np.array([6.605e-3, 1.067e-2, 1.842e-2, 3.156e-2])
_OZONE_ABSORPTION = 334.5 * np.array([3.472e-25, 3.914e-25, 1.349e-25, 11.03e-27])  # mean Dobson units · m²
_AEROSOL_ABSORPTION = np.array([2.8722e-24, 4.6168e-24, 7.9706e-24, 1.3578e-23])  # per particle
_AEROSOL_SCATTERING = np.array([1.5908e-22, 1.7711e-22, 2.0942e-22, 2.4033e-22])
_AEROSOL_DENSITY, _AEROSOL_BACKGROUND, _AEROSOL_HEIGHT = 1.3681e20, 2e6, 0.73
_AEROSOL_ASYMMETRY = 0.8
_GROUND_ALBEDO = 0.3
_SCATTERED_AGAIN = 0.02 * np.array([0.217, 0.347, 0.594, 1.0])
_XYZ_FROM_SPECTRUM = np.array(
    [
        [53.386917738564668, 22.981337506691025, 0.0],
        [43.904844466369358, 71.347795700053394, 0.102506867965741],
        [1.6137278251608962, 18.422960591455485, 31.742921188390806],
        [20.762668673810577, 2.3614213523314369, 110.48009643252140],
    ]
)


def multiple_scattering_radiance(sky: Sky, directions: Float64Array) -> Float64Array:
    """(n, 3) float64 scene-linear radiance of a sky, without the sun's disc, in unit directions (n, 3)."""
    elevation = np.arcsin(np.clip(directions[:, 2], -1.0, 1.0))
    height = 0.5 + 0.5 * np.copysign(np.sqrt(np.abs(elevation) / (0.5 * np.pi)), elevation)
    row = np.clip(height * _TABLE_ROWS - 0.5, 0.0, _TABLE_ROWS - 1.0)
    azimuth = sky.azimuth_from_sun(directions)
    column = np.minimum(azimuth / np.pi * (_COLUMNS - 1), _COLUMNS - 1 - 1e-9)
    parts = interpolated(_table(sky.air, sky.sun_elevation), column, row).reshape(-1, 3, 3)
    shown = _row_elevations(row)
    cosine = np.cos(shown) * np.cos(azimuth) * np.cos(sky.sun_elevation) + np.sin(shown) * np.sin(sky.sun_elevation)
    phases = np.stack([_molecular_phase(cosine), _aerosol_phase(cosine), np.ones_like(cosine)], axis=-1)
    return sky.color(np.einsum("nkc,nk->nc", parts, phases))


def multiple_scattering_sun(sky: Sky, elevations: Float64Array, solid_angle: float) -> Float64Array:
    """(n, 3) float64 scene-linear radiance of a sun of `solid_angle` (sr) seen at these elevations (n,), rad."""
    altitude = np.full_like(elevations, _altitude(sky.air))
    transmittance = _transmittance(np.sin(elevations), altitude, sky.air)
    return sky.color(transmittance * _IRRADIANCE @ _XYZ_FROM_SPECTRUM / solid_angle)


def _altitude(air: Air) -> float:
    return min(max(air.altitude, 1.0), 1000.0 * _THICKNESS - 1.0) / 1000.0


def _row_elevations(row: Float64Array) -> Float64Array:
    height = (row + 0.5) / _TABLE_ROWS * 2.0 - 1.0
    return np.copysign(height**2, height) * (0.5 * np.pi)


@lru_cache(maxsize=4)
def _table(air: Air, sun_elevation: float) -> Float64Array:
    """(256, 33, 9) CIE XYZ of light that arrives from directions, in three parts: scattered once by molecules and by
    aerosols, both before their phase functions, and scattered again.

    Rows as `_row_elevations` says, columns from the sun's azimuth to the opposite one.
    """
    elevation = _row_elevations(np.arange(_TABLE_ROWS, dtype=float))[:, None]
    azimuth = np.linspace(0.0, np.pi, _COLUMNS)
    rays = np.empty((_TABLE_ROWS, _COLUMNS, 3))
    rays[..., 0] = np.cos(elevation) * np.cos(azimuth)
    rays[..., 1] = np.cos(elevation) * np.sin(azimuth)
    rays[..., 2] = np.sin(elevation)
    sun = np.array([np.cos(sun_elevation), 0.0, np.sin(sun_elevation)])
    return _arriving(rays.reshape(-1, 3), sun, air).reshape(_TABLE_ROWS, _COLUMNS, 9)


def _arriving(rays: Float64Array, sun: Float64Array, air: Air) -> Float64Array:
    """(n, 9) CIE XYZ, in three parts as in `_table`, along rays (n, 3) from a point in `air`.

    Within a step the light is integrated analytically: Hillaire 2016, "Physically Based Sky, Atmosphere and Cloud
    Rendering in Frostbite", section 5.6.
    """
    origin = np.array([0.0, 0.0, _EARTH_RADIUS + _altitude(air)])
    step = (_distance_to_end(origin, rays) / _STEPS)[:, None]
    lookup = _transmittance_table(air)
    arriving = np.zeros((3, len(rays), 4))
    transmitted = np.ones((len(rays), 4))
    for index in range(_STEPS):
        points = origin + (index + 0.5) * step * rays
        distance = np.linalg.norm(points, axis=-1)
        molecular, aerosol, extinction = _coefficients(np.maximum(distance - _EARTH_RADIUS, 0.0), air)
        cosine = points @ sun / distance
        altitude = np.clip((distance - _EARTH_RADIUS) / _THICKNESS, 0.0, 1.0)
        to_sun = _looked_up(lookup, cosine, altitude)
        step_transmittance = np.exp(-step * extinction)
        share = transmitted * (1.0 - step_transmittance) / np.maximum(extinction, 1e-7)
        arriving[0] += share * molecular * to_sun
        arriving[1] += share * aerosol * to_sun
        arriving[2] += share * (molecular + aerosol) * _scattered_again(lookup, cosine, altitude, distance)
        transmitted = transmitted * step_transmittance
    return np.moveaxis(arriving * _IRRADIANCE @ _XYZ_FROM_SPECTRUM, 0, 1).reshape(-1, 9)


def _scattered_again(
    lookup: Float64Array, cosine: Float64Array, altitude: Float64Array, distance: Float64Array
) -> Float64Array:
    """(n, 4) light per unit of sunlight that the ground or the air scattered before; see the model's description."""
    ground_solid_angle = 2.0 * np.pi * (1.0 - np.sqrt(np.maximum(1.0 - (_EARTH_RADIUS / distance) ** 2, 0.0)))
    zenith, ground = np.ones_like(cosine), np.zeros_like(cosine)
    from_ground = _looked_up(lookup, zenith, ground) / _looked_up(lookup, zenith, altitude)
    to_ground = _looked_up(lookup, cosine, ground)
    reflected = ground_solid_angle / (4.0 * np.pi) * (_GROUND_ALBEDO / np.pi) * cosine
    fitted = 1.0 / (1.0 + 5.0 * np.exp(-17.92 * cosine))
    return _SCATTERED_AGAIN * fitted[:, None] + reflected[:, None] * to_ground * from_ground


@lru_cache(maxsize=4)
def _transmittance_table(air: Air) -> Float64Array:
    """(64, 256, 4) transmittance to space, by altitude 0…1 of the atmosphere and cosine of the zenith angle −1…1."""
    rows, columns = _TRANSMITTANCE_SHAPE
    altitude, cosine = np.meshgrid(np.linspace(0.0, _THICKNESS, rows), np.linspace(-1.0, 1.0, columns), indexing="ij")
    return _transmittance(cosine.ravel(), altitude.ravel(), air).reshape(rows, columns, 4)


def _looked_up(lookup: Float64Array, cosine: Float64Array, altitude: Float64Array) -> Float64Array:
    rows, columns = _TRANSMITTANCE_SHAPE
    column = np.minimum(np.clip(0.5 * cosine + 0.5, 0.0, 1.0) * (columns - 1), columns - 1 - 1e-9)
    return interpolated(lookup, column, np.minimum(altitude * (rows - 1), rows - 1 - 1e-9))


def _transmittance(cosine: Float64Array, altitude: Float64Array, air: Air) -> Float64Array:
    """(n, 4) share of light that comes from space to an altitude (n,), km, at a cosine (n,) of the zenith angle."""
    start = _EARTH_RADIUS + altitude
    length = np.sqrt((start * cosine) ** 2 - start**2 + _SPACE**2) - start * cosine
    depth = np.zeros((len(cosine), 4))
    for index in range(_STEPS):
        along = (index + 0.5) / _STEPS * length
        distance = np.sqrt(start**2 + along**2 + 2.0 * start * along * cosine)
        depth += _coefficients(np.maximum(distance - _EARTH_RADIUS, 0.0), air)[2]
    return np.exp(-depth * (length / _STEPS)[:, None])


def _coefficients(altitude: Float64Array, air: Air) -> tuple[Float64Array, Float64Array, Float64Array]:
    """(n, 4) each, 1/km: scattering by molecules and by aerosols, and extinction, at altitudes (n,) in km."""
    molecular = np.exp(-0.07771971 * altitude**1.16364243)[:, None] * _MOLECULAR_SCATTERING * air.molecules
    logarithm = np.log(np.maximum(altitude, 1e-4))
    ozone = 3.78547397e20 * np.exp(-((logarithm - 3.22261) ** 2) * 5.55555555 - logarithm) * air.ozone
    particles = _AEROSOL_DENSITY * np.exp(-altitude / _AEROSOL_HEIGHT) + _AEROSOL_BACKGROUND
    particles = (particles * air.aerosols)[:, None]
    aerosol = particles * _AEROSOL_SCATTERING
    extinction = molecular + aerosol + particles * _AEROSOL_ABSORPTION + ozone[:, None] * _OZONE_ABSORPTION
    return molecular, aerosol, extinction


def _distance_to_end(origin: Float64Array, rays: Float64Array) -> Float64Array:
    """(n,) km along unit rays (n, 3) from a point in the atmosphere to the ground, or else to space."""
    along = rays @ origin
    squared = float(origin @ origin)
    to_space = np.sqrt(along**2 - squared + _SPACE**2) - along
    discriminant = along**2 - squared + _EARTH_RADIUS**2
    hits = (along < 0.0) & (discriminant >= 0.0)
    return np.where(hits, -along - np.sqrt(np.maximum(discriminant, 0.0)), to_space)


def _molecular_phase(cosine: Float64Array) -> Float64Array:
    """Rayleigh's."""
    return 3.0 / (16.0 * np.pi) * (1.0 + cosine**2)


def _aerosol_phase(cosine: Float64Array) -> Float64Array:
    """Henyey and Greenstein 1941; `cosine` of the angle to the sun."""
    g = _AEROSOL_ASYMMETRY
    return (1.0 - g * g) / (4.0 * np.pi) / (1.0 + g * g - 2.0 * g * cosine) ** 1.5
