# SPDX-License-Identifier: GPL-3.0-or-later
"""Radiosity: what the layers around each pixel send to it, and how often."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import screen_reference as reference
from random_scenes import random_scene

from addon.render.indirect_plan import BOUNCE_DIVISOR
from addon.render.passes.radiosity import MOST_BOUNCES, bounce_count
from addon.render.screen_taps import spiral_turns
from addon.scene import Channel, EmissionSampling, IndirectMethod, IndirectSettings, LightKind
from blender_tests import builders
from blender_tests.indirect_scenes import (
    CORNELL_CAMERA,
    block,
    cornell,
    glowing,
    looking,
    of,
    placed,
    radiance,
    rectangle,
    seen_from,
)

ONCE = IndirectSettings(IndirectMethod.RADIOSITY, bounces=1, divisor=1, spatial_filter=False, radius=1.0)
LAMP = builders.light(position=(0.0, 0.0, 0.9), emission=(3.0, 2.0, 1.0))
LAMPS = (
    builders.light(position=(1.0, 2.0, 3.0), emission=(20.0, 10.0, 5.0)),
    builders.light(LightKind.SUN, emission=(1.0, 2.0, 3.0)),
)


def picture(session, scene, camera, indirect=ONCE, *, size=64, samples=1, **settings):
    """A view whose layers can be read."""
    channels = {Channel.DIFFUSE_INDIRECT, Channel.DIFFUSE_COLOR}
    return session.show(
        scene,
        camera,
        width=size,
        height=size,
        samples=samples,
        channels=channels,
        indirect=indirect,
        deep_output=True,
        **settings,
    )


def irradiance(view):
    """(H, W, 3) W/m² of the nearest layer, where it reflects anything."""
    albedo = view.channels[Channel.DIFFUSE_COLOR][..., :3].astype(np.float64)
    reflected = view.channels[Channel.DIFFUSE_INDIRECT][..., :3].astype(np.float64)
    return np.pi * reflected / np.maximum(albedo, 1e-9)


def expected_senders(view, camera, indirect=ONCE, sent=None, receiver=0, divisor=1):
    """What the reference finds on the layers of a view, and those layers."""
    layers = reference.read_back(view, camera)
    sent = layers.radiance if sent is None else sent
    turns = spiral_turns(indirect.taps)
    return reference.senders(layers, sent, indirect.taps, turns, indirect.radius, receiver, divisor), layers


def random_view(session, seed, *, orthographic=False, indirect=ONCE, **settings):
    """A view of things of all directions, and its camera."""
    camera = builders.camera(z=8.0, half_width=3.0 if orthographic else 0.35, orthographic=orthographic)
    scene = replace(random_scene(np.random.default_rng(seed)), lights=LAMPS)
    return picture(session, scene, camera, indirect, minimum_separation=0.1, **settings), camera


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("orthographic", [False, True])
def test_irradiance_is_that_of_the_layers_read_back(shared_session, seed, orthographic):
    """Against float64 where nothing is within rounding of being another tap or another test's outcome."""
    indirect = replace(ONCE, radius=1.5)
    view, camera = random_view(shared_session, seed, orthographic=orthographic, indirect=indirect, layers=3)
    found, layers = expected_senders(view, camera, indirect)
    certain = found.certain & layers.covered
    expected = reference.energy_correct_irradiance(found)
    assert certain.sum() > 300
    assert (expected[certain] > 0.1).any()
    np.testing.assert_allclose(irradiance(view)[certain], expected[certain], rtol=2e-3, atol=1e-4)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_further_bounce_gathers_what_all_layers_reflect_of_the_one_before(shared_session, seed):
    """Where a tap of the last bounce is certain; those of the bounces before are so on the whole."""
    indirect = replace(ONCE, bounces=3, radius=1.5)
    view, camera = random_view(shared_session, seed, indirect=indirect)
    layers = reference.read_back(view, camera)
    sent, pictures = layers.radiance, []
    y, x = np.mgrid[:64, :64] // BOUNCE_DIVISOR * BOUNCE_DIVISOR + BOUNCE_DIVISOR // 2
    for _ in range(3):
        found, _ = expected_senders(view, camera, indirect, sent)
        pictures.append(reference.energy_correct_irradiance(found))
        coarse = [
            expected_senders(view, camera, indirect, sent, layer, BOUNCE_DIVISOR)[0] for layer in range(len(sent))
        ]
        arriving = np.stack([reference.energy_correct_irradiance(senders) for senders in coarse])
        # Each pixel takes what was found for the one that its texel looks from.
        sent = layers.radiance + layers.albedo / np.pi * arriving[:, y, x]
    certain = found.certain & layers.covered
    total = pictures[-1][certain].sum()
    difference = np.abs(irradiance(view)[certain] - pictures[-1][certain]).sum() / total
    assert difference < 0.002
    assert np.abs(pictures[-1] - pictures[-2])[certain].sum() > 3.0 * difference * total


