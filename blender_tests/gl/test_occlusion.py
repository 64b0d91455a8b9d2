# SPDX-License-Identifier: GPL-3.0-or-later
"""Ambient obscurance and SSAO: the world's light as far as the layers leave it open."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import screen_reference as reference
from random_scenes import random_scene

from addon.render.screen_taps import spiral_turns
from addon.scene import Channel, IndirectMethod, IndirectSettings
from blender_tests import builders
from blender_tests.indirect_scenes import looking, of, placed, rectangle, seen_from, sphere

SKY = np.array([0.25, 0.5, 1.0])
ALBEDO = 0.5
WHITE = builders.material(base_color=(ALBEDO,) * 3)
AO = IndirectSettings(IndirectMethod.OCCLUSION, divisor=1, spatial_filter=False, radius=1.0)
SSAO = replace(AO, method=IndirectMethod.SSAO)
SHARE_OF_MEAN = 3.54021
both_methods = pytest.mark.parametrize("indirect", [AO, SSAO], ids=["ao", "ssao"])


def picture(session, scene, camera, indirect, *, size=64, samples=1, **settings):
    """A view of a scene."""
    return session.show(
        scene,
        camera,
        width=size,
        height=size,
        samples=samples,
        channels={Channel.DIFFUSE_INDIRECT},
        indirect=indirect,
        **settings,
    )


def visibility(session, scene, camera, indirect, **settings):
    """(H, W): share of the world's light that arrives."""
    view = picture(session, scene, camera, indirect, **settings)
    return view.channels[Channel.DIFFUSE_INDIRECT].astype(np.float64) @ (1.0 / SKY / ALBEDO / 3.0)


def under_the_sky(*meshes):
    """A scene of white things."""
    return of(*((mesh, WHITE) for mesh in meshes), world=tuple(SKY))


def floor(key="floor", half=50.0, z=0.0):
    """A square in a plane of constant z."""
    return builders.quad(key, z=z, half=half)


def ball(radius):
    """A finely divided ball on the floor with the normals of a round one."""
    return sphere("ball", radius, (0.0, 0.0, radius), segments=96)


def slanting(angle, half_width, orthographic=True):
    """A camera 10 m from the origin, `angle` (rad) from the Z axis towards −Y."""
    direction = np.array([0.0, -np.sin(angle), np.cos(angle)])
    camera = looking(10.0 * direction, (0.0, 0.0, 0.0), half_width)
    return replace(camera, orthographic=orthographic)


@both_methods
@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("angle", [0.0, 0.7, 1.2])
def test_nothing_is_taken_from_an_open_plane(shared_session, indirect, angle, orthographic):
    camera = slanting(angle, 2.0 if orthographic else 0.2, orthographic)
    for divisor in (1, 2, 4):
        found = visibility(shared_session, under_the_sky(floor()), camera, replace(indirect, divisor=divisor))
        np.testing.assert_allclose(found, 1.0, rtol=1e-5)


@both_methods
def test_nothing_is_taken_from_a_plane_so_far_away_that_it_is_not_where_it_is_drawn(shared_session, indirect):
    """At 1000 km float32 tells depths apart by 6 cm."""
    camera = looking((4e5, -5e5, 8e5), (0.0, 0.0, 0.0), 4.0, clip_end=1e7)
    found = visibility(shared_session, under_the_sky(floor()), replace(camera, orthographic=True), indirect)
    np.testing.assert_allclose(found, 1.0, rtol=1e-5)


@both_methods
@pytest.mark.parametrize("strength", [1e-30, 3e38])
def test_a_world_of_any_strength_stays_finite(shared_session, indirect, strength):
    scene = replace(random_scene(np.random.default_rng(1)), world=builders.scene(world=(strength,) * 3).world)
    view = picture(shared_session, scene, builders.camera(z=6.0, half_width=0.5), indirect, samples=2)
    assert np.isfinite(view.channels[Channel.DIFFUSE_INDIRECT]).all()


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("orthographic", [False, True])
def test_obscurance_is_that_of_the_layers_read_back(shared_session, seed, orthographic):
    """Against float64 where no tap is within rounding of another pixel."""
    camera = builders.camera(z=8.0, half_width=3.0 if orthographic else 0.35, orthographic=orthographic)
    scene = replace(random_scene(np.random.default_rng(seed)), world=builders.scene(world=tuple(SKY)).world)
    view = picture(shared_session, scene, camera, AO, layers=2, minimum_separation=0.1, deep_output=True)
    found = view.channels[Channel.DIFFUSE_INDIRECT].astype(np.float64) @ (1.0 / SKY / ALBEDO / 3.0)
    mean, certain = reference.obscurance(reference.read_back(view, camera), AO.taps, spiral_turns(AO.taps), AO.radius)
    assert certain.mean() > 0.3
    expected = np.maximum(1.0 - SHARE_OF_MEAN * mean, 0.0)
    assert (expected[certain] < 0.7).any()
    np.testing.assert_allclose(found[certain], expected[certain], atol=2e-4)


