# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import replace
from math import inf

import pytest

from addon.render.light_reach import MANY_LIGHTS
from addon.render.lighting_plan import plan_lights
from addon.render.memory import Memory
from addon.render.plan import plan
from addon.scene import BaseColorSource, EmissionSampling, ImageTexture, LightKind, RenderSettings, Variant
from blender_tests import builders

SETTINGS = RenderSettings(32, 32, samples=4)
FLOOR = builders.quad("floor", half=5.0)


def planned(scene, camera=None, *, continuous=False, **settings):
    """(plan, {name: reason} of what was left out)."""
    lights, left_out = plan_lights(scene, replace(SETTINGS, **settings), camera, Memory(), continuous=continuous)
    return lights, dict(left_out)


def lamps(count, emission=1.0, **arguments):
    """Point lights of different keys, 2 m above the origin."""
    light = builders.light(emission=(emission,) * 3, **arguments)
    return tuple(replace(light, key=f"lamp {index}", name=f"lamp {index}") for index in range(count))


def test_lamps_surfaces_and_the_world_are_counted_in_that_order():
    glow = builders.material("glow", emission=(1, 1, 1))
    scene = builders.scene(
        FLOOR,
        builders.quad("panel"),
        materials=(builders.DIFFUSE, glow),
        lights=lamps(3),
        batches=[builders.batch("floor"), builders.batch("panel", materials=("glow",))],
        world=(1, 1, 1),
    )
    lights, left_out = planned(scene, world_directions=6)
    assert (len(lights.lights), len(lights.mesh_lights), lights.world_directions, lights.count) == (3, 1, 6, 10)
    assert lights.reach == (inf,) * 3
    assert left_out == {}


@pytest.mark.parametrize(
    ("samples", "continuous", "preview"), [(1, False, True), (2, False, False), (1, True, True), (16, True, True)]
)
def test_a_viewport_and_a_single_sample_begin_with_a_preview(samples, continuous, preview):
    lights, _ = planned(builders.scene(FLOOR, lights=lamps(1)), samples=samples, continuous=continuous)
    assert lights.preview == preview


CASTING, UNSHADOWED = lamps(1), lamps(1, casts_shadow=False)
NO_CASTER = [replace(builders.batch("floor"), casts_shadow=False)]


@pytest.mark.parametrize(
    ("arguments", "casts"),
    [
        ({"lights": CASTING}, True),
        ({"lights": UNSHADOWED}, False),
        ({"lights": UNSHADOWED + CASTING}, True),
        ({"lights": UNSHADOWED, "world": (1, 0, 0)}, True),
        ({"world": (1, 0, 0)}, True),
        ({"lights": CASTING, "batches": NO_CASTER}, False),
        ({"world": (1, 0, 0), "batches": NO_CASTER}, False),
        ({"lights": CASTING, "batches": []}, False),
        ({"materials": (builders.material(emission=(1, 1, 1)),)}, True),
        ({}, False),
    ],
)
def test_shadows_need_a_light_that_casts_them_and_a_caster(arguments, casts):
    assert planned(builders.scene(FLOOR, **arguments))[0].casts_shadows == casts


@pytest.mark.parametrize("seen", [{"seen_by_diffuse": False, "seen_by_glossy": False}, {"radiance": (0.0, 0.0, 0.0)}])
def test_a_world_that_lights_nothing_has_no_directions(seen):
    scene = builders.scene(FLOOR, world=(1, 1, 1))
    assert planned(scene)[0].world_directions > 0
    assert planned(replace(scene, world=replace(scene.world, **seen)))[0].world_directions == 0


def test_what_is_off_or_linked_to_nothing_is_left_out_by_name():
    off, unlinked, factors = (
        replace(light, name=name)
        for light, name in zip(lamps(3), ("off", "unlinked", "without influence"), strict=True)
    )
    off = replace(off, emission=(0.0, 0.0, 0.0))
    unlinked = replace(unlinked, receiver_groups=0b10)
    factors = replace(factors, diffuse_factor=0.0, specular_factor=0.0)
    scene = builders.scene(FLOOR, lights=(off, unlinked, factors, *lamps(1)))
    lights, left_out = planned(scene, builders.camera())
    assert [light.name for light in lights.lights] == ["lamp 0"]
    assert {name.strip("light “”") for name in left_out} == {"off", "unlinked", "without influence"}
    assert all(left_out.values())


