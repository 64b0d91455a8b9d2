# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import replace
from math import inf, log, pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.render.light_reach import (
    MANY_LIGHTS,
    extent,
    farthest_reach,
    full_reach,
    lights_out_of_reach,
    peak_intensity,
    roulette,
    rounded_reach,
    sampled_reach,
)
from addon.render.memory import Memory
from addon.scene import AreaShape, LightKind
from blender_tests import builders

THRESHOLD = 0.01


def reach_of(light, threshold=THRESHOLD):
    """R0 of one of many equal lights."""
    count = MANY_LIGHTS + 1
    return full_reach(np.full(count, peak_intensity(light)), np.full(count, extent(light)), threshold)[0]


def irradiance(light, position, points=65):
    """E (W/m²) at a position (3,) of a surface that faces the light's middle, by a midpoint sum over an area light."""
    center, rotation = light.world_from_light[:3, 3], light.world_from_light[:3, :3]
    towards = center - position
    normal = towards / np.linalg.norm(towards)
    if light.kind is not LightKind.AREA:
        return max(light.emission) / (towards @ towards)
    u = (np.arange(points) + 0.5) / points - 0.5
    x, y = (axis.ravel() for axis in np.meshgrid(u, u))
    if light.shape is AreaShape.ELLIPSE:
        inside = x * x + y * y <= 0.25
        x, y = x[inside], y[inside]
    spread = light.size * np.column_stack([x, y])
    to_light = center + spread @ rotation[:, :2].T - position
    distance = np.linalg.norm(to_light, axis=1)
    cosine = to_light @ rotation[:, 2] / distance
    received = np.maximum(to_light @ normal / distance, 0.0) * np.maximum(cosine, 0.0) / distance**2
    if light.spread < pi:
        half = 0.5 * light.spread
        slope = np.sqrt(np.maximum(1.0 - cosine**2, 0.0)) / np.maximum(cosine, 1e-12)
        received *= np.maximum(np.tan(half) - slope, 0.0) / (np.tan(half) - half)
    return max(light.emission) * float(received.sum()) * light.size[0] * light.size[1] / points**2


AREA = builders.light(LightKind.AREA, emission=(3.0, 50.0, 1.0), size=(1.5, 0.4))
LAMPS = [
    builders.light(LightKind.POINT, emission=(5.0, 1.0, 2.0), radius=0.3),
    builders.light(LightKind.SPOT, emission=(5.0, 1.0, 2.0), angle=1.0),
    AREA,
    replace(AREA, spread=0.4),
    replace(AREA, spread=2.5, shape=AreaShape.ELLIPSE),
]


@pytest.mark.parametrize("light", LAMPS)
def test_beyond_its_full_reach_no_light_brightens_a_white_surface_more_than_the_threshold(light):
    full = reach_of(light)
    directions = np.random.default_rng(1).normal(size=(200, 3))
    directions[0] = (0.0, 0.0, -1.0)
    for direction in directions / np.linalg.norm(directions, axis=1, keepdims=True):
        position = light.world_from_light[:3, 3] + full * direction
        assert irradiance(light, position) / pi <= THRESHOLD * (1.0 + 1e-12)  # rounding
    straight_ahead = light.world_from_light[:3, 3] - (0.0, 0.0, full - extent(light))
    # As tight as the inverse square of the nearest point is: the light's farthest point falls behind it by no more.
    slack = ((full - extent(light)) / np.hypot(full - extent(light), extent(light))) ** 4
    near_axis = 1.0 if light.spread >= pi else 1.0 - extent(light) / (full - extent(light)) / np.tan(light.spread / 2)
    assert irradiance(light, straight_ahead) / pi >= THRESHOLD * slack * near_axis * (1.0 - 1e-2)  # the sum's


def test_factors_count_and_suns_reach_everywhere():
    lamp = LAMPS[0]
    assert reach_of(replace(lamp, diffuse_factor=0.25, specular_factor=0.0)) - 0.3 == pytest.approx(
        0.5 * (reach_of(lamp) - 0.3)
    )
    assert reach_of(builders.light(LightKind.SUN)) == inf
    assert reach_of(builders.light(LightKind.SUN, emission=(0.0, 0.0, 0.0))) == 0.0
    assert reach_of(replace(lamp, emission=(0.0, 0.0, 0.0))) == 0.0
    assert reach_of(lamp, threshold=0.0) == inf


def test_few_lights_reach_everywhere():
    intensities, extents = np.full(MANY_LIGHTS, 2.0), np.zeros(MANY_LIGHTS)
    intensities[3] = 0.0
    assert full_reach(intensities, extents, THRESHOLD).tolist() == [inf] * 3 + [0.0] + [inf] * 12


SAMPLES = 1 << 14


