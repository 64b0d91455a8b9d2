# SPDX-License-Identifier: GPL-3.0-or-later
"""Hundreds of lights: the picture is the sum of what each does, and what does nothing is left out and named."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.scene import AreaShape, Channel, LightKind
from blender_tests import builders

WIDTH, HEIGHT = 48, 32


def room(lights):
    """A floor with three boxes on it, under lights."""
    places = [builders.translation(x, y, 0.3) for x, y in ((-1.2, 0.4), (0.3, -0.6), (1.1, 0.8))]
    batches = [builders.batch("floor"), builders.batch("box", places)]
    return builders.scene(
        builders.quad("floor", half=6.0), builders.box("box", half=0.3), lights=lights, batches=batches
    )


def small_lights(count, seed=0):
    """Lights of every kind about a metre above the floor, each with its own key and colour."""
    generator = np.random.default_rng(seed)
    result = []
    for index in range(count):
        kind = (LightKind.POINT, LightKind.SPOT, LightKind.AREA)[index % 3]
        x, y, z = generator.uniform((-3.0, -2.0, 0.7), (3.0, 2.0, 1.5))
        emission = tuple(float(value) for value in generator.uniform(0.05, 0.3, 3))
        light = builders.light(
            kind,
            (x, y, z),
            emission,
            radius=0.0,
            angle=1.2,
            blend=0.3,
            size=(0.1, 0.1),
            shape=AreaShape.ELLIPSE,
        )
        result.append(replace(light, key=f"light {index}", name=f"light {index}"))
    return tuple(result)


def picture(session, scene, *, samples=2, **options):
    """Radiance (H, W, 3) float64 of the room from above."""
    options.setdefault("light_threshold", 0.0)
    camera = builders.camera(z=6.0, half_width=0.5)
    view = session.show(scene, camera, width=WIDTH, height=HEIGHT, samples=samples, **options)
    return view.channels[Channel.COMBINED][..., :3].astype(np.float64)


def test_many_lights_are_the_sum_of_each(shared_session):
    """With every light asked everywhere there is nothing random in how they are sorted: the sum of 40 pictures.

    Each of those has its lamp at the same points: `shadow_updates` gives every light new points in every sample.
    """
    lights = small_lights(40)
    options = {"shadow_updates": 64}
    together = picture(shared_session, room(lights), **options)
    apart = sum(picture(shared_session, room((light,)), **options) for light in lights)
    assert together.mean() > 0.01
    np.testing.assert_allclose(together, apart, rtol=1e-3, atol=1e-5 * apart.max())


def test_threshold_changes_noise_and_not_the_mean(shared_session):
    """Lights that are only there now and then are brighter then: Russian roulette has no bias.

    One whose radiance is p times the threshold is there with probability p, so its variance is below p times the
    threshold's square, on surfaces of albedo ρ ρ² times that; 60 of them over the samples, four standard errors.
    """
    threshold, count, samples = 0.05, 60, 256
    lights = small_lights(count, seed=1)
    scene = replace(room(lights), lights=tuple(replace(light, casts_shadow=False) for light in lights))
    exact = picture(shared_session, scene, samples=64)
    roulette = picture(shared_session, scene, samples=samples, light_threshold=threshold)
    assert np.abs(roulette - exact).max() > 1e-4 * exact.max(), "the threshold must leave something to chance"
    np.testing.assert_allclose(roulette, exact, atol=4.0 * 0.5 * threshold * np.sqrt(count / samples))
    np.testing.assert_allclose(roulette.mean(), exact.mean(), rtol=0.02)


@settings(max_examples=10)
@given(count=st.integers(17, 90), seed=st.integers(0, 1000))
def test_how_many_lights_there_are_changes_none_of_them(shared_session, count, seed):
    """Lights far away and dark change nothing, whatever the tiles' words and rows hold."""
    lights = small_lights(12, seed)
    dark = tuple(
        replace(light, key=f"dark {index}", emission=(0.0, 0.0, 0.0))
        for index, light in enumerate(small_lights(count, seed + 1))
    )
    alone = picture(shared_session, room(lights), shadow_updates=256)
    among = picture(shared_session, room((*dark[::2], *lights, *dark[1::2])), shadow_updates=256)
    np.testing.assert_allclose(among, alone, rtol=1e-3, atol=1e-5 * alone.max())


