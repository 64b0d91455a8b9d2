# SPDX-License-Identifier: GPL-3.0-or-later
from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.render.light_samples import (
    ball_points,
    disk_points,
    folded,
    held_points,
    lattice_points,
    light_shifts,
    points_used,
    spiral_points,
    square_points,
)

COUNTS = st.integers(1, 4096)


def shift(seed):
    """(1, 3) in [0, 1)."""
    return np.random.default_rng(seed).random((1, 3))


def lattice(count, start=0, stop=None, seed=0):
    """Successive points (N, 3) of one light's lattice."""
    numbers = np.arange(start, count if stop is None else stop)
    return lattice_points(numbers, count, np.repeat(shift(seed), len(numbers), axis=0))


def star_discrepancy(values):
    """Of points (N,) in [0, 1): the greatest deviation of their distribution function from the even one."""
    ordered = np.sort(values)
    count = len(values)
    return max((np.arange(1, count + 1) / count - ordered).max(), (ordered - np.arange(count) / count).max())


@given(st.integers(0, 500), st.integers(0, 300), st.integers(0, 80))
def test_lights_take_turns(light_count, sample, updates):
    """None goes back, at most `updates` go on, none falls behind by more than one, all begin with their first point."""
    now = held_points(light_count, sample, updates)
    assert now.shape == (light_count,)
    assert (held_points(light_count, 0, updates) == 0).all()
    if light_count == 0:
        return
    assert now.max() - now.min() <= 1
    steps = held_points(light_count, sample + 1, updates) - now
    assert set(np.unique(steps)) <= {0, 1}
    assert steps.sum() == min(updates, light_count)


@given(st.integers(0, 500), st.integers(1, 300), st.integers(0, 80))
def test_a_film_uses_as_many_points_as_are_laid_out(light_count, samples, updates):
    count = points_used(light_count, samples, updates)
    assert count >= 1
    if light_count:
        assert held_points(light_count, samples - 1, updates).max() == count - 1


def test_no_samples_use_one_point():
    assert points_used(0, 0, 0) == points_used(5, 0, 3) == 1


@given(COUNTS, st.integers(0, 2**32 - 1))
def test_a_lattice_is_even_along_each_axis(count, seed):
    """All points: one in each of `count` equal stretches of every axis, up to the shift."""
    points = lattice(count, seed=seed)
    assert ((points >= 0.0) & (points < 1.0)).all()
    stretches = np.sort(np.mod(points - shift(seed), 1.0), axis=0)
    # A coordinate that rounds to just below 1 is one that rounds to 0.
    gaps = np.diff(np.concatenate([stretches, stretches[:1] + 1.0]), axis=0)
    np.testing.assert_allclose(gaps, 1.0 / count, atol=1e-9)


@given(st.integers(16, 4096), st.floats(0.0, 1.0))
def test_a_film_that_is_stopped_early_has_seen_all_of_a_light(count, begin):
    """Any 16 successive points: along no axis is a stretch missing; random ones' discrepancy is about 0.87/√16."""
    start = int(begin * (count - 16))
    points = lattice(count, start, start + 16)
    assert max(star_discrepancy(points[:, axis]) for axis in range(3)) < 0.25


@pytest.mark.parametrize("count", [16, 64, 100, 256, 1024])
def test_a_lattice_integrates_better_than_chance(count):
    """Smooth functions of each two axes: the error of the mean over all shifts, against σ/√n of random points."""
    errors = []
    for seed in range(32):
        points = folded(lattice(count, seed=seed))
        product = (points[:, [0, 0, 1]] * points[:, [1, 2, 2]]).mean(axis=0)
        errors.append(product - 0.25)
    chance = sqrt(1.0 / 9.0 - 1.0 / 16.0) / sqrt(count)
    assert (np.sqrt(np.mean(np.square(errors), axis=0)) < 0.5 * chance).all()


@given(st.lists(st.text(max_size=8), max_size=20, unique=True), st.integers(0, 2**31 - 1))
def test_where_a_lights_points_begin_does_not_depend_on_other_lights(keys, seed):
    shifts = light_shifts(keys, seed)
    assert shifts.shape == (len(keys), 3)
    assert ((shifts >= 0.0) & (shifts < 1.0)).all()
    for key, row in zip(keys, shifts, strict=True):
        np.testing.assert_array_equal(light_shifts([key], seed)[0], row)


def test_lights_and_seeds_begin_elsewhere():
    shifts = light_shifts([f"lamp {index}" for index in range(500)], 0)
    assert len(np.unique(shifts[:, 0])) == 500
    np.testing.assert_allclose(shifts.mean(axis=0), 0.5, atol=4.0 / sqrt(12 * 500))
    assert not np.isclose(light_shifts(["lamp"], 1), light_shifts(["lamp"], 2)).any()


def test_folding_is_even_and_has_no_seam():
    u = (np.arange(1000) + 0.5) / 1000
    np.testing.assert_allclose(np.sort(folded(u))[::2], np.sort(folded(u))[1::2])
    assert star_discrepancy(folded(u)) <= 2.0 / 1000 + 1e-12
    assert folded(np.array([0.0, 1.0])).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("count", [255, 1024])
