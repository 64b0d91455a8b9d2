# SPDX-License-Identifier: GPL-3.0-or-later
"""Indirect light in Blender: properties become settings, qualities are presets of numbers, the pass is delivered."""

from dataclasses import asdict, replace
from itertools import pairwise

import bpy
import numpy as np
import pytest
from engine_fixtures import plane_scene_fixture, registered_fixture, render  # noqa: F401 - fixtures
from test_engine_panels import drawn

from addon.engine import settings
from addon.report.pictures import combined
from addon.scene import IndirectMethod, IndirectSettings
from addon.scene.quality import DEFAULT_QUALITY, QUALITIES, Quality
from addon.ui import indirect_panels

INSIDE = (15, 4)
"""A pixel of the plane."""

DEFAULT = IndirectSettings(method=IndirectMethod.MARCH_GRID, bounces=4, **asdict(QUALITIES[DEFAULT_QUALITY]))
SHARED = {
    "method": "DEEP_MARCH",
    "bounces": 7,
    "radius": 0.25,
    "march_distance": 12.5,
    "exit_surfaces": True,
    "cell_size": 0.125,
    "spatial_filter": False,
    "temporal_filter": False,
    "paper_composite": True,
}
NUMBERS = {"rays": 3, "taps": 5, "march_steps": 7, "contact_steps": 9, "cells": 11, "cell_rays": 13}


@pytest.fixture(name="indirect")
def indirect_fixture(registered):
    """The settings of a new scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene.deep_gbuffer.indirect


def both(scene=None):
    """The indirect light of a final render and of a viewport."""
    scene = scene or bpy.context.scene
    final = settings.final(scene, 64, 32, frozenset()).render
    return final.indirect, settings.viewport(scene, 64, 32).indirect


def numbers_of(quality):
    """What a group's numbers are, as the table has them."""
    return {name: int(getattr(quality, name)) for name in asdict(QUALITIES[DEFAULT_QUALITY])}


def test_a_new_scene_marches_rays_and_has_a_grid(indirect):
    assert both() == (DEFAULT, DEFAULT)
    assert (indirect.render.preset, indirect.viewport.preset) == (DEFAULT_QUALITY, DEFAULT_QUALITY)


def test_every_property_is_a_setting(indirect):
    for name, value in SHARED.items():
        setattr(indirect, name, value)
    indirect.grid_memory = "1024"
    for name, value in NUMBERS.items():
        setattr(indirect.render, name, value)
        setattr(indirect.viewport, name, value + 1)
    indirect.render.divisor, indirect.viewport.divisor = "1", "4"
    final, viewport = both()
    assert asdict(final) == {**SHARED, "grid_memory": 1024, **NUMBERS, "divisor": 1}
    assert viewport == replace(final, **{name: value + 1 for name, value in NUMBERS.items()}, divisor=4)


def test_unlimited_bounces_win(indirect):
    indirect.bounces, indirect.unlimited_bounces = 3, True
    assert [each.bounces for each in both()] == [None, None]


@pytest.mark.parametrize("quality", list(Quality))
def test_a_quality_writes_its_numbers_for_its_own_use_only(indirect, quality):
    before = numbers_of(indirect.viewport)
    indirect.render.preset = quality.value
    assert numbers_of(indirect.render) == asdict(QUALITIES[quality])
    assert indirect.render.preset == quality.value
    assert numbers_of(indirect.viewport) == before


@pytest.mark.parametrize("name", ["divisor", *NUMBERS])
def test_any_number_of_ones_own_is_custom_and_its_preset_again_is_not(indirect, name):
    group = indirect.render
    group.preset = "HIGH"
    before = getattr(group, name)
    setattr(group, name, "4" if name == "divisor" else before + 1)
    changed = numbers_of(group)
    assert group.preset == "CUSTOM"
    group.preset = "CUSTOM"
    assert numbers_of(group) == changed
    setattr(group, name, before)
    assert group.preset == "HIGH"