def test_lights_that_do_nothing_are_named(shared_session):
    """Off, out of reach of what is seen, or lighting no group that exists: each is listed with a reason."""
    lit = builders.light(position=(0.0, 0.0, 2.0))
    off = replace(builders.light(position=(1.0, 0.0, 2.0), emission=(0.0, 0.0, 0.0)), key="off", name="Off")
    far = replace(builders.light(position=(0.0, 0.0, 1e6), emission=(1e-3,) * 3), key="far", name="Far")
    others = small_lights(20)
    scene = room((lit, off, far, *others))
    view = shared_session.show(scene, builders.camera(z=6.0, half_width=0.5), samples=2, light_threshold=0.01)
    reasons = dict(view.statistics.left_out)
    for name in ("Off", "Far"):
        found = [reason for title, reason in reasons.items() if name in title]
        assert found, f"light {name} is not listed"
        assert all(found)
    assert not any("light 3" in title for title in reasons)


@pytest.mark.parametrize("samples", [1, 4])
def test_a_static_scene_draws_its_shadow_maps_once(session, samples):
    """Lamps that are points keep their maps as long as nothing in front of them changes."""
    lights = tuple(
        replace(builders.light(kind, (x, 0.3, 2.0), angle=angle), key=f"{kind}")
        for kind, x, angle in ((LightKind.POINT, -1.0, 0.0), (LightKind.SPOT, 1.0, 1.0), (LightKind.SUN, 0.0, 0.0))
    )
    scene = room(lights)
    camera = builders.camera(z=6.0, half_width=0.5)

    def counts(scene):
        statistics = session.show(scene, camera, samples=samples).statistics
        return statistics.shadow_maps_drawn, statistics.shadow_maps_kept

    first = counts(scene)
    assert first[0] > 0 or samples > 1, "a first picture draws maps"
    second = counts(scene)
    assert second[0] == 0, "nothing changed"
    assert second[1] > 0
    floor, boxes = scene.batches
    moved = replace(boxes, matrices=boxes.matrices + builders.translation(0.1) - np.eye(4), version=2)
    third = counts(replace(scene, batches=(floor, moved)))
    assert third[0] > 0 or samples > 1, "a caster moved"


def test_preview_keeps_the_maps_of_lamps_with_size(session):
    """One sample has every lamp at its centre, so that the next picture finds the same maps."""
    lights = (
        builders.light(position=(0.5, 0.3, 2.0), radius=0.2),
        builders.light(LightKind.AREA, (-0.5, 0.3, 2.0), size=(0.5, 0.5)),
    )
    drawn = [
        session.show(room(lights), builders.camera(z=6.0, half_width=0.5)).statistics.shadow_maps_drawn
        for _ in range(2)
    ]
    assert drawn[0] > 0
    assert drawn[1] == 0


def test_moving_the_camera_keeps_what_a_static_scene_is_in_shadow_of(session):
    """A second picture from elsewhere shows the same shadows as a first one from there."""
    lights = (builders.light(position=(0.5, 0.3, 2.0)),)
    here, there = (builders.camera(z=z, half_width=0.5) for z in (6.0, 5.0))
    moved = [session.show(room(lights), camera, samples=2) for camera in (here, there)][1]
    fresh = session.show(room(lights), there, samples=2)
    found, expected = (view.channels[Channel.COMBINED] for view in (moved, fresh))
    assert (np.abs(found - expected) > 0.01 * expected.max()).any(axis=-1).mean() <= 0.01
