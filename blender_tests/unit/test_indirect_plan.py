# SPDX-License-Identifier: GPL-3.0-or-later
"""Which passes find indirect light, what they read and write, and why what is not needed is left out."""

from dataclasses import replace
from itertools import pairwise

import pytest

from addon.render import plan
from addon.render.indirect_plan import (
    BLENDED_TARGET,
    GATHERED_TARGET,
    INDIRECT_PASSES,
    IRRADIANCE_TARGET,
    ORIGIN_TARGET,
    indirect_needs,
    linking_warnings,
    reads_layers,
)
from addon.scene import (
    Channel,
    DebugView,
    EmissionSampling,
    IndirectMethod,
    IndirectSettings,
    RenderSettings,
    ShadingModel,
)
from addon.scene.indirect import RAY_METHODS, WORLD_METHODS
from blender_tests import builders

METHODS = [method for method in IndirectMethod if method is not IndirectMethod.NONE]
PASS_OF = {
    IndirectMethod.OCCLUSION: "occlusion",
    IndirectMethod.SSAO: "occlusion",
    IndirectMethod.RADIOSITY: "radiosity",
    IndirectMethod.DEEP_MARCH: "deep_march",
    IndirectMethod.MARCH_GRID: "gather",
}
LAMP = (builders.light(),)
FLOOR = builders.quad("floor")
EVERYTHING = builders.scene(FLOOR, lights=LAMP, world=(0.5, 0.5, 0.5))
every_method = pytest.mark.parametrize("method", METHODS)


def planned(scene=EVERYTHING, method=IndirectMethod.MARCH_GRID, *, continuous=False, indirect=(), **settings):
    """The plan of a scene for a method, with some of its numbers and of the view's settings changed."""
    numbers = IndirectSettings(method, **dict(indirect))
    return plan(scene, RenderSettings(64, 64, indirect=numbers, **settings), continuous=continuous)


def names(found):
    return [item.name for item in found.passes]


def reasons(found):
    return {item.name: item.reason for item in found.left_out}


def writes(found, name):
    return {target.name: target for target in found.find(name).writes}


@every_method
def test_one_pass_finds_the_light_between_direct_and_composite(method):
    found = planned(method=method)
    order = names(found)
    assert order[-1] == "composite"
    assert order.index("direct") < order.index(PASS_OF[method]) < order.index("filter")
    assert ("radiance_grid" in order) == (method is IndirectMethod.MARCH_GRID)
    for other in {*PASS_OF.values()} - {PASS_OF[method]}:
        assert other not in order
        assert reasons(found)[other] == "another method finds indirect light"


def test_the_grid_is_filled_and_lit_before_it_is_read():
    order = names(planned())
    assert order.index("depth_tiles") < order.index("radiance_grid") < order.index("gather")
    assert order.index("shadow_maps") < order.index("radiance_grid")


def test_a_grid_that_nobody_reads_is_left_out():
    assert reasons(planned(method=IndirectMethod.DEEP_MARCH))["radiance_grid"] == "the method does not read it"


GLOWING = builders.material(emission=(1.0, 0.0, 0.0), emission_sampling=EmissionSampling.NONE)
UNSEEN = [replace(builders.batch("floor"), seen_by_camera=False)]
DARK = builders.scene(FLOOR)


@pytest.mark.parametrize(
    ("scene", "method", "settings", "reason"),
    [
        (EVERYTHING, IndirectMethod.NONE, {}, "the method is None"),
        (replace(EVERYTHING, batches=()), IndirectMethod.MARCH_GRID, {}, "no geometry"),
        (replace(EVERYTHING, batches=tuple(UNSEEN)), IndirectMethod.MARCH_GRID, {}, "no geometry"),
        (EVERYTHING, IndirectMethod.MARCH_GRID, {"shading_model": ShadingModel.GOURAUD}, "Gouraud"),
        (EVERYTHING, IndirectMethod.MARCH_GRID, {"debug_view": DebugView.NORMAL}, "the debug view"),
        (
            builders.scene(FLOOR, lights=LAMP, materials=(builders.material(base_color=(0.0, 0.0, 0.0)),)),
            IndirectMethod.MARCH_GRID,
            {},
            "nothing reflects diffusely",
        ),
        (
            builders.scene(FLOOR, lights=LAMP, materials=(builders.material(metallic=1.0),)),
            IndirectMethod.DEEP_MARCH,
            {},
            "nothing reflects diffusely",
        ),
        (DARK, IndirectMethod.MARCH_GRID, {}, "no light, emission or world"),
        (DARK, IndirectMethod.RADIOSITY, {}, "no light, emission or world"),
        (builders.scene(FLOOR, lights=LAMP), IndirectMethod.OCCLUSION, {}, "no world light"),
        (builders.scene(FLOOR, materials=(GLOWING,)), IndirectMethod.SSAO, {}, "no world light"),
    ],
)
def test_what_has_no_indirect_light_has_none_of_its_passes(scene, method, settings, reason):
    """Neither grid, nor gathering, nor filters, nor layers for them; and the plan says why of each."""
    found = planned(scene, method, **settings)
    assert not {*names(found)} & {*INDIRECT_PASSES}
    assert {*INDIRECT_PASSES} <= {*reasons(found)}
    assert all(reason in reasons(found)[name] for name in INDIRECT_PASSES)
    assert found.layers == 1
    assert "INDIRECT" not in found.find("composite").defines
    assert not found.indirect.any
    assert not [target for target in found.targets if target.name.startswith("indirect.")]


