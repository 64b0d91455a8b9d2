# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions drawn from the world against integrals that are known in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from addon.render.world_sampling import UNIFORM_SHARE, WorldSampler
from addon.scene import EnvironmentMap, World
from addon.scene.equirectangular import look_up, texel_directions, texel_solid_angles

UP = np.array([0.0, 0.0, 1.0])


def lattice(count):
    """(count, 2) points of a rank-1 lattice: the error of smooth integrals falls as 1/count."""
    index = np.arange(count)
    return np.stack([(index * 0.7548776662466927 + 0.5) % 1.0, (index + 0.5) / count], axis=-1)


def world(pixels, radiance=(1.0, 1.0, 1.0), rotation=None):
    """A world of one map."""
    return World(radiance, EnvironmentMap("map", "map", 1, np.asarray(pixels, np.float32)), rotation)


def gray(values):
    """(H, W, 3) of (H, W)."""
    return np.repeat(np.asarray(values, np.float32)[..., None], 3, axis=2)


def irradiance(sampled, normal, count=4096):
    """(3,) of a surface with this normal."""
    directions, weights = WorldSampler(sampled).directions(lattice(count))
    return (weights * np.maximum(directions @ normal, 0.0)[:, None]).mean(axis=0)


def rotation_matrix(axis, angle):
    """Rodrigues' formula."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def test_one_colour_gives_pi_times_radiance():
    # The hemisphere's edge cuts the point set: an error of the order of 1/√count · 1/count, well below 1e-3 at 4096.
    assert irradiance(World((0.5, 1.0, 2.0)), UP) == pytest.approx(np.pi * np.array([0.5, 1.0, 2.0]), rel=1e-3)


def test_one_colour_is_drawn_evenly():
    directions, weights = WorldSampler(World((1.0, 2.0, 3.0))).directions(lattice(4096))
    assert weights == pytest.approx(np.broadcast_to([4 * np.pi, 8 * np.pi, 12 * np.pi], weights.shape))
    # z of points that fill a sphere evenly is uniform in −1…1: the lattice's own values, in order.
    assert np.sort(directions[:, 2]) == pytest.approx(np.linspace(-1.0, 1.0, 4097)[:-1] + 1.0 / 4096)
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(4096))


@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 0, 0), (-0.6, 0.0, 0.8)])
def test_gradient_world(normal):
    """L = 1 + z gives E(n) = π (1 + ⅔ n_z)."""
    pixels = gray(1.0 + texel_directions(128, 256)[..., 2])
    expected = np.pi * (1.0 + 2.0 / 3.0 * normal[2])
    # Bilinear interpolation between 128 rows: at most (π/128)²/8 of the amplitude; the rest is the 4096 points.
    assert irradiance(world(pixels), np.array(normal, float)) == pytest.approx([expected] * 3, rel=2e-3)


def test_a_sun_of_one_texel():
    """All light from one texel: its bilinear tent has the volume of one texel, E = L · Ω · cosine."""
    pixels = np.full((64, 128), 1e-3)
    pixels[50, 31] = 1e6
    direction = texel_directions(64, 128)[50, 31]
    solid_angle = texel_solid_angles(64, 128)[50]
    # The tent reaches half-way into rows of other solid angle: second order in their difference, < 0.3 %.
    value = irradiance(world(gray(pixels)), UP, 1 << 14)
    assert value == pytest.approx([1e6 * solid_angle * direction[2]] * 3, rel=1e-2)


def test_rotation_turns_the_light():
    pixels = np.zeros((64, 128))
    pixels[40, 20] = 1.0
    rotation = rotation_matrix(np.array([1.0, 2.0, -0.5]), 1.1)
    directions, weights = WorldSampler(world(gray(pixels), rotation=rotation)).directions(lattice(512))
    mean = (directions * weights[:, :1]).sum(axis=0)
    towards = rotation.T @ texel_directions(64, 128)[40, 20]
    assert mean / np.linalg.norm(mean) == pytest.approx(towards, abs=1e-2)


def test_black_map_has_no_weight():
    directions, weights = WorldSampler(world(np.zeros((4, 8, 3)))).directions(lattice(16))
    assert not weights.any()
    assert np.isfinite(directions).all()


@given(
    arrays.arrays(
        np.float32,
        st.tuples(st.integers(1, 9), st.integers(1, 9)),
        elements=st.one_of(st.just(0.0), st.floats(2.0**-20, 2.0**20, width=32)),
    ),
    st.tuples(*[st.floats(0.0, 10.0)] * 3),
)
def test_weights_are_bounded(values, radiance):
    """Whatever the map: unit directions, none of them much rarer than if all were drawn alike."""
    environment = world(gray(values), radiance)
    sampler = WorldSampler(environment)
    directions, weights = sampler.directions(lattice(256))
    shown = look_up(gray(values), directions) * radiance
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(256))
    assert (weights >= 0.0).all()
    assert (weights <= shown * (4.0 * np.pi / UNIFORM_SHARE) * (1.0 + 1e-6) + 1e-12).all()


@given(arrays.arrays(np.float32, (6, 12), elements=st.floats(0.0, 100.0, width=32)))
def test_weights_over_radiance_add_up_to_the_sphere(values):
    """Over the density that they are drawn with, directions stand for 4π sr in all."""
    bright = gray(values + np.float32(1.0))
    directions, weights = WorldSampler(world(bright)).directions(lattice(4096))
    assert (weights[:, 0] / look_up(bright, directions)[:, 0]).mean() == pytest.approx(4.0 * np.pi, rel=0.02)


def test_a_large_map_is_drawn_from_a_small_table():
    """Widths that are no multiple of the table's: nothing is lost, every cell is the mean of what it covers."""
    generator = np.random.default_rng(3)
    pixels = gray(generator.random((300, 700)) ** 8)
    total = (pixels[..., 0] * texel_solid_angles(300, 700)[:, None]).sum()
    _, weights = WorldSampler(world(pixels)).directions(lattice(1 << 15))
    # Noise from texel to texel within cells: relative deviation ≈ 2, divided by √32768 samples.
    assert weights[:, 0].mean() == pytest.approx(total, rel=0.05)