PIXEL = 3.0 / 64
"""Metres that one covers in the pictures that the integral is compared with; 0.7 m are not subsampled there."""


def quadrature(view, point, radius, depth_of, pixel=PIXEL):
    """Share of light left at a point that faces up, by the integral that the taps sample, in float64.

    `view` (2, 3): unit vectors along the picture's axes; `depth_of`: points (N, 3) moved along the view -> what is
    seen. Taps see the middle of the pixel that they fall on.
    """
    fractions, angles = (np.arange(200) + 0.5) / 200, 2.0 * np.pi * (np.arange(200) + 0.5) / 200
    reach = np.maximum(radius * fractions, 0.75 * pixel)[:, None, None]
    offset = (reach * np.stack([np.cos(angles), np.sin(angles)], axis=-1)).reshape(-1, 2)
    offset = np.round(offset / pixel) * pixel if pixel else offset
    offset = depth_of(point + offset @ view) - point
    squared = (offset**2).sum(axis=-1)
    elevation = np.maximum(offset[:, 2] - 0.023 / 0.75 * radius, 0.0)
    value = elevation / np.sqrt(squared + 1e-3 / 0.75**2 * radius**2) * np.maximum(1.0 - squared / radius**2, 0.0)
    return 1.0 - SHARE_OF_MEAN * value.mean()


@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_a_ball_on_a_plane_takes_what_the_integral_says(shared_session, angle):
    """In every sample the spiral begins elsewhere, so that taps fill the disc."""
    radius = 0.35
    camera = slanting(angle, 32 * PIXEL)
    scene = under_the_sky(floor(), ball(radius))
    found = visibility(shared_session, scene, camera, replace(AO, radius=2.0 * radius), samples=96, layers=1)
    rotation, forward = camera.rotation, -camera.rotation[:, 2]

    def seen(points):
        on_plane = points - points[:, 2:] / forward[2] * forward
        offset = on_plane - (0.0, 0.0, radius)
        along = offset @ forward
        inside = along**2 - (offset**2).sum(axis=-1) + radius**2
        on_ball = on_plane + (-along - np.sqrt(np.maximum(inside, 0.0)))[:, None] * forward
        return np.where((inside > 0.0)[:, None], on_ball, on_plane)

    compared = 0
    for row, column in product(range(21, 44, 7), repeat=2):
        place = camera.position + PIXEL * (rotation[:, :2] @ (column - 31.5, row - 31.5))
        point = seen(place[None])[0]
        if point[2] < 1e-6:
            expected = quadrature(rotation[:, :2].T, point, 2.0 * radius, seen)
            compared += expected < 0.97
            assert found[row, column] == pytest.approx(expected, abs=0.02)
    assert compared >= 6


def test_an_endless_corner_keeps_half_of_the_light(shared_session):
    """Seen along its bisector; by the integral at the corner itself, and near it by the taps."""
    walls = (
        rectangle("floor", (0, 0, 0), (20, 0, 0), (0, 20, 0)),
        rectangle("wall", (0, 0, 0), (0, 0, 20), (20, 0, 0)),
    )
    camera = slanting(np.pi / 4, 32 * PIXEL)
    rotation, forward = camera.rotation, -camera.rotation[:, 2]

    def seen(points):
        distance = np.minimum(-points[:, 2] / forward[2], -points[:, 1] / forward[1])
        return points + distance[:, None] * forward

    def left_at(pixels, pixel=PIXEL):
        point = seen(camera.position[None] - rotation[:, 1] * PIXEL * pixels)[0]
        return quadrature(rotation[:, :2].T, point, 0.7, seen, pixel)

    found = visibility(shared_session, under_the_sky(*walls), camera, replace(AO, radius=0.7), samples=96, layers=1)
    assert left_at(0.0, pixel=0.0) == pytest.approx(0.5, abs=2e-3)
    for row in (31, 29, 25):
        assert found[row, 16:48].mean() == pytest.approx(left_at(31.5 - row), abs=0.01)


def pit(height, half=0.4):
    """The floor and what surrounds a square of it at a height, m."""
    rims = ((half + 2.0, 0.0), (-half - 2.0, 0.0), (0.0, half + 2.0), (0.0, -half - 2.0))
    return floor(), *(builders.quad(f"rim {rim}", z=height, half=2.0, center=rim) for rim in rims)


