# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import replace
from pathlib import Path

import pytest

from addon.render import plan
from addon.render.layout import CHANNELS, DEPTH_BYTES
from addon.scene import Channel, DebugView, LightKind, RenderSettings
from blender_tests import builders

SETTINGS = RenderSettings(64, 64, layers=4)
LIT = builders.scene(builders.quad("q"), lights=(builders.light(),))


def names(planned):
    return [item.name for item in planned.passes]


def reasons(planned):
    return {item.name: item.reason for item in planned.left_out}


def test_a_lit_scene_needs_every_pass():
    assert names(plan(LIT, SETTINGS)) == ["gbuffer", "direct", "composite"]


def test_layers_nobody_reads_are_left_out_with_the_reason():
    planned = plan(LIT, SETTINGS)
    assert planned.layers == 1
    assert "nothing reads them" in reasons(planned)["gbuffer layers 2–4"]
    assert "Δz unused" in reasons(planned)["minimum separation"]
    assert "PEEL" not in planned.find("gbuffer").defines


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
    written = {target.name: target.layers for target in planned.find("gbuffer").writes}
    assert written["gbuffer.view_depth"] == written["gbuffer.normal"] == layers
    assert ("gbuffer.oracle_0" in written) == (layers > 1)


def test_nothing_to_light_with_means_no_direct_pass():
    dark = builders.scene(builders.quad("q"))
    planned = plan(dark, SETTINGS)
    assert names(planned) == ["gbuffer", "composite"]
    assert reasons(planned)["direct"] == "no light, emission or world"
    assert [target.name for target in planned.find("gbuffer").writes] == ["gbuffer.view_depth"]
    assert reasons(plan(replace(LIT, batches=()), SETTINGS))["direct"] == "no geometry"


def test_emission_and_world_are_compiled_only_where_there_are_any():
    assert plan(LIT, SETTINGS).find("direct").defines == {"SPHERE_LIGHTS"}
    world = builders.scene(builders.quad("q"), world=(0.1, 0.0, 0.0))
    assert plan(world, SETTINGS).find("direct").defines == {"WORLD"}
    lamp = builders.scene(builders.quad("q"), materials=(builders.material(emission=(1.0, 0, 0)),))
    planned = plan(lamp, SETTINGS)
    assert planned.find("direct").defines == {"EMISSION"}
    assert "gbuffer normal" in reasons(planned)


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
    assert plan(scene, SETTINGS).find("direct").defines == defines
    glossy = builders.scene(builders.quad("q"), lights=(light,), materials=(builders.material(specular=0.04),))
    assert plan(glossy, SETTINGS).find("direct").defines == defines | {"SPECULAR"}
    assert "direct sun_lights" in reasons(plan(scene, SETTINGS)) or light.kind is LightKind.SUN


def test_a_debug_view_of_the_gbuffer_needs_no_light():
    planned = plan(LIT, replace(SETTINGS, debug_view=DebugView.NORMAL))
    assert names(planned) == ["gbuffer", "composite"]
    assert planned.find("composite").defines == {"DEBUG_NORMAL"}


def test_film_images_bring_their_channels():
    planned = plan(LIT, replace(SETTINGS, channels=frozenset({Channel.OBJECT_INDEX, Channel.NORMAL})))
    assert "gbuffer.object_index" in [target.name for target in planned.find("gbuffer").writes]
    assert planned.find("composite").defines == {"DIRECT", "FILM_NORMAL"}
    assert [target.name for target in planned.find("composite").writes] == ["film.combined", "film.normal"]


@pytest.mark.parametrize("deep", [False, True])
def test_what_is_read_is_written(deep):
    planned = plan(LIT, replace(SETTINGS, deep_output=deep, channels=frozenset(Channel)))
    written = {target.name for target in planned.targets}
    assert all(set(item.reads) <= written for item in planned.passes)


def test_motion_vectors_have_a_slot_that_nothing_fills_yet():
    everything = replace(SETTINGS, deep_output=True, channels=frozenset(Channel))
    planned = plan(LIT, everything)
    assert "gbuffer.motion" not in [target.name for target in planned.targets]
    assert reasons(planned)["gbuffer motion"] == "no pass or output reads it"


def test_a_layer_takes_no_more_than_48_bytes_per_pixel():
    assert sum(channel.target(1).bytes_per_pixel for channel in CHANNELS) + DEPTH_BYTES <= 48


def test_the_readme_lists_every_channel_as_it_is():
    formats = {("f4", 1): "R32F", ("nu2", 2): "RG16", ("f2", 4): "RGBA16F", ("f1", 2): "RG8", ("f4", 4): "RGBA32F"}
    formats |= {("u2", 1): "R16UI", ("f2", 2): "RG16F"}
    readme = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    for channel in CHANNELS:
        assert f"| {channel.name} | {formats[channel.dtype, channel.components]} | {channel.meaning} |" in readme
    assert f"{sum(channel.target(1).bytes_per_pixel for channel in CHANNELS)} bytes per pixel and layer" in readme