def lit_wall_behind_a_card():
    """A wall beside the floor, which a card hides from a camera above."""
    wall = builders.mesh(
        "wall",
        [(0, -2, 0), (0, 2, 0), (-0.6, 2, 0.9), (-0.6, -2, 0.9)],
        [(0, 1, 2), (0, 2, 3)],
        normals=np.zeros((4, 3)),
    )
    card = builders.quad("card", z=3.0, half=1.0, center=(-1.0, 0.0))
    black = builders.material("black", base_color=(0.0, 0.0, 0.0))
    lamp = builders.light(LightKind.SUN, emission=(3.0, 3.0, 3.0), casts_shadow=False)
    floor, white = builders.quad("floor", half=50.0), builders.material()
    return of((floor, white), (wall, white), (card, black), lights=(lamp,))


def test_what_the_second_layer_hides_sends_light(shared_session):
    camera = builders.camera(z=10.0, half_width=1.0, orthographic=True)
    one, two = (
        irradiance(picture(shared_session, lit_wall_behind_a_card(), camera, layers=layers)) for layers in (1, 2)
    )
    beside = np.s_[16:48, 33:40]
    np.testing.assert_allclose(one[beside], 0.0, atol=1e-6)
    assert two[beside].mean() > 0.05


def test_only_what_faces_within_the_radius_sends(shared_session):
    """A shining card over the floor: from its front, not from its back, not from beyond the radius."""
    camera = looking((0.0, -6.0, 4.0), (0.0, 0.0, 0.4), 0.25)
    floor, white = builders.quad("floor", half=5.0), builders.material()

    def found(mesh, radius, rows, layers=1):
        scene = of((floor, white), (mesh, glowing()))
        view = picture(shared_session, scene, camera, replace(ONCE, radius=radius), layers=layers)
        return irradiance(view)[rows].max()

    before = rectangle("panel", (0, 0.4, 0.4), (0.4, 0, 0), (0, 0, 0.4))
    assert found(before, 1.0, np.s_[:30]) > 0.5
    # Of this one the camera sees the same side, and the floor that is seen above it is behind it.
    behind = rectangle("panel", (0, -1.2, 0.4), (0.4, 0, 0), (0, 0, 0.4))
    assert found(behind, 3.0, np.s_[:12]) > 0.5
    assert found(behind, 3.0, np.s_[26:]) == 0.0
    above = block("far", (0.0, 0.0, 1.6), 0.2)
    assert found(above, 1.0, np.s_[:47], layers=2) == 0.0
    assert found(above, 3.0, np.s_[:47], layers=2) > 0.01


def test_a_plane_sends_nothing_to_itself(shared_session):
    scene = of((builders.quad("floor", half=20.0), glowing(albedo=0.5)))
    for angle in (0.0, 0.7, 1.2):
        camera = looking((0.0, -5.0 * np.sin(angle), 5.0 * np.cos(angle)), (0.0, 0.0, 0.0), 0.2)
        assert irradiance(picture(shared_session, scene, camera)).max() < 1e-4


@pytest.mark.parametrize("seed", [3, 4])
def test_no_more_arrives_than_a_hemisphere_of_the_brightest_sends(shared_session, seed):
    view, _ = random_view(shared_session, seed, indirect=replace(ONCE, radius=3.0), layers=4)
    brightest = max(layer.radiance.max() for layer in view.layers)
    found = irradiance(view)
    assert found.min() >= 0.0
    assert found.max() > 0.1
    assert found.max() <= np.pi * brightest * (1.0 + 1e-5)