MIDDLE = np.s_[28:36, 28:36]
ABOVE = builders.camera(z=10.0, half_width=1.0, orthographic=True)


@both_methods
def test_what_the_second_layer_hides_takes_light_as_well(shared_session, indirect):
    """Cards 3 m above the floor hide the rims of a pit."""
    cards = [replace(mesh, key=f"card {mesh.key}") for mesh in pit(3.0)[1:]]
    scene = under_the_sky(*pit(0.5), *cards)
    one, two, open_pit = (
        visibility(shared_session, view, ABOVE, indirect, layers=layers, minimum_separation=0.4)
        for view, layers in ((scene, 1), (scene, 2), (under_the_sky(*pit(0.5)), 1))
    )
    np.testing.assert_allclose(one[MIDDLE], 1.0, rtol=1e-5)
    assert two[MIDDLE].max() < 0.9
    np.testing.assert_array_equal(two[MIDDLE], open_pit[MIDDLE])


@both_methods
def test_what_is_farther_than_the_radius_takes_nothing(shared_session, indirect):
    scene = under_the_sky(*pit(1.1))
    far, near = (
        visibility(shared_session, scene, ABOVE, replace(indirect, radius=radius), layers=1) for radius in (1.0, 1.5)
    )
    np.testing.assert_allclose(far[MIDDLE], 1.0, rtol=1e-5)
    assert near[MIDDLE].max() < 0.9


def test_ssao_takes_light_only_where_more_than_half_is_in_front(shared_session):
    """At a step up by less than the radius at most half of the disc is; at the foot of a square pit more is."""
    step = under_the_sky(floor(), builders.quad("step", z=0.3, half=2.0, center=(2.0, 0.0)))
    camera = builders.camera(z=10.0, half_width=2.0, orthographic=True)
    indirect = replace(SSAO, taps=64)
    found = visibility(shared_session, step, camera, indirect, samples=16)
    assert (found > 0.93).all()  # half but for the noise of 32 pairs
    pit_view = visibility(shared_session, under_the_sky(*pit(0.3, 0.2)), camera, indirect, samples=16)
    middle, rim = pit_view[30:34, 30:34].mean(), pit_view[30:34, 60].mean()
    # Of a disc of 1 m about the middle of a square of 0.4 m, all but 0.16/π is in front.
    assert middle == pytest.approx(2.0 * 0.16 / np.pi, abs=0.04)
    assert rim > 0.93


@both_methods
@pytest.mark.parametrize("seed", [4, 5])
def test_no_more_light_arrives_than_the_world_sends_and_none_is_negative(shared_session, indirect, seed):
    scene = replace(random_scene(np.random.default_rng(seed)), world=builders.scene(world=tuple(SKY)).world)
    camera = builders.camera(z=6.0, half_width=0.5)
    for layers in (1, 3):
        found = visibility(shared_session, scene, camera, indirect, layers=layers, minimum_separation=0.1)
        assert found.min() >= 0.0
        assert found.max() <= 1.0 + 1e-5
        assert found.min() < 0.5


@both_methods
def test_noise_is_reported_with_what_is_found(session, indirect):
    """As if taps were independent of each other: spread out as they are, they are better than that."""
    scene = replace(random_scene(np.random.default_rng(1)), world=builders.scene(world=tuple(SKY)).world)
    camera = builders.camera(z=6.0, half_width=0.5)
    ratio = reference.reported_over_found_variance(
        session, lambda seed: picture(session, scene, camera, indirect, size=48, seed=seed, minimum_separation=0.1)
    )
    assert 1.0 < ratio < 5.0


@both_methods
def test_light_is_exactly_in_proportion_to_the_world(shared_session, indirect):
    scene = random_scene(np.random.default_rng(6))
    camera = builders.camera(z=6.0, half_width=0.5)
    dim, bright = (
        picture(shared_session, replace(scene, world=builders.scene(world=(power,) * 3).world), camera, indirect)
        for power in (2.0**-10, 2.0**20)
    )
    one, other = (view.channels[Channel.DIFFUSE_INDIRECT] for view in (dim, bright))
    assert one.any()
    np.testing.assert_array_equal(other, one * np.float32(2.0**30))


