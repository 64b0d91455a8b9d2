# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter pass alone, on gathered irradiance and G-buffers that the tests write."""

from itertools import pairwise

import numpy as np
import pytest
from gathered import (
    Plane,
    Surfaces,
    frame,
    gathered_pixels,
    irradiance,
    prepare,
    see,
    wide_camera,
    write,
    write_surfaces,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from addon.render import gl_thread
from addon.render.indirect_plan import GATHERED_TARGET, IRRADIANCE_TARGET, plan_filters
from addon.render.passes.filter import ITERATIONS, FilterPass, iterations
from addon.render.targets import TexturePool
from addon.scene import RenderSettings
from addon.scene.indirect import IndirectSettings

ULP = float(np.finfo(np.float32).eps)
FLOOR = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
COLOR = np.array([3.0, 0.7, 12.5])
NOISY = 1e8  # a variance for which all differences are noise
divisors = pytest.mark.parametrize("divisor", [1, 2, 4])
sizes = pytest.mark.parametrize("size", [(40, 24), (41, 23), (1, 1), (5, 2)], ids=str)
projections = pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])


def smoothed(surfaces, gathered, divisor=1, *, index=0, spatial=True, camera=None, guard_band=0):
    """What the pass writes (H, W, 4), guard band included, of gathered texels on surfaces that it surrounds."""
    height, width = surfaces.depth.shape
    size = (width - 2 * guard_band, height - 2 * guard_band)
    indirect = IndirectSettings(divisor=divisor, spatial_filter=spatial)
    planned = plan_filters(RenderSettings(*size, indirect=indirect), GATHERED_TARGET, [], blends=False, filters=True)

    def job(device):
        pool, render_pass = TexturePool(device), FilterPass(device)
        try:
            prepare(pool, planned, size, divisor, guard_band)
            write_surfaces(pool, surfaces)
            write(pool, GATHERED_TARGET, gathered.astype(np.float32))
            render_pass.run(frame(device, pool, camera or wide_camera(), divisor, index), planned[0])
            for target in planned[0].writes:
                assert np.isfinite(np.frombuffer(pool.read(target.name), np.float32)).all(), target.name
            values = np.frombuffer(pool.read(IRRADIANCE_TARGET), np.float32).reshape(height, width, 4)
            assert device.context.error == "GL_NO_ERROR"
            return values
        finally:
            render_pass.release()
            pool.release()

    return gl_thread().submit(job).result()