def test_a_world_that_no_diffuse_ray_sees_is_no_light():
    """Nor one without radiance."""
    scene = builders.scene(FLOOR, world=(1.0, 1.0, 1.0))
    assert "gather" in names(planned(scene))
    for world in (replace(scene.world, seen_by_diffuse=False), replace(scene.world, radiance=(0.0, 0.0, 0.0))):
        found = planned(replace(scene, world=world))
        assert reasons(found)["gather"] == "no light, emission or world"


def test_emission_that_is_not_sampled_lights_by_itself():
    assert "gather" in names(planned(builders.scene(FLOOR, materials=(GLOWING,))))


@every_method
def test_who_finds_the_worlds_diffuse_light(method):
    """Once: `direct` samples it exactly where the method does not find it, or where highlights show it."""
    found = planned(builders.scene(FLOOR, world=(1.0, 1.0, 1.0)), method)
    gathers = method in WORLD_METHODS
    assert found.indirect.world_gathered == gathers
    assert found.lights.world_gathered == gathers
    assert (found.lights.world_directions == 0) == gathers
    assert ("WORLD" in found.find(PASS_OF[method]).defines) == gathers
    glossy = builders.scene(FLOOR, world=(1.0, 1.0, 1.0), materials=(builders.material(specular=0.04),))
    assert planned(glossy, method).lights.world_directions > 0
    unseen = replace(EVERYTHING, world=replace(EVERYTHING.world, seen_by_diffuse=False))
    if method not in (IndirectMethod.OCCLUSION, IndirectMethod.SSAO):
        assert not planned(unseen, method).indirect.world_gathered


@every_method
def test_layers_are_built_for_the_method(method):
    found = planned(method=method, layers=3)
    assert found.layers == found.indirect.layers == 3
    assert "LAYERS 3" in found.find(PASS_OF[method]).defines


def test_a_grid_without_a_march_before_it_reads_one_layer():
    found = planned(layers=3, indirect={"contact_steps": 0})
    assert not reads_layers(IndirectSettings(IndirectMethod.MARCH_GRID, contact_steps=0))
    assert (found.layers, found.indirect.layers, found.indirect.exit) == (1, 1, False)
    assert "layers 2–3" in " ".join(reasons(found))
    assert "exit" in reasons(found)


@every_method
@pytest.mark.parametrize("wanted", [False, True])
def test_exit_surfaces_are_for_marched_rays(method, wanted):
    found = planned(method=method, indirect={"exit_surfaces": wanted})
    expected = wanted and method in RAY_METHODS
    assert found.indirect.exit == expected
    assert ("exit" in names(found)) == expected
    reader = found.find(PASS_OF[method])
    assert ("EXIT" in reader.defines) == ("exit.view_depth" in reader.reads) == expected


@every_method
def test_the_guard_band_is_for_what_looks_around(method):
    assert planned(method=method, guard_band=7).guard_band == 7
    assert planned(method=IndirectMethod.NONE, guard_band=7).guard_band == 0