@both_methods
@pytest.mark.parametrize("factor", [1e-3, 1e5])
def test_a_scene_of_any_size_looks_the_same_with_a_radius_of_its_size(shared_session, indirect, factor):
    """Rounding may move single taps to other pixels."""
    scene = replace(random_scene(np.random.default_rng(7)), world=builders.scene(world=tuple(SKY)).world)
    camera = replace(builders.camera(z=6.0, half_width=0.5), clip_end=100.0)
    scaling = np.diag([factor, factor, factor, 1.0])
    large, far = placed(scene, scaling), seen_from(camera, scaling)
    own = visibility(shared_session, scene, camera, indirect, minimum_separation=0.1)
    found = visibility(shared_session, large, far, replace(indirect, radius=factor), minimum_separation=0.1 * factor)
    assert (np.abs(found - own) > 1e-3).mean() < 0.01
    whole = visibility(shared_session, large, far, indirect)  # a radius of 1 m
    assert np.isfinite(whole).all()
    assert whole.max() <= 1.0 + 1e-5


@both_methods
def test_an_orthographic_camera_sees_what_a_distant_one_does(shared_session, indirect):
    scene = replace(random_scene(np.random.default_rng(8)), world=builders.scene(world=tuple(SKY)).world)
    distance = 3000.0
    parallel = builders.camera(z=distance, half_width=3.0, clip_end=2.0 * distance, orthographic=True)
    distant = builders.camera(z=distance, half_width=3.0 / distance, clip_end=2.0 * distance)
    one, other = (
        visibility(shared_session, scene, camera, indirect, samples=4, minimum_separation=0.1)
        for camera in (parallel, distant)
    )
    assert np.abs(one - other).mean() < 0.004
    assert (np.abs(one - other) > 0.1).mean() < 0.01


@both_methods
def test_what_is_beyond_the_edge_counts_where_there_is_a_guard_band(shared_session, indirect):
    """Within the radius of the edge only."""
    wall = builders.mesh(
        "wall",
        [(1.05, -9, 0), (1.05, 9, 0), (1.05, 9, 0.3), (1.05, -9, 0.3), (3, -9, 0.3), (3, 9, 0.3)],
        [(0, 1, 2), (0, 2, 3), (3, 2, 5), (3, 5, 4)],
        normals=np.zeros((6, 3)),
    )
    card = builders.quad("card", z=0.2, half=0.2)
    scene = under_the_sky(floor(), wall, card)
    small = replace(indirect, radius=0.5)
    without, guarded = (visibility(shared_session, scene, ABOVE, small, guard_band=band) for band in (0, 24))
    np.testing.assert_allclose(without[16:48, 16:47], guarded[16:48, 16:47], rtol=1e-5)
    np.testing.assert_allclose(without[:, 60:], 1.0, rtol=1e-5)
    assert indirect is SSAO or (guarded[16:48, 16:47] < 0.9).any()
    assert indirect is SSAO or guarded[:, 60:].mean() < 0.98


@both_methods
def test_nothing_is_seen_of_a_black_surface_or_where_there_is_none(shared_session, indirect):
    black = of((builders.quad("q", half=0.5), builders.material(base_color=(0.0, 0.0, 0.0))), world=tuple(SKY))
    view = picture(shared_session, black, builders.camera(), indirect)
    assert "occlusion" not in [name for name, _ in view.statistics.passes]
    assert not view.channels[Channel.DIFFUSE_INDIRECT].any()
    empty = picture(shared_session, builders.scene(world=tuple(SKY)), builders.camera(), indirect)
    np.testing.assert_allclose(empty.channels[Channel.COMBINED][..., :3], np.broadcast_to(SKY, (64, 64, 3)))


def test_a_tap_looks_at_the_pixel_that_a_pyramid_on_a_rotated_grid_keeps():
    """Each level made from the finer one, texel by texel, as a pyramid in memory would be."""
    size = 256
    level = np.stack(np.meshgrid(np.arange(size), np.arange(size)), axis=-1)
    generator = np.random.default_rng(9)
    pixels = generator.integers(0, size, (500, 2))
    for coarser in range(6):
        if coarser:
            y, x = np.mgrid[: len(level) // 2, : len(level) // 2]
            level = level[2 * y + ((x & 1) ^ 1), 2 * x + ((y & 1) ^ 1)]
        kept = level[pixels[:, 1] >> coarser, pixels[:, 0] >> coarser]
        np.testing.assert_array_equal(reference.subsampled(pixels, coarser, (size, size)), kept)


@pytest.mark.parametrize(("taps", "turns"), [(13, 5), (16, 7), (19, 7), (32, 7)])
def test_spirals_turn_as_often_as_published(taps, turns):
    assert spiral_turns(taps) == turns


@pytest.mark.parametrize("taps", [1, 19, 99, 100, 1000])
def test_any_number_of_taps_covers_all_directions(taps):
    """No sector of 1/8 is without a tap where there are enough, and a whole number of turns is never one tap's."""
    turns = spiral_turns(taps) * (np.arange(taps) + 0.5) / taps % 1.0
    assert taps < 19 or set((8 * turns).astype(int)) == set(range(8))