@pytest.mark.parametrize("albedo", [0.5, 0.9, 0.99])
def test_radiance_in_a_furnace_rises_with_every_bounce_and_never_too_far(shared_session, albedo):
    """Towards L_e/(1 − ρ), and after n bounces no further than Σ_{k ≤ n} ρᵏ L_e."""
    room = of((builders.box("furnace"), glowing(emission=1.0, albedo=albedo)))
    camera = looking((0.1, -0.2, 0.05), (0.0, 1.0, 0.0))
    pictures = [
        radiance(shared_session, room, camera, replace(ONCE, bounces=bounces, radius=4.0), samples=1, size=32)
        for bounces in (1, 2, 4, None)
    ]
    for less, more in pairwise(pictures):
        assert (more >= less * (1.0 - 1e-5)).all()
        assert more.mean() > less.mean()
    for bounces, found in zip((1, 2, 4), pictures, strict=False):
        assert found.max() <= sum(albedo**k for k in range(bounces + 1)) * (1.0 + 1e-5)
    assert pictures[-1].max() <= 1.0 / (1.0 - albedo)


@pytest.mark.parametrize(
    ("albedo", "count"), [(0.0, 1), (0.005, 1), (0.5, 7), (0.9, MOST_BOUNCES), (2.0, MOST_BOUNCES)]
)
def test_light_without_a_limit_bounces_until_nothing_is_left_to_see(albedo, count):
    scene = builders.scene(materials=(builders.material(base_color=(albedo, 0.0, 0.0)),))
    assert bounce_count(None, scene) == count
    assert bounce_count(3, scene) == 3


def test_noise_is_reported_with_what_is_found(session):
    """As if taps were independent of each other: spread out as they are, they are better than that."""
    ratio = reference.reported_over_found_variance(
        session, lambda seed: picture(session, cornell(LAMP), CORNELL_CAMERA, size=48, seed=seed)
    )
    assert 0.8 < ratio < 3.0


def test_light_is_exactly_in_proportion_to_the_lamps(shared_session):
    dim, bright = (
        picture(shared_session, cornell(replace(LAMP, emission=(power, 2.0 * power, power))), CORNELL_CAMERA, ONCE)
        for power in (2.0**-8, 2.0**20)
    )
    one, other = (view.channels[Channel.DIFFUSE_INDIRECT][..., :3] for view in (dim, bright))
    assert one.any()
    np.testing.assert_array_equal(other, one * np.float32(2.0**28))


def test_black_surfaces_reflect_nothing_further(shared_session):
    black = builders.material(base_color=(0.0, 0.0, 0.0))
    panel = rectangle("panel", (0, 0.4, 0.4), (0.4, 0, 0), (0, 0, 0.4))
    scene = of((builders.quad("floor", half=5.0), black), (panel, glowing()))
    view = picture(shared_session, scene, looking((0.0, -6.0, 4.0), (0.0, 0.0, 0.4), 0.25))
    assert "radiosity" not in [name for name, _ in view.statistics.passes]
    grey = of((builders.quad("floor", half=5.0), builders.material()), (panel, glowing()))
    camera = looking((0.0, -6.0, 4.0), (0.0, 0.0, 0.4), 0.25)
    once, often = (
        irradiance(picture(shared_session, grey, camera, replace(ONCE, bounces=count)))[:30] for count in (1, 4)
    )
    # The panel reflects nothing of what the floor sends, so the floor gets no more than the panel's own light.
    assert once.any()
    np.testing.assert_allclose(often, once, rtol=1e-5, atol=1e-7)


def test_where_nothing_is_nothing_is_found(shared_session):
    empty = builders.scene(lights=LAMPS)
    view = picture(shared_session, empty, builders.camera())
    assert "radiosity" not in [name for name, _ in view.statistics.passes]
    small = builders.scene(builders.quad("q", half=0.2), lights=LAMPS)
    view = picture(shared_session, small, builders.camera())
    assert not view.channels[Channel.DIFFUSE_INDIRECT].any()
    unlit = builders.scene(builders.quad("q"))
    assert not picture(shared_session, unlit, builders.camera()).channels[Channel.COMBINED][..., :3].any()