def shape_of(surfaces, divisor):
    """Rows and columns of the gathered target."""
    return tuple(-(-extent // divisor) for extent in surfaces.depth.shape)


def kernel(count):
    """The weights (N, N) of a number of iterations where nothing stops them."""
    result = np.ones((1, 1))
    for level in range(count):
        tap = np.zeros(2 * 2**level + 1)
        tap[:: 2**level] = 0.25, 0.5, 0.25
        result = np.array([np.convolve(row, tap) for row in result])
        result = np.array([np.convolve(column, tap) for column in result.T]).T
    return result


@divisors
@sizes
@projections
def test_a_constant_stays_constant(divisor, size, orthographic):
    """On planes of all slopes, at edges and corners, whatever the noise. Each step divides two sums of at most nine."""
    camera = wide_camera(orthographic)
    slanted = np.array([0.6, -0.2, 1.0]) / np.sqrt(1.4)
    for normal in ((0.0, 0.0, 1.0), tuple(slanted)):
        surfaces = see(camera, *size, Plane((0.0, 0.0, 0.0), normal))
        gathered = irradiance(COLOR, 0.5, shape_of(surfaces, divisor))
        for index in (0, 3):
            result = smoothed(surfaces, gathered, divisor, index=index, camera=camera)
            np.testing.assert_allclose(result[..., :3], np.broadcast_to(COLOR, (*size[::-1], 3)), rtol=50 * ULP)


@divisors
@pytest.mark.parametrize("edge", ["depth", "normal"])
@pytest.mark.parametrize("index", [0, 2])
def test_nothing_leaks_over_an_edge(divisor, edge, index):
    """Noise without bound, so that only geometry can tell the two sides apart: what is dark stays exactly dark."""
    step = np.sin(np.radians(15.0)), np.cos(np.radians(15.0))
    right = {
        # Farther behind than four pixels are wide there.
        "depth": Plane((0.0, 0.0, -4.0), (0.0, 0.0, 1.0), "right"),
        # Two walls that meet in the middle of the picture, 30° apart.
        "normal": Plane((0.0, 0.0, 0.0), (step[0], 0.0, step[1]), "right"),
    }[edge]
    tilt = (-step[0], 0.0, step[1]) if edge == "normal" else (0.0, 0.0, 1.0)
    size = (42, 20)
    surfaces = see(wide_camera(), *size, Plane((0.0, 0.0, 0.0), tilt, "left"), right)
    dark = np.broadcast_to(np.arange(size[0]) >= size[0] // 2, size[::-1])
    texel_dark = dark[np.ix_(*gathered_pixels(*size, divisor, index))]
    gathered = irradiance(np.where(texel_dark[..., None], 0.0, COLOR), NOISY, texel_dark.shape)
    result = smoothed(surfaces, gathered, divisor, index=index)
    np.testing.assert_array_equal(result[dark][:, :3], 0.0)
    np.testing.assert_allclose(result[~dark][:, :3], np.broadcast_to(COLOR, ((~dark).sum(), 3)), rtol=50 * ULP)


def test_what_is_no_noise_stays():
    """An edge of light on one plane, found without noise, is not smoothed at all."""
    surfaces = see(wide_camera(), 32, 20, FLOOR)
    gathered = irradiance(1.0, 0.0, (20, 32))
    gathered[:, 16:, :3] = 1.001
    np.testing.assert_allclose(smoothed(surfaces, gathered)[..., :3], gathered[..., :3], rtol=4 * ULP)


@projections
@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.1, -0.7, np.sqrt(0.5))], ids=str)
def test_noise_falls_as_the_kernel_says(orthographic, normal):
    """Of a texel that differs alone, neighbours get the kernel's weights, on planes of all slopes; variances add up
    with the squares of the weights."""
    size, weights, camera = 31, kernel(ITERATIONS), wide_camera(orthographic)
    surfaces = see(camera, size, size, Plane((0.0, 0.0, 0.0), normal))
    gathered = irradiance(1.0, NOISY, (size, size))
    gathered[size // 2, size // 2, :3] = 2.0
    result = smoothed(surfaces, gathered, camera=camera)
    reach = len(weights) // 2
    inside = slice(size // 2 - reach, size // 2 + reach + 1)
    np.testing.assert_allclose(result[inside, inside, 1] - 1.0, weights, atol=50 * ULP)
    # Exact at the first iteration; after that the sum takes neighbours for independent, as Schied et al. do.
    factor = np.prod([(kernel(1) ** 2).sum()] * ITERATIONS)
    np.testing.assert_allclose(result[size // 2, size // 2, 3], NOISY * factor, rtol=1e-5)


def test_the_variance_of_a_noisy_constant_falls():
    """Normal noise of known variance. The mean of 48² texels at most: the kernel's factor holds to
    4 √(2 · correlated texels / all) of itself, and weights that tell noise from light leave no more than twice that."""
    size, deviation = 48, 0.2
    surfaces = see(wide_camera(), size, size, FLOOR)
    noise = np.random.default_rng(5).normal(1.0, deviation, (size, size))
    result = smoothed(surfaces, irradiance(noise[..., None], deviation**2, (size, size)))
    weights = kernel(ITERATIONS)
    factor = (weights**2).sum()
    bound = factor * (1.0 + 4.0 * np.sqrt(2.0 / factor) / size)
    assert result[..., 1].var() < 2.0 * bound * deviation**2
    assert abs(result[..., 1].mean() - 1.0) < 4.0 * deviation / size


def test_skewed_noise_does_not_darken():
    """Rays find 0 three times out of four and 4 else, a lamp that is seldom hit: the mean stays, to four standard
    deviations of the mean of as many texels of eight rays each."""
    size, rays = 64, 8
    hits = 4.0 * (np.random.default_rng(2).random((rays, size, size)) < 0.25)
    surfaces = see(wide_camera(), size, size, FLOOR)
    gathered = irradiance(hits.mean(axis=0)[..., None], hits.var(axis=0, ddof=1) / rays, (size, size))
    result = smoothed(surfaces, gathered)
    assert abs(result[..., 1].mean() - gathered[..., 1].mean()) < 4.0 * np.sqrt(3.0 / rays) / size


@divisors
def test_light_that_grows_evenly_is_interpolated(divisor):
    """Linear across a plane that faces the camera: what is between the texels is exact, to rounding."""
    size = (37, 22)
    surfaces = see(wide_camera(), *size, FLOOR)
    rows, columns = gathered_pixels(*size, divisor)
    ramp = 1.0 + np.arange(size[0])[None, :] + 3.0 * np.arange(size[1])[:, None]
    gathered = irradiance(ramp[np.ix_(rows, columns)][..., None], 0.0, shape_of(surfaces, divisor))
    result = smoothed(surfaces, gathered, divisor, spatial=False)
    # The last texel may be for pixels beyond the picture, and is then found from its last pixel.
    inside = np.ix_(range(rows[0], rows[-2] + 1), range(columns[0], columns[-2] + 1))
    np.testing.assert_allclose(result[..., 1][inside], ramp[inside], rtol=20 * ULP)


@divisors
def test_the_sky_gives_and_takes_nothing(divisor):
    """Texels of the sky hold light, though they should not: none of it arrives anywhere."""
    size = (40, 24)
    surfaces = see(wide_camera(), *size, Plane(FLOOR.point, FLOOR.normal, "left"))
    sky = np.isinf(surfaces.depth)
    texel_sky = sky[np.ix_(*gathered_pixels(*size, divisor))]
    gathered = irradiance(np.where(texel_sky[..., None], 1e6, COLOR), NOISY, texel_sky.shape)
    result = smoothed(surfaces, gathered, divisor)
    np.testing.assert_array_equal(result[sky], 0.0)
    np.testing.assert_allclose(result[~sky][:, :3], np.broadcast_to(COLOR, ((~sky).sum(), 3)), rtol=50 * ULP)


@pytest.mark.parametrize("behind", [(), (Plane((0.0, 0.0, -5.0), (0.0, 0.0, 1.0)),)], ids=["sky", "wall"])
def test_what_no_texel_sees_takes_the_light_that_is_nearest_in_depth(behind):
    """A column of pixels between the texels, beside a half-wall a metre behind it; the nearest texels see what is far
    behind, or nothing. Never black."""
    size, divisor = (40, 24), 4
    surfaces = see(wide_camera(), *size, Plane(FLOOR.point, FLOOR.normal, "left"), *behind)
    column = gathered_pixels(*size, divisor)[1][4] + 3
    surfaces.depth[:, column] = 2.0
    surfaces.normal[:, column] = (1.0, 0.0, 0.0)
    left = surfaces.depth < 4.0
    texel_left = left[np.ix_(*gathered_pixels(*size, divisor))]
    gathered = irradiance(np.where(texel_left[..., None], COLOR, 50.0 * COLOR), 0.0, texel_left.shape)
    result = smoothed(surfaces, gathered, divisor)
    np.testing.assert_allclose(result[:, column, :3], np.broadcast_to(COLOR, (size[1], 3)), rtol=50 * ULP)


def test_a_speck_in_the_sky_is_lit_by_what_is_near():
    """No texel beside it sees anything."""
    surfaces = see(wide_camera(), 40, 24, Plane(FLOOR.point, FLOOR.normal, "left"))
    surfaces.depth[11, 29] = 3.5
    result = smoothed(surfaces, irradiance(COLOR, 0.0, (6, 10)), 4)
    np.testing.assert_allclose(result[11, 29, :3], COLOR, rtol=50 * ULP)


@divisors
@pytest.mark.parametrize("trouble", [np.nan, np.inf, -np.inf, 1e30])
@pytest.mark.parametrize("component", [0, 3])
def test_what_is_no_number_is_filled_from_around(divisor, trouble, component):
    size = (40, 24)
    surfaces = see(wide_camera(), *size, FLOOR)
    gathered = irradiance(COLOR, NOISY, shape_of(surfaces, divisor))
    gathered[2, 3, component] = trouble
    result = smoothed(surfaces, gathered, divisor)
    np.testing.assert_allclose(result[..., :3], np.broadcast_to(COLOR, (*size[::-1], 3)), rtol=50 * ULP)


@pytest.mark.parametrize("spatial", [True, False])
def test_the_guard_band_is_filtered_like_the_picture(spatial):
    surfaces = see(wide_camera(), 33, 27, FLOOR)
    result = smoothed(surfaces, irradiance(COLOR, 0.5, (14, 17)), 2, spatial=spatial, guard_band=5)
    np.testing.assert_allclose(result[..., :3], np.broadcast_to(COLOR, (27, 33, 3)), rtol=50 * ULP)


def test_smoothing_fades_out_as_samples_accumulate():
    """The farther a film has come, the less of an edge of light is smoothed, and from some sample on nothing is: so its
    mean tends to that of what was gathered."""
    surfaces = see(wide_camera(), 32, 20, FLOOR)
    gathered = irradiance(1.0, NOISY, (20, 32))
    gathered[:, 16:, :3] = 2.0
    errors = [
        np.abs(smoothed(surfaces, gathered, index=index)[..., :3] - gathered[..., :3]).mean()
        for index in (0, 2, 7, 20, 50)
    ]
    assert all(later < earlier for earlier, later in pairwise(errors))
    last = next(index for index in range(100) if iterations(index) == 0.0)
    np.testing.assert_array_equal(smoothed(surfaces, gathered, index=last)[..., :3], gathered[..., :3])


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from([1, 2, 4]),
    hnp.arrays(np.float32, (6, 7, 4), elements=st.floats(width=32)),
    hnp.arrays(np.float64, (12, 14), elements=st.sampled_from([1e-4, 1.0, 3.0, 3.01, 1e7, np.inf])),
    st.integers(0, 2**32 - 1),
)
def test_all_is_finite_and_between_what_was_gathered(divisor, gathered, depth, seed):
    normal = np.random.default_rng(seed).normal(size=(12, 14, 3))
    normal[..., 2] = np.abs(normal[..., 2]) + 0.1
    surfaces = Surfaces(depth, normal / np.linalg.norm(normal, axis=-1, keepdims=True))
    gathered = np.tile(gathered, (2, 2, 1))[: -(-12 // divisor), : -(-14 // divisor)]
    gathered[..., 3] = np.abs(gathered[..., 3])
    result = smoothed(surfaces, gathered, divisor)
    assert np.isfinite(result).all()
    usable = gathered[(np.abs(gathered) <= 1e29).all(axis=-1)][:, :3]
    most = np.abs(usable).max(initial=0.0)
    assert (np.abs(result[..., :3]) <= most * (1 + 50 * ULP)).all()
