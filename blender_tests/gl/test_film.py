# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from addon.render.indirect_plan import INDIRECT_DEBUG_VIEWS
from addon.scene import Channel, DebugView, LightKind, Variant
from blender_tests import builders

GLOWING = builders.material(emission=(1.0, 1.0, 1.0), base_color=(0, 0, 0))


def half_plane(edge):
    """A glowing surface left of x = edge pixels in a 32-pixel picture of a window 2 m wide at 3 m."""
    x = (edge / 16 - 1) * 3.0
    corners = [(-9, -9, 0), (x, -9, 0), (x, 9, 0), (-9, 9, 0)]
    return builders.scene(builders.mesh("q", corners, [(0, 1, 2), (0, 2, 3)]), materials=(GLOWING,))


@pytest.mark.parametrize("edge", [15.7, 16.0, 16.45])
def test_an_edge_is_the_filters_integral(render, edge):
    """A pixel's value is the share of the Blackman–Harris filter on the bright side, to the spacing of 256 samples."""
    view = render(half_plane(edge), builders.camera(), samples=256, filter_radius=1.5)
    row = view.channels[Channel.COMBINED][16, :, 0]
    x = np.linspace(-1.5, 1.5, 60001)
    phase = 2 * np.pi * (x / 3 + 0.5)
    w = 0.35875 - 0.48829 * np.cos(phase) + 0.14128 * np.cos(2 * phase) - 0.01168 * np.cos(3 * phase)
    for pixel in range(12, 21):
        expected = w[x < edge - (pixel + 0.5)].sum() / w.sum()
        assert row[pixel] == pytest.approx(expected, abs=4 / 256)


def test_no_filter_gives_hard_edges(render):
    row = render(half_plane(16.3), builders.camera(), samples=8).channels[Channel.COMBINED][16, :, 0]
    np.testing.assert_array_equal(row, (np.arange(32) < 16).astype(np.float32))


def test_the_same_settings_give_the_same_bits_whatever_came_before(render):
    scene = half_plane(16.3)
    first = render(scene, builders.camera(), samples=64, filter_radius=1.5).channels[Channel.COMBINED]
    render(builders.scene(builders.quad("other")), builders.camera(), width=7, height=5)
    again = render(scene, builders.camera(), samples=64, filter_radius=1.5).channels[Channel.COMBINED]
    np.testing.assert_array_equal(first, again)
    other_seed = render(scene, builders.camera(), samples=64, filter_radius=1.5, seed=3).channels[Channel.COMBINED]
    assert (first != other_seed).any()


def test_background_is_the_world_or_transparent(render):
    scene = builders.scene(builders.quad("q", half=0.3), world=(0.25, 0.5, 0.75))
    solid = render(scene, builders.camera()).channels[Channel.COMBINED]
    clear = render(scene, builders.camera(), transparent_film=True).channels[Channel.COMBINED]
    np.testing.assert_allclose(solid[0, 0], (0.25, 0.5, 0.75, 1.0))
    np.testing.assert_array_equal(clear[0, 0], 0.0)
    np.testing.assert_array_equal(clear[16, 16], solid[16, 16])