def test_an_orthographic_camera_sees_what_a_distant_one_does(shared_session):
    scene = replace(random_scene(np.random.default_rng(8)), lights=LAMPS)
    distance = 3000.0
    parallel = builders.camera(z=distance, half_width=3.0, clip_end=2.0 * distance, orthographic=True)
    distant = builders.camera(z=distance, half_width=3.0 / distance, clip_end=2.0 * distance)
    one, other = (
        irradiance(picture(shared_session, scene, camera, samples=4, minimum_separation=0.1))
        for camera in (parallel, distant)
    )
    assert np.abs(one - other).mean() < 0.02 * one.mean()


@pytest.mark.parametrize("factor", [1e-3, 1e5])
def test_a_scene_of_any_size_looks_the_same_with_a_radius_of_its_size(shared_session, factor):
    """A lamp's light falls with the square of the distance. Rounding may move single taps to other pixels."""
    scaling = np.diag([factor, factor, factor, 1.0])
    lamp = replace(LAMP, emission=tuple(np.multiply(LAMP.emission, factor**2)))
    own = radiance(shared_session, cornell(LAMP), CORNELL_CAMERA, ONCE, samples=1, minimum_separation=0.1)
    large, far = placed(cornell(lamp), scaling), seen_from(CORNELL_CAMERA, scaling)
    indirect = replace(ONCE, radius=factor)
    found = radiance(shared_session, large, far, indirect, samples=1, minimum_separation=0.1 * factor)
    assert (np.abs(found - own) > 1e-2 * own.max()).mean() < 0.02
    for bounces in (1, None):
        whole = radiance(shared_session, large, far, replace(ONCE, bounces=bounces), samples=1)  # a radius of 1 m
        assert np.isfinite(whole).all()


@pytest.mark.parametrize("emission", [1e-30, 1e29, 1e39])
def test_light_of_any_strength_stays_finite(shared_session, emission):
    scene = cornell(emission=emission, sampling=EmissionSampling.NONE)
    for paper in (False, True):
        indirect = replace(ONCE, bounces=None, paper_composite=paper)
        found = radiance(shared_session, scene, CORNELL_CAMERA, indirect, samples=2)
        assert np.isfinite(found).all()
        assert (found >= 0.0).all()


def test_the_authors_composite_is_what_they_published(shared_session):
    """Confidence and ambient obscurance on everything; the layers' direct light is read back after that."""
    sky = (0.2, 0.3, 0.4)
    scene = replace(cornell(LAMP), world=builders.scene(world=sky).world)
    paper = replace(ONCE, paper_composite=True)
    view = picture(shared_session, scene, CORNELL_CAMERA, paper, minimum_separation=0.1)
    unlit = picture(
        shared_session, replace(scene, world=builders.scene().world), CORNELL_CAMERA, ONCE, minimum_separation=0.1
    )
    found, layers = expected_senders(unlit, CORNELL_CAMERA)
    mean, sure = reference.obscurance(layers, ONCE.taps, spiral_turns(ONCE.taps), 0.75)
    certain = found.certain & sure & layers.covered
    open_share = 0.95 * np.maximum(0.0, 1.0 - np.sqrt(np.pi * mean)) + 0.05
    confidence = np.clip(2.0 * (np.minimum(found.count / found.taps, 1.0) - 0.35) + 0.35, 0.0, 1.0)[..., None]
    estimate = 2.0 * np.pi * found.radiance / np.maximum(found.count, 1.0)[..., None]
    expected = confidence * estimate + (1.0 + (0.3 - 1.0) * confidence) * np.pi * np.array(sky)
    expected *= open_share[..., None]
    np.testing.assert_allclose(irradiance(view)[certain], expected[certain], rtol=5e-3, atol=1e-3)
    factor = 1.0 + 0.65 * (open_share - 1.0)
    darkened = layers.radiance[0] * factor[..., None]
    np.testing.assert_allclose(view.layers[0].radiance[certain], darkened[certain], rtol=5e-3, atol=1e-4)
