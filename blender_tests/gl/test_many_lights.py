# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures with many lights: tiles, reach and roulette against sums over all lights in numpy."""

from dataclasses import replace

import numpy as np
import pytest

from addon.render.light_reach import MANY_LIGHTS, roulette, sampled_reach
from addon.scene import Channel
from blender_tests import builders

HALF, SIZE, ALBEDO = 8.0, 48, 0.5
THRESHOLD = 0.02


def lamps(count, seed=5):
    """Lamps without extent over a square of 16 m; they cast no shadows."""
    generator = np.random.default_rng(seed)
    places = generator.uniform((-HALF, -HALF, 0.3), (HALF, HALF, 2.0), (count, 3))
    return tuple(
        replace(
            builders.light(position=tuple(place), emission=(power, 0.5 * power, 0.1), casts_shadow=False), key=str(i)
        )
        for i, (place, power) in enumerate(zip(places, 10.0 ** generator.uniform(-2.0, 0.5, count), strict=True))
    )


def picture(render, lights, samples, **settings):
    """A floor seen from above, and below its hole-free middle another: two layers."""
    scene = builders.scene(
        builders.quad("floor", half=2 * HALF), builders.quad("cellar", z=-1.5, half=2 * HALF), lights=lights
    )
    camera = builders.camera(z=5.0, half_width=HALF, orthographic=True)
    return render(scene, camera, width=SIZE, height=SIZE, samples=samples, **settings)


def by_light(lights, height):
    """Radiance (L, H, W, 3) of a floor at a height by each light, and the squared distance (L, H, W) to it."""
    along = (np.arange(SIZE) + 0.5) / SIZE * 2.0 * HALF - HALF
    floor = np.stack([*np.meshgrid(along, along), np.full((SIZE, SIZE), height)], axis=-1)
    to_light = np.array([light.world_from_light[:3, 3] for light in lights])[:, None, None] - floor
    squared = (to_light**2).sum(axis=-1)
    intensity = np.array([light.emission for light in lights])[:, None, None]
    irradiance = intensity * (to_light[..., 2] / squared**1.5)[..., None]
    return ALBEDO / np.pi * irradiance, squared


def expected(plan, height, samples, seed=0):
    """The mean picture of these samples, and where rounding decides whether some light is there."""
    lights, full = plan.lights.lights, np.array(plan.lights.reach)
    radiance, squared = by_light(lights, height)
    total, unsure = np.zeros((SIZE, SIZE, 3)), np.zeros((SIZE, SIZE), bool)
    keys = [light.key for light in lights]
    for sample in samples:
        reach = sampled_reach(full, roulette(keys, np.full(len(keys), sample), seed))[:, None, None]
        weight = (squared < reach**2) * np.maximum(squared / full[:, None, None] ** 2, 1.0)
        total += (weight[..., None] * radiance).sum(axis=0)
        unsure |= (np.abs(squared / reach**2 - 1.0) < 1e-5).any(axis=0)
    return total / len(samples), unsure


@pytest.mark.parametrize("count", [MANY_LIGHTS + 1, 300])
def test_without_a_threshold_all_lights_add_up(render, count):
    lights = lamps(count)
    view = picture(render, lights, 2, light_threshold=0.0)
    assert "light_tiles" in dict(view.statistics.passes)
    radiance, squared = by_light(lights, 0.0)
    height = np.array([light.world_from_light[2, 3] for light in lights])[:, None, None]
    facing = (radiance * (np.sqrt(squared) / height)[..., None]).sum(axis=0)
    error = np.abs(view.channels[Channel.COMBINED][..., :3] - radiance.sum(axis=0))
    assert (error <= 1e-5 * radiance.sum(axis=0) + 3e-5 * facing).all()  # normals of 16 bits are up to 2.2e-5 rad off


@pytest.mark.parametrize("samples", [2, 5])
def test_lights_are_where_they_reach_in_each_sample_and_as_much_brighter_as_they_are_rare(render, samples):
    view = picture(render, lamps(300), samples, light_threshold=THRESHOLD)
    radiance, unsure = expected(view.plan, 0.0, range(samples))
    assert unsure.mean() < 0.02
    shown = view.channels[Channel.COMBINED][..., :3]
    np.testing.assert_allclose(shown[~unsure], radiance[~unsure], rtol=1e-4)
    everything = by_light(view.plan.lights.lights, 0.0)[0].sum(axis=0)
    assert np.abs(radiance / everything - 1.0).max() > 0.05  # or there would be nothing to test


def test_deeper_layers_have_lights_of_their_own(render):
    view = picture(render, lamps(150), 2, light_threshold=THRESHOLD, layers=2, deep_output=True)
    for layer, height in zip(view.layers, (0.0, -1.5), strict=True):
        radiance, unsure = expected(view.plan, height, [0])
        np.testing.assert_allclose(layer.radiance[~unsure], radiance[~unsure], rtol=1e-4)


def test_the_mean_of_many_samples_is_as_bright_as_all_lights(render):
    """Roulette counts a faint light to about 1/N of its range, where it is worth the threshold; 300 do so at random."""
    samples, lights = 128, lamps(300)
    view = picture(render, lights, samples, light_threshold=THRESHOLD)
    error = view.channels[Channel.COMBINED][..., :3] - by_light(lights, 0.0)[0].sum(axis=0)
    step = ALBEDO * THRESHOLD / samples
    assert np.abs(error).max() < 4.0 * np.sqrt(300.0) * step
    assert abs(error.mean()) < step


def test_shadows_hold_however_far_a_light_reaches_in_a_sample(render):
    """Lamps over a plate that no camera sees: the floor below is dark though few samples light all of it."""
    places = [(0.3 * index - 2.4, 0.0, 1.2) for index in range(MANY_LIGHTS + 1)]
    lights = [replace(builders.light(position=place, emission=(0.03,) * 3), key=str(place)) for place in places]
    scene = builders.scene(
        builders.quad("floor", half=2 * HALF), builders.quad("plate", z=0.5, half=1.9 * HALF), lights=lights
    )
    batches = tuple(replace(batch, seen_by_camera=batch.mesh == "floor") for batch in scene.batches)
    camera = builders.camera(z=5.0, half_width=HALF, orthographic=True)
    view = render(replace(scene, batches=batches), camera, width=128, height=128, samples=16, light_threshold=THRESHOLD)
    assert view.plan.lights.reach[0] < 0.7  # the floor is out of what each reaches always
    assert view.channels[Channel.COMBINED][..., :3].max() == 0.0