def test_square_points_have_the_moments_of_the_square(count):
    points = square_points(lattice(count))
    assert (np.abs(points[:, :2]) <= 1.0).all()
    assert not points[:, 2].any()
    np.testing.assert_allclose(points[:, :2].mean(axis=0), 0.0, atol=4.0 / count)
    np.testing.assert_allclose((points[:, :2] ** 2).mean(axis=0), 1.0 / 3.0, atol=4.0 / count)
    assert abs((points[:, 0] * points[:, 1]).mean()) < 1.0 / sqrt(count)


@pytest.mark.parametrize("count", [255, 1024])
def test_disk_points_are_uniform_in_the_disk(count):
    """r² is even in [0, 1), and so is the angle; ∫ of r² is ½, of (x², y²) ¼."""
    points = disk_points(lattice(count))
    squared = (points[:, :2] ** 2).sum(axis=1)
    assert not points[:, 2].any()
    assert squared.max() <= 1.0 + 1e-12
    assert star_discrepancy(squared) < 3.0 / count
    assert star_discrepancy(np.arctan2(points[:, 1], points[:, 0]) / (2 * pi) + 0.5) < 3.0 / count
    np.testing.assert_allclose((points[:, :2] ** 2).mean(axis=0), 0.25, atol=0.5 / sqrt(count))


def balls(count, seed=0):
    """All points (count, 3) of one light's ball."""
    return ball_points(np.arange(count), count, np.repeat(shift(seed), count, axis=0))


@given(st.integers(1, 300), st.integers(0, 2**32 - 1))
def test_points_of_the_ball_come_in_opposite_pairs(count, seed):
    points = balls(count, seed)
    assert (np.linalg.norm(points, axis=1) <= 1.0 + 1e-12).all()
    pairs = points[: count // 2 * 2].reshape(-1, 2, 3)
    np.testing.assert_allclose(pairs[:, 0], -pairs[:, 1], atol=1e-15)


@pytest.mark.parametrize("direction", [(0, 0, 1), (1, 0, 0), (0.6, 0.0, 0.8), (0.48, -0.6, 0.64)])
def test_the_ball_is_a_uniform_disk_from_every_side(direction):
    """r² of the disk that a direction sees is even in [0, 1): its distribution and moments."""
    points = balls(4096)
    along = points @ np.array(direction, float)
    squared = (points**2).sum(axis=1) - along**2
    assert star_discrepancy(squared) < 0.02
    np.testing.assert_allclose((points**2).mean(axis=0), 0.25, atol=2e-3)
    for power in (1, 2, 3):
        assert (squared**power).mean() == pytest.approx(1.0 / (power + 1.0), abs=3e-3)


def test_the_ball_seen_as_a_disk_is_as_even_in_angle():
    points = balls(4096)
    assert star_discrepancy(np.arctan2(points[:, 1], points[:, 0]) / (2 * pi) + 0.5) < 0.02


@given(st.integers(1, 2048), st.floats(0.0, 1.0, exclude_max=True))
def test_a_spiral_has_one_point_per_equal_zone(count, start):
    """However many, in whatever order: shares of the sphere below are the middles of `count` equal zones."""
    points = spiral_points(np.arange(count), count, start)
    assert ((points >= 0.0) & (points < 1.0)).all()
    np.testing.assert_allclose(np.sort(points[:, 1]), (np.arange(count) + 0.5) / count, rtol=1e-12)


def on_sphere(points):
    """Unit vectors (N, 3) of (azimuth, share below)."""
    z = 2.0 * points[:, 1] - 1.0
    around = np.sqrt(1.0 - z * z)
    azimuth = 2.0 * pi * points[:, 0]
    return np.stack([around * np.cos(azimuth), around * np.sin(azimuth), z], axis=-1)


@pytest.mark.parametrize("count", [64, 256, 1000])
def test_no_two_points_of_a_spiral_are_near_each_other(count):
    """Each has 4π/n of the sphere; a Fibonacci spiral's nearest neighbours are about 3.1/√n apart, chance's 0.02/√n."""
    directions = on_sphere(spiral_points(np.arange(count), count, 0.3))
    cosines = directions @ directions.T - 2.0 * np.eye(count)
    assert np.arccos(cosines.max()) > 2.5 / sqrt(count)


@given(st.integers(16, 4096), st.sampled_from([8, 16, 32, 64]))
def test_a_film_that_is_stopped_early_has_seen_all_of_the_world(count, length):
    """The mean of its directions is 0; that of as many random ones has the length 1/√n."""
    length = min(length, count)
    directions = on_sphere(spiral_points(np.arange(length), count, 0.3))
    assert np.linalg.norm(directions.mean(axis=0)) < 0.8 / sqrt(length)


@given(st.integers(64, 4096), st.floats(0.0, 1.0))
def test_later_parts_of_a_spiral_are_spread_as_well(count, begin):
    start = int(begin * (count - 64))
    directions = on_sphere(spiral_points(np.arange(start, start + 64), count, 0.3))
    assert np.linalg.norm(directions.mean(axis=0)) < 1.0 / sqrt(64)
