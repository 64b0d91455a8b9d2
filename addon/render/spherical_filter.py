# SPDX-License-Identifier: GPL-3.0-or-later
"""Blurs of radiance over the sphere by kernels that depend on the angle alone, through spherical harmonics.

Such a blur multiplies the harmonics of degree l by one number each (Funk and Hecke; see Ramamoorthi and Hanrahan 2001,
"An Efficient Representation for Irradiance Environment Maps", section 2), so that all roughnesses of one map share its
harmonics.

Blurred maps are grids of `ROWS` × `COLUMNS` + 1 nodes: row r has elevation (r/(ROWS − 1) − ½)·π, so that the first and
last are the poles, and column c has azimuth (½ − c/COLUMNS)·2π, so that the last repeats the first. Between nodes they
are interpolated linearly, with no seam and no wrapping.
"""

from functools import lru_cache

import numpy as np

from ..scene.arrays import Float32Array, Float64Array
from ..scene.equirectangular import box_sums, coarsened, look_up, texel_directions, texel_solid_angles

ROWS, COLUMNS = 161, 320
DEGREES = 160
"""Degrees 0 … 159 are kept: details of about 1°."""

_LARGEST_WIDTH = 1280  # columns of which harmonics are found; wider maps are gathered first
_COARSE = (3 * (ROWS - 1), 3 * COLUMNS)  # to which larger maps are averaged first
_ANGLES = 4096  # at which kernels are integrated


def harmonics(pixels: Float32Array) -> Float64Array:
    """(orders, degrees, 6) float64: real, then imaginary parts of three channels' harmonics of a map (H, W, 3).

    Each row's flux is shared between the two nearest rows of nodes, which moves nothing on average.
    """
    pixels = coarsened(pixels, *_COARSE)
    height, width = pixels.shape[:2]
    if height < ROWS - 1 or width < COLUMNS:
        height, width = max(height, 2 * (ROWS - 1)), max(width, 2 * COLUMNS)
        pixels = look_up(pixels, texel_directions(height, width)).astype(np.float32)
    columns = min(width, _LARGEST_WIDTH)
    rows = np.moveaxis(pixels, 2, 1)
    by_cell = rows if columns == width else box_sums(rows, np.linspace(0.0, width, columns + 1)) * (columns / width)
    # Azimuth 0 of the harmonics is the edge of the map, half a texel before its first column.
    phase = np.exp(-1j * np.pi / columns * np.arange(DEGREES))
    spectrum = np.fft.rfft(by_cell, axis=-1)[..., :DEGREES] * phase
    flux = spectrum * texel_solid_angles(height, columns)[:, None, None]
    place = (np.arange(height) + 0.5) / height * (ROWS - 1)
    shares = np.maximum(1.0 - np.abs(np.arange(ROWS)[:, None] - place), 0.0)
    waves = np.moveaxis((shares @ flux.reshape(height, -1)).reshape(ROWS, 3, DEGREES), 2, 0)
    return _legendre() @ np.concatenate([waves.real, waves.imag], axis=-1)


def blurred(coefficients: Float64Array, kernel: Float64Array) -> Float32Array:
    """(ROWS, COLUMNS + 1, 3) float32 ≥ 0: the map of which these are the `harmonics`, blurred by a kernel.

    `kernel` (degrees,): what each degree is multiplied by, as `lobe` or `cosine_lobe` give it.
    """
    count = int(np.flatnonzero(np.abs(kernel) > 1e-9 * abs(kernel[0]))[-1]) + 1
    kept = coefficients[:count, :count] * kernel[:count, None]
    waves = np.matmul(_legendre()[:count, :count].transpose(0, 2, 1), kept)
    spectrum = np.zeros((COLUMNS // 2 + 1, ROWS, 3), complex)
    spectrum[:count] = waves[..., :3] + 1j * waves[..., 3:]
    nodes = np.fft.irfft(spectrum, COLUMNS, axis=0) * COLUMNS
    closed = np.concatenate([nodes, nodes[:1]], axis=0)
    return np.ascontiguousarray(np.maximum(np.moveaxis(closed, 0, 1), 0.0), np.float32)


@lru_cache(maxsize=16)
def lobe(alpha: float) -> Float64Array:
    """(degrees,) of the GGX lobe about the reflected direction, for a view along the normal; its integral is 1.

    Radiance is weighted by D(h) · cos, h half-way between the normal and its direction: Karis 2013, "Real Shading in
    Unreal Engine 4", section on image-based lighting.
    """
    # Nodes get denser towards 0, where the lobe of a smooth surface is narrow.
    share = (np.arange(_ANGLES) + 0.5) / _ANGLES
    angle = 0.5 * np.pi * share**3
    step = 1.5 * np.pi * share**2 / _ANGLES
    a2 = alpha * alpha
    half = np.cos(0.5 * angle)
    density = a2 / (np.sin(0.5 * angle) ** 2 + a2 * half * half) ** 2
    weight = density * np.cos(angle) * np.sin(angle) * step
    return _legendre_polynomials(np.cos(angle)) @ weight / weight.sum()


def cosine_lobe() -> Float64Array:
    """(degrees,) of max(cos, 0): blurs radiance to irradiance. Ramamoorthi and Hanrahan 2001, eq. 7 and 8."""
    factors = np.zeros(DEGREES)
    factors[0], factors[1] = np.pi, 2.0 * np.pi / 3.0
    ratio = 0.5  # binomial(l, l/2) / 2^l at l = 2
    for degree in range(2, DEGREES, 2):
        sign = 1.0 if degree % 4 == 2 else -1.0
        factors[degree] = sign * 2.0 * np.pi * ratio / ((degree + 2) * (degree - 1))
        ratio *= (degree + 1.0) / (degree + 2.0)
    return factors


@lru_cache(maxsize=1)
def _legendre() -> Float64Array:
    """(orders, degrees, ROWS): associated Legendre functions at the rows' elevations, normalised over the sphere.

    Recurrences: Holmes and Featherstone 2002, "A unified approach to the Clenshaw summation", eq. 11 and 12.
    """
    elevation = (np.arange(ROWS) / (ROWS - 1) - 0.5) * np.pi
    sine, cosine = np.sin(elevation), np.cos(elevation)
    table = np.zeros((DEGREES, DEGREES, ROWS))
    orders = np.arange(DEGREES)
    table[0, 0] = np.sqrt(0.25 / np.pi)
    for order in range(1, DEGREES):
        table[order, order] = np.sqrt(1.0 + 0.5 / order) * cosine * table[order - 1, order - 1]
    for degree in range(1, DEGREES):
        lower = orders[:degree].astype(float)
        scale = np.sqrt((4.0 * degree**2 - 1.0) / (degree**2 - lower**2))
        back = np.sqrt(np.maximum((degree - 1.0) ** 2 - lower**2, 0.0) / (4.0 * (degree - 1.0) ** 2 - 1.0))
        before = table[:degree, degree - 2] if degree > 1 else 0.0
        table[:degree, degree] = scale[:, None] * (sine * table[:degree, degree - 1] - back[:, None] * before)
    return table


def _legendre_polynomials(x: Float64Array) -> Float64Array:
    """(degrees, n): P_l at x (n,), by Bonnet's recurrence."""
    table = np.ones((DEGREES, len(x)))
    table[1] = x
    for degree in range(2, DEGREES):
        table[degree] = ((2 * degree - 1) * x * table[degree - 1] - (degree - 1) * table[degree - 2]) / degree
    return table