@pytest.mark.parametrize("seed", [0, 5])
@pytest.mark.parametrize("key", ["lamp", "another"])
def test_the_mean_over_samples_is_the_whole_light(seed, key):
    """[d < R]·max(1, d²/R0²), R0 = 1. The star discrepancy of N steps by √2, whose partial quotients are 2, is at most
    (3 + (1/log φ + 2/log 3) log N)/N (Kuipers and Niederreiter 1974, ch. 2, theorem 3.4)."""
    xi = roulette([key] * SAMPLES, np.arange(SAMPLES), seed)
    assert xi.min() > 0.0
    assert xi.max() <= 1.0
    golden = 0.5 + sqrt(1.25)
    discrepancy = (3.0 + (1.0 / log(golden) + 2.0 / log(3.0)) * log(SAMPLES)) / SAMPLES
    for distance in (0.0, 0.5, 1.0 - 1e-9, 1.3, 4.0, 6.0):
        weight = (distance < sampled_reach(np.ones(SAMPLES), xi)) * max(1.0, distance**2)
        assert abs(weight.mean() - 1.0) <= (discrepancy * distance**2 if distance > 1.0 else 0.0)


def test_numbers_are_as_random_as_the_lights_and_nothing_to_others():
    keys = [f"OB lamp.{index:03d}" for index in range(1000)]
    xi = roulette(keys, np.full(1000, 3), 7)
    even = (np.arange(1000) + 0.5) / 1000
    assert np.abs(np.sort(xi) - even).max() < 1.95 / sqrt(1000)  # Kolmogorov and Smirnov: 1 of 1000 would be above
    assert np.array_equal(roulette(keys[5:9], np.full(4, 3), 7), xi[5:9])
    assert not np.array_equal(roulette(keys, np.full(1000, 3), 8), xi)


@given(st.integers(1, 40), st.integers(1, 70), st.integers(0, 1000))
def test_the_farthest_reach_is_that_of_the_luckiest_sample(count, samples, seed):
    full, keys = np.arange(1.0, count + 1.0), [str(index) for index in range(count)]
    every = [sampled_reach(full, roulette(keys, np.full(count, sample), seed)) for sample in range(samples)]
    assert np.array_equal(farthest_reach(full, keys, samples, seed), np.max(every, axis=0))


def test_rounded_reaches_are_few_and_never_shorter():
    full = np.array([0.0, inf, *np.full(500, 0.3)])
    reach = sampled_reach(full, roulette([str(index) for index in range(502)], np.arange(502), 1))
    rounded = rounded_reach(full, reach)
    assert rounded[:2].tolist() == [0.0, inf]
    assert (rounded[2:] >= reach[2:]).all()
    assert (rounded[2:] < 2.0 * reach[2:]).all()
    assert len(set(rounded[2:].tolist())) < 10


def left_out(lights, reaches, **changes):
    """Reasons by light of a scene with one box of half size 1 about the origin, seen from z = 3 within ±45°."""
    scene = builders.scene(builders.box("box"))
    scene = replace(scene, batches=tuple(replace(batch, **changes) for batch in scene.batches))
    camera = builders.camera(clip_end=10.0)
    return dict(lights_out_of_reach(lights, np.array(reaches, np.float64), scene, camera, Memory()))


def test_lights_are_left_out_that_are_off_or_reach_nothing_in_the_picture():
    off = builders.light(emission=(0.0, 0.0, 0.0))
    without_influence = builders.light(diffuse_factor=0.0, specular_factor=0.0)
    beside, behind = builders.light(position=(4.0, 0.0, 0.0)), builders.light(position=(0.0, 0.0, 9.0))
    linked = builders.light(receiver_groups=0b10)
    lights = [off, without_influence, beside, beside, behind, behind, linked, builders.light(LightKind.SUN)]
    reasons = left_out(lights, [0.0, 0.0, 2.9, 3.1, 5.9, 8.1, inf, inf])
    assert sorted(reasons) == [0, 1, 2, 4, 6]
    assert "off" in reasons[0]
    assert "off" in reasons[1]
    assert "beyond 2.9 m" in reasons[2]
    assert "linked" in reasons[6]
    assert sorted(left_out(lights, [0.0, 0.0, 2.9, 3.1, 5.9, 8.1, inf, inf], link_group=1)) == [0, 1, 2, 4]


def test_a_light_that_only_reaches_what_is_out_of_view_is_left_out():
    scene = builders.scene(builders.quad("seen"), builders.quad("unseen", center=(50.0, 0.0)))
    lamp = builders.light(position=(50.0, 0.0, 1.0))
    camera = builders.camera()
    out = lights_out_of_reach([lamp], np.array([5.0]), scene, camera, Memory())
    assert [index for index, _ in out] == [0]
    assert not lights_out_of_reach([lamp], np.array([60.0]), scene, camera, Memory())
