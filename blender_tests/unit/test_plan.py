# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import replace

import pytest

from addon.render import frames_before, plan
from addon.scene import (
    Channel,
    DebugView,
    EmissionSampling,
    LightKind,
    RenderSettings,
    ShadingModel,
    SunDisc,
    Variant,
    World,
)
from blender_tests import builders

SETTINGS = RenderSettings(64, 64, layers=4)
LIT = builders.scene(builders.quad("q"), lights=(builders.light(),))


def names(planned):
    return [item.name for item in planned.passes]


def reasons(planned):
    return {item.name: item.reason for item in planned.left_out}


def layers_written(planned):
    return {target.name: target.layers for target in planned.targets}


def test_a_lit_scene_needs_every_pass():
    assert names(plan(LIT, SETTINGS)) == ["gbuffer", "depth_tiles", "shadow_maps", "direct", "composite"]


def test_layers_nobody_reads_are_left_out_with_the_reason():
    planned = plan(LIT, SETTINGS)
    assert planned.layers == 1
    assert "nothing reads them" in reasons(planned)["gbuffer layers 2–4"]
    assert "Δz unused" in reasons(planned)["minimum separation"]
    assert "gbuffer.oracle" not in [target.name for target in planned.targets]


@pytest.mark.parametrize(
    ("change", "layers"),
    [
        ({"deep_output": True}, 4),
        ({"debug_view": DebugView.NORMAL, "debug_layer": 2}, 3),
        ({"debug_view": DebugView.NORMAL, "debug_layer": 7}, 4),
        ({"debug_layer": 2}, 1),
    ],
)
def test_layers_are_built_for_whoever_reads_them(change, layers):
    planned = plan(LIT, replace(SETTINGS, **change))
    assert planned.layers == layers
    written = layers_written(planned)
    assert written["gbuffer.view_depth"] == written["gbuffer.normal"] == layers
    assert ("gbuffer.oracle" in written) == (layers > 1)


def test_nothing_to_light_with_means_no_direct_pass():
    dark = builders.scene(builders.quad("q"))
    planned = plan(dark, SETTINGS)
    assert names(planned) == ["gbuffer", "composite"]
    assert reasons(planned)["direct"] == "no light, emission or world"
    assert [target.name for target in planned.find("gbuffer").writes] == ["gbuffer.view_depth"]
    assert reasons(plan(replace(LIT, batches=()), SETTINGS))["direct"] == "no geometry"


def test_emission_and_world_are_compiled_only_where_there_are_any():
    assert plan(LIT, SETTINGS).find("direct").defines == {"SPHERE_LIGHTS", "SHADOWS"}
    world = builders.scene(builders.quad("q"), world=(0.1, 0.0, 0.0))
    assert plan(world, SETTINGS).find("direct").defines == {"WORLD", "WORLD_LIGHTS", "SHADOWS"}
    lamp = builders.scene(builders.quad("q"), materials=(builders.material(emission=(1.0, 0, 0)),))
    planned = plan(lamp, SETTINGS)
    assert planned.find("direct").defines == {"EMISSION", "MESH_LIGHTS", "SHADOWS"}
    glow = builders.material(emission=(1.0, 0, 0), emission_sampling=EmissionSampling.NONE)
    planned = plan(builders.scene(builders.quad("q"), materials=(glow,)), SETTINGS)
    assert planned.find("direct").defines == {"EMISSION"}
    assert "Emission Sampling" in reasons(planned)["light of white"]
    assert "gbuffer normal" in reasons(planned)


@pytest.mark.parametrize(
    ("lights", "world", "wanted"),
    [
        ((builders.light(),), (0.0, 0.0, 0.0), True),
        ((builders.light(casts_shadow=False),), (0.0, 0.0, 0.0), False),
        ((builders.light(casts_shadow=False),), (0.0, 0.1, 0.0), True),
        ((builders.light(casts_shadow=False),) * 16, (0.0, 0.0, 0.0), False),
        ((builders.light(casts_shadow=False),) * 17, (0.0, 0.0, 0.0), True),
    ],
)
def test_tiles_have_depth_ranges_for_shadow_maps_and_for_many_lights(lights, world, wanted):
    planned = plan(builders.scene(builders.quad("q"), lights=lights, world=world), SETTINGS)
    assert ("depth_tiles" in names(planned)) == wanted
    assert wanted or "no shadows" in reasons(planned)["depth_tiles"]