def test_no_two_qualities_are_the_same_and_better_ones_cost_more():
    ordered = [QUALITIES[quality] for quality in Quality]
    assert len(set(ordered)) == len(ordered)
    for worse, better in pairwise(ordered):
        assert better.divisor <= worse.divisor
        less, more = ({**asdict(each), "divisor": 0} for each in (worse, better))
        assert all(less[name] <= more[name] for name in less)


def test_a_choice_is_undone_and_done_again(indirect):
    bpy.ops.ed.undo_push(message="before")
    indirect.render.preset, indirect.method = "ULTRA", "RADIOSITY"
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    found = bpy.context.scene.deep_gbuffer.indirect
    assert (found.render.preset, found.method) == (DEFAULT_QUALITY, "MARCH_GRID")
    bpy.ops.ed.redo()
    found = bpy.context.scene.deep_gbuffer.indirect
    assert (found.render.preset, found.method) == ("ULTRA", "RADIOSITY")


def test_a_file_keeps_what_was_set(indirect, tmp_path):
    indirect.method, indirect.viewport.preset, indirect.render.cells = "OCCLUSION", "DRAFT", 99
    path = str(tmp_path / "kept.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    found = bpy.context.scene.deep_gbuffer.indirect
    assert (found.method, found.viewport.preset, found.render.cells) == ("OCCLUSION", "DRAFT", 99)
    assert found.render.preset == "CUSTOM"


def test_a_file_from_before_has_the_defaults(registered, repository):
    """It was saved when there was no indirect light, and has other settings of ours."""
    bpy.ops.wm.open_mainfile(filepath=str(repository / "scenes" / "cornell_box.blend"))
    assert both() == (DEFAULT, DEFAULT)


def shown(*panels):
    """Properties that these panels of indirect light show, and those that are gray."""
    layouts = [drawn(panel) for panel in panels if panel.poll(bpy.context)]
    return {name for each in layouts for name in each.properties}, {name for each in layouts for name in each.gray}


QUALITY = {"preset", "divisor"}
ALWAYS = {"method", "spatial_filter", "temporal_filter", *QUALITY}
RAYS = {"rays", "bounces", "unlimited_bounces", "exit_surfaces"}


@pytest.mark.parametrize(
    ("method", "expected"),
    [
        ("NONE", {"method"}),
        ("OCCLUSION", ALWAYS | {"taps", "radius"}),
        ("SSAO", ALWAYS | {"taps", "radius"}),
        ("RADIOSITY", ALWAYS | {"taps", "radius", "bounces", "unlimited_bounces", "paper_composite"}),
        ("DEEP_MARCH", ALWAYS | RAYS | {"march_steps", "march_distance"}),
        ("MARCH_GRID", ALWAYS | RAYS | {"contact_steps", "cells", "cell_rays", "cell_size", "grid_memory"}),
    ],
)
def test_only_what_the_method_reads_is_shown(indirect, method, expected):
    bpy.context.scene.render.engine = "DEEP_GBUFFER"
    indirect.method = method
    assert shown(*indirect_panels.CLASSES[1:]) == (expected, set())


@pytest.mark.parametrize(
    ("change", "gray"),
    [
        ({"unlimited_bounces": True}, {"bounces"}),
        ({"cell_size": 0.5}, set()),
        ({"render": 0}, set()),
        ({"render": 0, "viewport": 0}, {"exit_surfaces"}),
    ],
)
def test_what_another_setting_makes_useless_is_gray(indirect, change, gray):
    bpy.context.scene.render.engine = "DEEP_GBUFFER"
    for name, value in change.items():
        if name in {"render", "viewport"}:
            getattr(indirect, name).contact_steps = value
        else:
            setattr(indirect, name, value)
    assert shown(*indirect_panels.CLASSES[1:])[1] == gray


def world_light(scene, radiance):
    """A world of one colour."""
    scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND").inputs
    background["Color"].default_value, background["Strength"].default_value = (*radiance, 1.0), 1.0


def ask_for_light(scene):
    """Make Blender ask for diffuse passes; their names in this version."""
    layer = scene.view_layers[0]
    layer.use_pass_diffuse_direct = layer.use_pass_diffuse_indirect = layer.use_pass_diffuse_color = True
    if bpy.app.version < (5, 0, 0):
        return ["ViewLayer.DiffDir", "ViewLayer.DiffInd", "ViewLayer.DiffCol"]
    return ["ViewLayer.Diffuse Direct", "ViewLayer.Diffuse Indirect", "ViewLayer.Diffuse Color"]


def test_without_a_method_the_pass_is_black(plane_scene, tmp_path):
    _direct, name, _color = ask_for_light(plane_scene)
    passes = render(plane_scene, tmp_path)
    assert passes[name].shape == (30, 40, 3)
    assert not passes[name].any()


@pytest.mark.parametrize("tilt", [0.0, 0.9])
@pytest.mark.parametrize("method", ["OCCLUSION", "MARCH_GRID"])
def test_an_open_plane_receives_the_worlds_light_by_the_pass(plane_scene, tmp_path, method, tilt):
    """Nothing hides the world: irradiance π L, radiance over albedo L; the rest of the picture is the sun's."""
    radiance = (0.5, 0.25, 1.0)
    plane_scene.deep_gbuffer.indirect.method = method
    world_light(plane_scene, radiance)
    plane_scene.camera.rotation_euler.y = tilt
    names = ask_for_light(plane_scene)
    passes = render(plane_scene, tmp_path)
    direct, found, color = (passes[name][INSIDE] for name in names)
    np.testing.assert_allclose(found, radiance, rtol=0.01)
    np.testing.assert_allclose(direct, (1.0, 1.0, 1.0), rtol=0.01)
    np.testing.assert_allclose(passes["ViewLayer.Combined"][INSIDE][:3], (direct + found) * color, rtol=0.01)


def denoised(scene):
    """Make Blender's compositor denoise the picture by its own node, fed with our albedo and normals."""
    if bpy.app.version < (5, 0, 0):
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        end = tree.nodes.new("CompositorNodeComposite").inputs["Image"]
    else:
        tree = scene.compositing_node_group = bpy.data.node_groups.new("Denoise", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        end = tree.nodes.new("NodeGroupOutput").inputs["Image"]
    layers, denoise = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeDenoise")
    albedo = "DiffCol" if bpy.app.version < (5, 0, 0) else "Diffuse Color"
    for output, socket in (("Image", "Image"), (albedo, "Albedo"), ("Normal", "Normal")):
        tree.links.new(layers.outputs[output], denoise.inputs[socket])
    tree.links.new(denoise.outputs["Image"], end)


def test_blenders_own_denoiser_takes_our_albedo_and_normals(plane_scene, tmp_path):
    """Of the noise of one ray per pixel around a box, seen through pixel centres, less than half is left."""
    plane_scene.render.filter_size = 0.01
    layer = plane_scene.view_layers[0]
    layer.use_pass_diffuse_color = layer.use_pass_normal = True
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(-1.0, 0.0, 0.5))
    world_light(plane_scene, (1.0, 1.0, 1.0))
    bpy.data.objects["Sun"].data.energy = 0.0
    ours = plane_scene.deep_gbuffer
    ours.indirect.method, ours.indirect.spatial_filter = "DEEP_MARCH", False
    ours.indirect.render.divisor, ours.indirect.render.rays = "1", 1
    ours.samples = 64
    converged = render(plane_scene, tmp_path)
    ours.samples = 1
    noisy = render(plane_scene, tmp_path)
    denoised(plane_scene)
    plane_scene.render.use_compositing = True
    assert bpy.ops.render.render() == {"FINISHED"}
    path, image = tmp_path / "denoised.exr", plane_scene.render.image_settings
    if bpy.app.version >= (5, 0, 0):
        image.media_type = "IMAGE"
    image.file_format = "OPEN_EXR"
    bpy.data.images["Render Result"].save_render(str(path), scene=plane_scene)
    truth, before = (passes["ViewLayer.Combined"][..., :3] for passes in (converged, noisy))
    noise, left = (np.sqrt(np.mean((pixels - truth)[3:27, 3:17] ** 2)) for pixels in (before, combined(path)))
    assert left < 0.5 * noise