@pytest.mark.parametrize(
    ("divisor", "spatial", "temporal", "continuous", "chain"),
    [
        (1, False, False, False, [IRRADIANCE_TARGET]),
        (1, False, True, False, [IRRADIANCE_TARGET]),
        (1, False, True, True, [GATHERED_TARGET, IRRADIANCE_TARGET]),
        (1, True, False, False, [GATHERED_TARGET, IRRADIANCE_TARGET]),
        (1, True, True, True, [GATHERED_TARGET, BLENDED_TARGET, IRRADIANCE_TARGET]),
        (2, False, False, False, [GATHERED_TARGET, IRRADIANCE_TARGET]),
        (4, False, True, True, [GATHERED_TARGET, BLENDED_TARGET, IRRADIANCE_TARGET]),
        (2, True, True, False, [GATHERED_TARGET, IRRADIANCE_TARGET]),
    ],
)
@every_method
def test_each_filter_reads_what_was_written_before_it(method, divisor, spatial, temporal, continuous, chain):
    """From the method to the composite; what is written last has every pixel, what is before it 1/divisor of them."""
    indirect = {"divisor": divisor, "spatial_filter": spatial, "temporal_filter": temporal}
    found = planned(method=method, indirect=indirect, continuous=continuous)
    stages = [item for item in found.passes if item.name in (PASS_OF[method], "temporal", "filter")]
    assert [stage.writes[0].name for stage in stages] == chain
    for before, stage in pairwise(stages):
        assert before.writes[0].name in stage.reads
        assert before.writes[0].divisor == divisor
    last = stages[-1].writes[0]
    assert (last.divisor, last.components, last.dtype) == (1, 4, "f4")
    assert IRRADIANCE_TARGET in found.find("composite").reads
    assert ("temporal" in names(found)) == (temporal and continuous)
    assert ("filter" in names(found)) == (spatial or divisor > 1)
    assert {"temporal", "filter"} - {*names(found)} <= {*reasons(found)}
    if "filter" in names(found):
        scratch = [target for name, target in writes(found, "filter").items() if "scratch" in name]
        assert len(scratch) == (2 if spatial else 0)
        assert all(target.divisor == divisor for target in scratch)


@pytest.mark.parametrize("continuous", [False, True])
def test_why_views_are_not_blended(continuous):
    off = planned(indirect={"temporal_filter": False}, continuous=continuous)
    assert reasons(off)["temporal"] == "temporal filter is off"
    assert reasons(planned())["temporal"] == "a final render has no views before it"
    assert "it is off" in reasons(planned(indirect={"spatial_filter": False, "divisor": 1}))["filter"]


def test_views_of_what_light_is_made_of():
    """Those that the method can show are written and shown; any other debug view needs no indirect light."""
    origin = {DebugView.GRID_CELLS, DebugView.GRID_RADIANCE, DebugView.MARCH_HITS, DebugView.LIGHT_ORIGIN}
    shown = {
        IndirectMethod.MARCH_GRID: origin,
        IndirectMethod.DEEP_MARCH: {DebugView.MARCH_HITS, DebugView.LIGHT_ORIGIN},
    }
    for method in METHODS:
        for view in origin:
            found = planned(method=method, debug_view=view)
            assert (ORIGIN_TARGET in writes(found, PASS_OF[method])) == (view in shown.get(method, ())), (method, view)
            assert (f"DEBUG_{view.value}" in found.find("composite").defines) == (view in shown.get(method, ()))
        found = planned(method=method, debug_view=DebugView.INDIRECT)
        assert "DEBUG_INDIRECT" in found.find("composite").defines
        assert IRRADIANCE_TARGET in found.find("composite").reads


@every_method
def test_the_composite_adds_it_and_delivers_it(method):
    found = planned(method=method, channels=frozenset({Channel.DIFFUSE_INDIRECT}))
    composite = found.find("composite")
    assert {"INDIRECT", "FILM_DIFFUSE_INDIRECT"} <= composite.defines
    assert {"gbuffer.normal", "gbuffer.base_color", "gbuffer.material", IRRADIANCE_TARGET} <= {*composite.reads}
    assert "film.diffuse_indirect" in [target.name for target in composite.writes]


def test_a_film_of_indirect_light_is_there_where_there_is_none():
    found = planned(DARK, channels=frozenset({Channel.DIFFUSE_INDIRECT}))
    assert "film.diffuse_indirect" in [target.name for target in found.find("composite").writes]
    assert IRRADIANCE_TARGET not in found.find("composite").reads


def test_nothing_is_read_that_nobody_writes():
    for method in METHODS:
        for continuous in (False, True):
            found = planned(method=method, continuous=continuous, layers=2)
            written = set()
            for item in found.passes:
                missing = {name for name in item.reads if name.startswith("indirect.")} - written
                assert not missing, (method, item.name)
                written |= {target.name for target in item.writes}


@every_method
def test_the_grid_says_which_linked_lights_it_takes_for_others(method):
    """Their direct light is linked; what of it is reflected is not, where the grid finds it."""
    lights = (builders.light(), replace(builders.light(), key="rim", name="Rim", receiver_groups=1))
    scene = replace(EVERYTHING, lights=lights)
    settings = RenderSettings(64, 64, indirect=IndirectSettings(method))
    found = linking_warnings(scene, indirect_needs(scene, settings, []))
    assert [("Rim" in sentence) for sentence in found] == [True] * (method is IndirectMethod.MARCH_GRID)