def test_lights_out_of_reach_are_left_out_only_where_there_are_many():
    far = replace(lamps(1)[0], key="far", name="far", world_from_light=builders.translation(x=1e5))
    for count, lost in ((MANY_LIGHTS, True), (MANY_LIGHTS - 1, False)):
        lights, left_out = planned(builders.scene(FLOOR, lights=(*lamps(count), far)), builders.camera())
        assert (far not in lights.lights) == lost
        assert ("light “far”" in left_out) == lost
        assert len(lights.reach) == len(lights.lights)


def test_reach_follows_the_threshold():
    scene = builders.scene(FLOOR, lights=lamps(MANY_LIGHTS + 1))
    narrow, wide = (planned(scene, light_threshold=threshold)[0].reach[0] for threshold in (0.04, 0.01))
    assert wide == pytest.approx(2.0 * narrow)
    assert planned(scene, light_threshold=0.0)[0].reach == (inf,) * (MANY_LIGHTS + 1)


def test_what_only_the_guard_band_shows_is_lit():
    """A lamp that reaches no pixel of the picture, but some around it, which what reads beyond its edge needs lit."""
    camera = builders.camera(z=10.0, half_width=0.1, orthographic=False)
    aside = tuple(
        replace(light, world_from_light=builders.translation(x=2.5, z=0.1)) for light in lamps(MANY_LIGHTS + 1, 1e-3)
    )
    scene = builders.scene(FLOOR, lights=aside)
    settings = replace(SETTINGS, layers=2, variant=Variant.REPROJECT, deep_output=True)
    without, within = (len(plan(scene, replace(settings, guard_band=band), camera).lights.lights) for band in (0, 32))
    assert within == MANY_LIGHTS + 1
    assert without < within / 2, "but for what roulette lets reach farther"


def test_emissive_surfaces_that_are_not_sampled_are_named():
    glow = builders.material("glow", emission=(1, 1, 1))
    none = builders.material("none", emission=(1, 1, 1), emission_sampling=EmissionSampling.NONE)
    quads = builders.quad("large", half=10.0), builders.quad("small", half=0.1), builders.quad("none")
    batches = [builders.batch(quad.key, materials=("none" if quad.key == "none" else "glow",)) for quad in quads]
    lights, left_out = planned(builders.scene(*quads, materials=(glow, none), batches=batches))
    assert [light.name for light in lights.mesh_lights] == ["large (glow)"]
    assert set(left_out) == {"light of small (glow)", "light of none"}


def test_every_light_stays_where_the_camera_may_be_anywhere():
    scene = builders.scene(FLOOR, lights=(*lamps(2), builders.light(LightKind.SUN, emission=(0, 0, 0))))
    assert len(planned(scene, None)[0].lights) == 3


def test_emission_that_is_not_sampled_is_told():
    """Cut out by an image, switched off, or one of too many instances: each is named with its reason."""
    pierced = builders.material("pierced", emission=(1.0, 1.0, 1.0), texture_alpha=True)
    pierced = replace(pierced, source=BaseColorSource.TEXTURE, texture=ImageTexture("image"))
    dark = builders.material("dark", emission=(1.0, 1.0, 1.0), emission_sampling=EmissionSampling.NONE)
    bulb = builders.material("bulb", emission=(1.0, 1.0, 1.0))
    many = [builders.translation(x=float(index)) for index in range(100)]
    scene = builders.scene(
        builders.quad("q"),
        materials=(pierced, dark, bulb),
        batches=[
            builders.batch("q", materials=("pierced",), key="a"),
            builders.batch("q", materials=("dark",), key="b"),
            builders.batch("q", many, materials=("bulb",), key="c"),
        ],
    )
    planned = plan(scene, RenderSettings(32, 32))
    reasons = {left.name: left.reason for left in planned.left_out}
    assert len(planned.lights.mesh_lights) == 16
    assert "image" in reasons["light of pierced"]
    assert "Emission Sampling" in reasons["light of dark"]
    assert "strongest" in reasons["light of 83 more instances of q"]