@pytest.mark.parametrize("view", sorted(set(DebugView) - INDIRECT_DEBUG_VIEWS - {DebugView.NONE}))
@pytest.mark.parametrize("layer", [0, 1])
def test_debug_views_show_their_channel_of_their_layer(render, view, layer):
    front = builders.material("front", base_color=(0.5, 0.25, 0), metallic=1.0, roughness=0.2, emission=(2, 0, 0))
    back = builders.material("back", base_color=(0.0, 0.25, 0.5), metallic=0.0, roughness=0.8, emission=(0, 3, 0))
    exit_color = (0.2, 0.4, 0.8)
    away = np.diag([-1.0, 1.0, -1.0, 1.0])
    scene = builders.scene(
        builders.quad("front", z=1.0),
        builders.quad("back", z=-1.0),
        builders.quad("exit", z=2.0),
        materials=(front, back, builders.material("exit", base_color=exit_color)),
        batches=[
            builders.batch("front", materials=("front",), object_index=1),
            builders.batch("back", materials=("back",), object_index=2),
            builders.batch("exit", [away], materials=("exit",)),
        ],
    )
    shown = render(scene, builders.camera(), debug_view=view, debug_layer=layer).channels[Channel.COMBINED][16, 16]
    materials = (front, back)
    depth = (2.0, 4.0)[layer]
    expected = {
        DebugView.DEPTH: (depth / (1 + depth),) * 3,
        DebugView.NORMAL: (0.5, 0.5, 1.0),
        DebugView.ALBEDO: materials[layer].base_color,
        DebugView.METALLIC: (materials[layer].metallic,) * 3,
        DebugView.ROUGHNESS: (materials[layer].roughness,) * 3,
        DebugView.EMISSION: materials[layer].emission,
        DebugView.DIRECT: materials[layer].emission,
        DebugView.MOTION: (0.5, 0.5, 0.5),
        DebugView.EXIT_DEPTH: (5 / (1 + 5),) * 3,
        DebugView.EXIT_NORMAL: (0.5, 0.5, 1.0),
        DebugView.EXIT_ALBEDO: exit_color,
    }
    if view is DebugView.OBJECT_INDEX:
        other = render(scene, builders.camera(), debug_view=view, debug_layer=1 - layer)
        assert (shown[:3] != other.channels[Channel.COMBINED][16, 16, :3]).any()
    else:
        np.testing.assert_allclose(shown[:3], expected[view], atol=2e-3)


def test_light_samples_converge(render):
    """A close light's samples approach the closed form: 64 are nearer to 1024 than four are."""
    light = builders.light(LightKind.AREA, (0.4, 0.2, 0.6), (5, 5, 5), size=(1.5, 1.5))
    scene = builders.scene(builders.quad("q"), lights=(light,))
    means = [render(scene, builders.camera(), samples=n).channels[Channel.COMBINED] for n in (4, 64, 1024)]
    assert np.abs(means[1] - means[2]).max() < 0.05 * np.abs(means[0] - means[2]).max()


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_guard_band_does_not_change_the_picture(render, orthographic):
    """Highlights, positions and layers of a slanted plane, which fills the guard band too, to float32's rounding."""
    slope = np.array([[1, 0, 0.3, 0], [0, 1, 0, 0], [-0.3, 0, 1, 0], [0, 0, 0, 1]])
    glossy = builders.material(
        metallic=0.5, roughness=0.3, specular=0.2, base_color=(0.9, 0.5, 0.2), emission=(0.0, 0.0, 0.1)
    )
    scene = builders.scene(
        builders.quad("front", half=20.0),
        builders.quad("back", z=-2.0, half=20.0),
        materials=(glossy,),
        batches=[builders.batch("front", [slope]), builders.batch("back", [slope])],
        lights=(builders.light(LightKind.AREA, (0.4, 0.2, 0.6), (5, 5, 5), size=(1.5, 1.5)),),
    )
    camera = builders.camera(orthographic=orthographic)
    plain, guarded = (
        render(
            scene,
            camera,
            width=31,
            height=18,
            samples=3,
            filter_radius=1.5,
            channels=tuple(Channel),
            deep_output=True,
            variant=Variant.REPROJECT,
            guard_band=guard_band,
        )
        for guard_band in (0, 7)
    )
    assert (plain.plan.guard_band, guarded.plan.guard_band) == (0, 7)
    for channel in Channel:
        assert plain.channels[channel].shape == guarded.channels[channel].shape
        np.testing.assert_allclose(guarded.channels[channel], plain.channels[channel], rtol=1e-4, atol=1e-5)
    for without, within in zip(plain.layers, guarded.layers, strict=True):
        np.testing.assert_allclose(within.depth, without.depth, rtol=1e-5)
        np.testing.assert_allclose(within.radiance, without.radiance, rtol=1e-4, atol=1e-5)