@pytest.mark.parametrize(
    ("light", "defines"),
    [
        (builders.light(LightKind.SUN), {"SUN_LIGHTS"}),
        (builders.light(LightKind.AREA), {"AREA_LIGHTS"}),
        (builders.light(LightKind.POINT, soft_falloff=True), {"DISK_LIGHTS"}),
        (builders.light(LightKind.SPOT), {"SPHERE_LIGHTS", "SPOT_CONES"}),
    ],
)
def test_only_the_kinds_of_light_there_are_get_compiled(light, defines):
    scene = builders.scene(builders.quad("q"), lights=(light,))
    assert plan(scene, SETTINGS).find("direct").defines == defines | {"SHADOWS"}
    glossy = builders.scene(builders.quad("q"), lights=(light,), materials=(builders.material(specular=0.04),))
    assert plan(glossy, SETTINGS).find("direct").defines == defines | {"SPECULAR", "SHADOWS"}
    assert "direct sun_lights" in reasons(plan(scene, SETTINGS)) or light.kind is LightKind.SUN


def test_a_debug_view_of_the_gbuffer_needs_no_light():
    planned = plan(LIT, replace(SETTINGS, debug_view=DebugView.NORMAL))
    assert names(planned) == ["gbuffer", "composite"]
    assert planned.find("composite").defines == {"DEBUG_NORMAL"}


def test_the_suns_disc_is_compiled_where_the_camera_sees_one():
    disc = SunDisc((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), 0.1, (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), -0.1, -1.0, 0.6)
    for seen in (True, False):
        scene = replace(LIT, world=World(sun_disc=disc, seen_by_camera=seen))
        assert ("SUN_DISC" in plan(scene, SETTINGS).find("composite").defines) == seen
    assert "SUN_DISC" not in plan(LIT, SETTINGS).find("composite").defines


def test_film_images_bring_their_channels():
    planned = plan(LIT, replace(SETTINGS, channels=frozenset({Channel.OBJECT_INDEX, Channel.NORMAL})))
    assert "gbuffer.object_index" in [target.name for target in planned.find("gbuffer").writes]
    assert planned.find("composite").defines == {"DIRECT", "FILM_NORMAL"}
    assert [target.name for target in planned.find("composite").writes] == ["film.combined", "film.normal"]


def test_gouraud_shading_takes_the_place_of_all_that_lights_pixels():
    lights = (builders.light(),) * 17
    scene = builders.scene(builders.quad("q"), lights=lights, materials=(builders.material(diffuse_roughness=0.5),))
    settings = replace(SETTINGS, shading_model=ShadingModel.GOURAUD)
    planned = plan(scene, settings)
    assert names(planned) == ["gbuffer", "gouraud", "composite"]
    shading = planned.find("gouraud")
    assert shading.defines == {"SPHERE_LIGHTS", "PHONG"}
    assert shading.reads == ("gbuffer.view_depth", "gbuffer.base_color", "gbuffer.material")
    assert "gbuffer normal" in reasons(planned)
    left_out = reasons(planned)
    assert all("Gouraud" in left_out[name] for name in ("shadow_maps", "light_tiles", "direct"))
    assert {"depth_tiles", "gouraud sun_lights"} <= left_out.keys()
    shown = plan(scene, replace(settings, debug_view=DebugView.DIRECT, debug_layer=1))
    assert shown.find("composite").defines == {"DEBUG_DIRECT"}
    assert layers_written(shown)["direct.radiance"] == 2
    assert reasons(plan(scene, SETTINGS))["gouraud"] == "shading is not Gouraud's"
    dark = replace(scene, lights=())
    assert names(plan(dark, settings)) == ["gbuffer", "composite"]


@pytest.mark.parametrize("model", ShadingModel)
@pytest.mark.parametrize("deep", [False, True])
def test_what_is_read_is_written(deep, model):
    planned = plan(LIT, replace(SETTINGS, deep_output=deep, channels=frozenset(Channel), shading_model=model))
    written = {target.name for target in planned.targets}
    assert all(set(item.reads) <= written for item in planned.passes)


