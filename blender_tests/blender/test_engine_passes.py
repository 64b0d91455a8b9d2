# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of passes: what the renderer is asked for, and light divided by colour as Cycles divides it."""

import bpy
import numpy as np
import pytest
from engine_fixtures import plane_scene_fixture, registered_fixture, render  # noqa: F401 - fixtures
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from addon.engine import passes
from addon.scene import Channel

COLORS = hnp.arrays(np.float32, (2, 3, 3), elements=st.sampled_from([0.0, 0.25, 0.5, 1.0]))
LIGHTS = hnp.arrays(np.float32, (2, 3, 3), elements=st.floats(0.0, 8.0, width=16))


@given(LIGHTS, COLORS)
def test_light_over_colour_times_colour_is_light(light, color):
    np.testing.assert_array_equal(passes.over(light * color, color) * color, light * color)


@given(LIGHTS)
def test_light_is_black_over_black(light):
    assert not passes.over(light, np.zeros_like(light)).any()


@pytest.mark.parametrize(
    ("light", "color", "expected"),
    [
        ((2.0, 4.0, 6.0), (0.0, 1.0, 1.0), (5.0, 4.0, 6.0)),
        ((2.0, 4.0, 6.0), (0.5, 0.0, 1.0), (4.0, 5.0, 6.0)),
        ((2.0, 4.0, 6.0), (1.0, 0.0, 0.0), (2.0, 2.0, 2.0)),
        ((2.0, 4.0, 6.0), (0.0, 0.0, 2.0), (3.0, 3.0, 3.0)),
    ],
)
def test_without_a_colour_a_channel_is_the_mean_of_the_others(light, color, expected):
    quotient = passes.over(*(np.array([[values]], np.float32) for values in (light, color)))
    assert quotient.dtype == np.float32
    np.testing.assert_array_equal(quotient[0, 0], expected)


def test_only_light_asks_for_a_colour_that_is_no_pass():
    by_channel = {item.channel: item for item in passes.PASSES}
    assert set(by_channel) == set(Channel)
    asked = {channel: passes.channels([item]) - {channel} for channel, item in by_channel.items()}
    assert {channel: colors for channel, colors in asked.items() if colors} == {
        Channel.DIFFUSE_DIRECT: {Channel.DIFFUSE_COLOR},
        Channel.DIFFUSE_INDIRECT: {Channel.DIFFUSE_COLOR},
        Channel.GLOSSY_DIRECT: {Channel.GLOSSY_COLOR},
    }


def test_images_are_named_and_divided():
    wanted = [item for item in passes.PASSES if item.channel in {Channel.DIFFUSE_DIRECT, Channel.EMISSION}]
    light, color, emission = (np.full((1, 2, 3), value, np.float32) for value in (0.5, 0.25, 3.0))
    delivered = {Channel.DIFFUSE_DIRECT: light, Channel.DIFFUSE_COLOR: color, Channel.EMISSION: emission}
    direct, emitted = ("DiffDir", "Emit") if bpy.app.version < (5, 0, 0) else ("Diffuse Direct", "Emission")
    images = passes.images(wanted, delivered)
    assert set(images) == {direct, emitted}
    np.testing.assert_array_equal(images[direct], np.full((1, 2, 3), 2.0))
    assert images[emitted] is emission


def test_passes_are_cycles_by_name_and_add_up_to_the_picture(plane_scene, tmp_path):
    """Emission, and each colour times its light, of an opaque scene."""
    plane = bpy.data.objects["Plane"]
    shader = next(node for node in plane.active_material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Specular IOR Level"].default_value = 0.5
    shader.inputs["Emission Color"].default_value = (0.5, 0.25, 0.125, 1.0)
    shader.inputs["Emission Strength"].default_value = 1.0
    flags = [item.flag for item in passes.PASSES if item.flag]
    for flag in flags:
        setattr(bpy.context.view_layer, flag, True)
    ours = {name.removeprefix("ViewLayer."): pixels for name, pixels in render(plane_scene, tmp_path).items()}
    plane_scene.render.engine = "CYCLES"
    plane_scene.cycles.samples = 1
    theirs = {name.removeprefix("ViewLayer.") for name in render(plane_scene, tmp_path)}
    assert set(ours) <= theirs
    names = {item.channel: item.name for item in passes.PASSES}
    total = ours[names[Channel.EMISSION]] + ours[names[Channel.ENVIRONMENT]]
    for light, color in (
        (Channel.DIFFUSE_DIRECT, Channel.DIFFUSE_COLOR),
        (Channel.GLOSSY_DIRECT, Channel.GLOSSY_COLOR),
    ):
        assert ours[names[light]].max() > 0.0
        total = total + ours[names[light]] * ours[names[color]]
    np.testing.assert_allclose(total, ours["Combined"][..., :3], rtol=1e-2, atol=1e-3)