DEEP = replace(SETTINGS, deep_output=True)
ONE_PASS = [variant for variant in Variant if variant is not Variant.TWO_PASS]


def test_motion_and_exit_surfaces_are_built_for_whoever_reads_them():
    everything = replace(DEEP, channels=frozenset(Channel))
    planned = plan(LIT, everything)
    assert "gbuffer.motion" not in layers_written(planned)
    assert reasons(planned)["gbuffer motion"] == "no pass or output reads it"
    assert reasons(planned)["exit"].startswith("no effect, output or debug view")
    assert layers_written(plan(LIT, replace(everything, motion_vectors=True)))["gbuffer.motion"] == 4
    planned = plan(LIT, replace(everything, exit_surfaces=True))
    assert names(planned) == ["gbuffer", "exit", "depth_tiles", "shadow_maps", "direct", "composite"]
    assert layers_written(planned)["exit.view_depth"] == 4
    shown = plan(LIT, replace(SETTINGS, debug_view=DebugView.EXIT_ALBEDO, debug_layer=1))
    assert names(shown) == ["gbuffer", "exit", "composite"]
    assert {"exit.base_color", "exit.view_depth"} <= set(shown.find("composite").reads)


def test_deeper_layers_store_only_what_is_read_of_them():
    settings = replace(SETTINGS, debug_view=DebugView.ALBEDO, debug_layer=2, channels=frozenset({Channel.OBJECT_INDEX}))
    planned = plan(LIT, settings)
    written = layers_written(planned)
    assert written["gbuffer.base_color"] == 3
    assert written["gbuffer.object_index"] == 1
    assert "there" in reasons(planned)["gbuffer object_index behind layer 1"]


@pytest.mark.parametrize("variant", ONE_PASS)
def test_one_pass_variants_read_an_oracle(variant):
    planned = plan(LIT, replace(DEEP, variant=variant, samples=2))
    assert names(planned)[:2] == ["oracle", "gbuffer"]
    extra = 1 if variant is Variant.DELAY else 0  # a film's next sample is known ahead
    written = layers_written(planned)
    assert written["gbuffer.oracle"] == 3
    assert written["gbuffer.view_depth"] == planned.drawn_layers == 4 + extra
    viewport = plan(LIT, replace(DEEP, variant=variant), continuous=True)
    assert viewport.look_ahead == (variant in (Variant.DELAY, Variant.PREDICT))


def test_nothing_looks_ahead_of_the_last_picture():
    assert not plan(LIT, replace(DEEP, variant=Variant.DELAY, samples=1)).look_ahead


@pytest.mark.parametrize("variant", ONE_PASS)
def test_a_single_layer_has_no_variant(variant):
    planned = plan(LIT, replace(SETTINGS, variant=variant))
    assert names(planned) == ["gbuffer", "depth_tiles", "shadow_maps", "direct", "composite"]
    assert reasons(planned)["oracle"] == "only one layer is built"
    assert not planned.one_pass


def test_the_guard_band_is_built_where_something_reads_beyond_the_edge():
    planned = plan(LIT, replace(DEEP, guard_band=64))
    assert planned.guard_band == 0
    assert "beyond the picture's edge" in reasons(planned)["guard band"]
    assert plan(LIT, replace(DEEP, guard_band=64, variant=Variant.REPROJECT)).guard_band == 64
    single = plan(LIT, replace(SETTINGS, guard_band=64, variant=Variant.REPROJECT))
    assert single.guard_band == 0


@pytest.mark.parametrize(
    ("change", "frames"),
    [
        ({}, 0),
        ({"variant": Variant.REPROJECT}, 0),
        ({"deep_output": True, "variant": Variant.REPROJECT}, 1),
        ({"deep_output": True, "variant": Variant.PREVIOUS}, 1),
        ({"deep_output": True, "variant": Variant.PREDICT}, 2),
        ({"deep_output": True, "variant": Variant.DELAY}, 0),
        ({"deep_output": True, "layers": 1, "variant": Variant.PREDICT}, 0),
        ({"deep_output": True, "motion_vectors": True}, 1),
        ({"debug_view": DebugView.MOTION}, 1),
    ],
)
def test_only_the_frames_that_are_needed_are_evaluated(change, frames):
    assert frames_before(replace(SETTINGS, **change)) == frames
