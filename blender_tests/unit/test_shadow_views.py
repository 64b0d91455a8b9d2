# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import replace
from itertools import pairwise
from math import inf, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_receivers import SEEDS, TILE, any_camera, picture, seen_points, tiles_of

from addon.render.receivers import visible_receivers
from addon.render.shadow_views import (
    MOST_CASCADES,
    SMALLEST_SIZE,
    WIDEST_SINGLE,
    Cone,
    Fineness,
    LocalReceivers,
    cone_map,
    cube_maps,
    look_along,
    sun_maps,
)
from blender_tests import builders

EVERYWHERE = Cone(np.array([0.0, 0.0, 1.0]), pi)
NO_CASTERS = np.zeros((0, 2, 3))
LARGEST = 512


def unit(generator):
    """A random direction (3,)."""
    direction = generator.normal(size=3)
    return direction / np.linalg.norm(direction)


def receivers_of(camera, depths):
    """What a picture (layers, height, width) of view depths shows."""
    _, height, width = depths.shape
    return visible_receivers(tiles_of(depths), TILE, camera, (width, height), 2.0)


def in_map(shadow_map, points):
    """(N, 2) place on the map, 0…1 from edge to edge, and (N,) depth in m, of points (N, 3)."""
    camera = shadow_map.camera
    view = (points - camera.position) @ camera.rotation
    depth = -view[:, 2]
    left, right, bottom, top = camera.window
    across = view[:, :2] if camera.orthographic else view[:, :2] / depth[:, None]
    return (across - (left, bottom)) / (right - left, top - bottom), depth


@given(SEEDS)
def test_a_frame_looks_along_its_direction(seed):
    direction = unit(np.random.default_rng(seed))
    frame = look_along(direction)
    np.testing.assert_allclose(frame[:, 2], -direction, atol=1e-12)
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_frames_along_the_axes_are_exact(axis, sign):
    """So that the faces of a cube meet without gaps."""
    direction = sign * np.eye(3)[axis]
    frame = look_along(direction)
    assert set(np.unique(np.abs(frame))) == {0.0, 1.0}
    np.testing.assert_array_equal(frame[:, 2], -direction)


@given(st.booleans(), st.integers(1, MOST_CASCADES), st.sampled_from([16, 32, LARGEST]), SEEDS)
def test_the_suns_maps_have_all_that_is_seen_and_all_that_is_before_it(orthographic, cascades, largest, seed):
    """A point of a box towards the light is neither cut off nor behind the camera of a map whose column it is in."""
    generator = np.random.default_rng(seed)
    camera = any_camera(generator, orthographic=orthographic)
    depths = picture(generator, 1, 40, 40)
    if not np.isfinite(depths).any():
        return
    points, _ = seen_points(camera, depths, generator.uniform(-2.0, 2.0, (int(np.isfinite(depths).sum()), 2)))
    low = points[generator.integers(len(points), size=5)] + generator.normal(size=(5, 3)) * 10.0
    casters = np.stack([low, low + generator.uniform(0.0, 100.0, (5, 3))], axis=1)
    maps = sun_maps(unit(generator), receivers_of(camera, depths), casters, Fineness(largest), cascades)
    assert 1 <= len(maps) <= cascades
    seen = np.zeros(len(points), np.bool_)
    within = low + generator.random((5, 3)) * (casters[:, 1] - low)
    for item in maps:
        assert item.camera.orthographic
        place, depth = in_map(item, points)
        margin = 1.0 / item.size
        on_map = ((place >= margin) & (place <= 1.0 - margin)).all(axis=1)
        seen |= on_map & (depth > 0.0) & (depth < item.camera.clip_end)
        assert (in_map(item, within)[1] > 0.0).all(), "a caster is before the map's near plane"
    assert seen.all()


def test_a_picture_from_near_to_far_has_cascades_from_fine_to_coarse():
    camera = replace(builders.camera(z=0.0), clip_end=1e5)
    depths = np.geomspace(0.5, 5e3, 64 * 64).reshape(1, 64, 64).astype(np.float32)
    receivers = receivers_of(camera, depths)
    maps = sun_maps(np.array([0.6, 0.0, -0.8]), receivers, NO_CASTERS, Fineness(LARGEST), MOST_CASCADES)
    widths = [item.camera.window[1] - item.camera.window[0] for item in maps]
    assert len(maps) == MOST_CASCADES
    assert widths == sorted(widths)
    assert widths[0] < 1e-2 * widths[-1]


def test_a_single_map_serves_what_it_is_fine_enough_for():
    receivers = receivers_of(builders.camera(z=0.0), np.full((1, 64, 64), 5.0, np.float32))
    assert len(sun_maps(np.array([0.0, 0.0, -1.0]), receivers, NO_CASTERS, Fineness(LARGEST), MOST_CASCADES)) == 1


def test_texels_are_no_smaller_than_a_lights_limit():
    receivers = receivers_of(builders.camera(z=0.0), np.full((1, 64, 64), 5.0, np.float32))
    for limit in (0.05, 0.5):
        (sun,) = sun_maps(np.array([0.0, 0.0, -1.0]), receivers, NO_CASTERS, Fineness(LARGEST, 1.0, limit), 1)
        width = sun.camera.window[1] - sun.camera.window[0]
        assert limit / 2 < width / sun.size <= limit or sun.size == SMALLEST_SIZE
        center = np.array([0.0, 0.0, -1.0])
        local = LocalReceivers(receivers, center, 0.0, EVERYWHERE, inf)
        spot = cone_map(center, Cone(np.array([0.0, 0.0, -1.0]), 0.5), local, Fineness(LARGEST, 1e3, limit))
        width = spot.camera.window[1] - spot.camera.window[0]
        assert limit / 2.2 < width / spot.size <= limit * 1.1 or spot.size == SMALLEST_SIZE


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("count", [1.0, 4.0])
def test_texels_are_as_fine_as_the_pixels_they_are_seen_in(orthographic, count):
    """A spot where the camera is: as many texels per pixel as asked for, up to twice that by powers of two."""
    camera = builders.camera(z=0.0, half_width=0.2, orthographic=orthographic)
    depths = np.full((1, 64, 64), 5.0, np.float32)
    receivers = receivers_of(camera, depths)
    cone = Cone(np.array([0.0, 0.0, -1.0]), 0.3)
    local = LocalReceivers(receivers, np.zeros(3), 0.0, cone, inf)
    item = cone_map(np.zeros(3), cone, local, Fineness(4096, count))
    texel = (item.camera.window[1] - item.camera.window[0]) / item.size
    pixel = 0.4 / 64 / (5.0 if orthographic else 1.0)
    assert 0.4 * pixel / count < texel < 1.2 * pixel / count


@given(st.booleans(), SEEDS)
def test_faces_show_what_they_are_asked_for_from_any_point_of_a_light(orthographic, seed):
    """Whichever face's quarter a receiver is in as seen from a point of the light has it, at less than its end."""
    generator = np.random.default_rng(seed)
    camera = any_camera(generator, orthographic=orthographic)
    depths = picture(generator, 1, 40, 40)
    if not np.isfinite(depths).any():
        return
    points, _ = seen_points(camera, depths, 0.0)
    center = points[0] + generator.normal(size=3) * 10.0 ** generator.uniform(-2.0, 2.0)
    extent = 10.0 ** generator.uniform(-3.0, 1.0)
    local = LocalReceivers(receivers_of(camera, depths), center, extent, EVERYWHERE, inf)
    point = center + extent * generator.random() * unit(generator)
    maps = cube_maps(point, local, Fineness(LARGEST))
    away = points - point
    axis = np.abs(away).argmax(axis=1)
    faces = 2 * axis + (away[np.arange(len(points)), axis] < 0.0)
    for index, item in enumerate(maps):
        own = points[faces == index]
        if item is None:
            assert len(own) == 0
        elif len(own):
            place, depth = in_map(item, own)
            assert ((place >= -1e-9) & (place <= 1.0 + 1e-9)).all()
            assert (depth <= item.camera.clip_end).all()


def views_along(path):
    """The maps of a sun, a spot and a bulb for each of some cameras that see a floor and a wall."""
    sun, spot = unit(np.random.default_rng(4)), Cone(np.array([0.0, 0.0, -1.0]), 0.6)
    depths = np.tile(np.linspace(4.0, 6.0, 64, dtype=np.float32), (64, 1))[None]
    for camera in path:
        receivers = receivers_of(camera, depths)
        near = np.array([0.3, 0.2, 1.5])
        yield (
            sun_maps(sun, receivers, np.array([[(-9.0, -9.0, -1.0), (9.0, 9.0, 4.0)]]), Fineness(LARGEST), 4)[0],
            cone_map(near, spot, LocalReceivers(receivers, near, 0.1, spot, inf), Fineness(LARGEST)),
            *cube_maps(near, LocalReceivers(receivers, near, 0.1, EVERYWHERE, inf), Fineness(LARGEST)),
        )


def identities(maps):
    """What tells maps apart."""
    return [
        item and (item.size, item.camera.window, item.camera.clip_end, item.camera.world_from_camera.tobytes())
        for item in maps
    ]


def test_maps_stay_the_same_while_the_camera_moves_a_little():
    """Places snap: over 40 steps of 1 mm, seen from 5 m, at most the few that pass a step of the grid are new."""
    path = [replace(builders.camera(), world_from_camera=builders.translation(x=0.001 * k, z=5.0)) for k in range(40)]
    views = [identities(maps) for maps in views_along(path)]
    changes = sum(before != after for one, other in pairwise(views) for before, after in zip(one, other, strict=True))
    assert changes <= 4


def test_maps_of_the_same_view_are_the_same():
    camera = builders.camera(z=5.0)
    one, other = views_along([camera, replace(camera)])
    assert identities(one) == identities(other)


@pytest.mark.parametrize("half_angle", [0.0, 1e-5, 0.5, WIDEST_SINGLE])
def test_a_cone_is_within_its_map_whatever_its_width(half_angle):
    receivers = receivers_of(builders.camera(z=0.0), np.full((1, 40, 40), 5.0, np.float32))
    cone = Cone(np.array([0.0, 0.0, -1.0]), half_angle)
    local = LocalReceivers(receivers, np.zeros(3), 0.0, cone, inf)
    item = cone_map(np.zeros(3), cone, local, Fineness(LARGEST))
    left, right, bottom, top = item.camera.window
    half = np.tan(half_angle)
    assert (left < -half, right > half, bottom < -half, top > half) == (True,) * 4
    assert right - left < 2.2 * max(half, 2e-3)


@given(SEEDS, st.floats(0.1, 100.0))
def test_whatever_is_within_reach_is_kept(seed, reach):
    generator = np.random.default_rng(seed)
    camera = any_camera(generator, orthographic=bool(seed % 2))
    depths = picture(generator, 1, 40, 40, empty=0.95)
    points, _ = seen_points(camera, depths, 0.0)
    if len(points) == 0:
        return
    center = points[0] + generator.normal(size=3)
    local = LocalReceivers(receivers_of(camera, depths), center, 0.5, EVERYWHERE, reach)
    distance = np.linalg.norm(points - center, axis=1)
    reached = distance < reach
    assert local.any or not reached.any()
    if local.any:
        assert local.farthest >= (distance[reached].max(initial=0.0))
        assert local.farthest <= reach + 0.5


@pytest.mark.parametrize("offset", [0.0, 1e-30, 1e6])
def test_a_light_on_what_is_seen_or_far_from_it_has_finite_maps(offset):
    receivers = receivers_of(builders.camera(z=0.0), np.full((1, 40, 40), 5.0, np.float32))
    center = receivers.corners[0, 0] + offset
    local = LocalReceivers(receivers, center, 0.0, EVERYWHERE, inf)
    for item in cube_maps(center, local, Fineness(LARGEST)):
        if item is not None:
            assert np.isfinite([*item.camera.window, item.camera.clip_end]).all()
            assert 0.0 < item.camera.clip_start < item.camera.clip_end
    (sun,) = sun_maps(unit(np.random.default_rng(0)), receivers, NO_CASTERS, Fineness(64), 1)
    assert np.isfinite([*sun.camera.window, sun.camera.clip_end]).all()


@given(st.booleans(), SEEDS)
def test_a_face_is_asked_for_nothing_that_is_wholly_beside_it(orthographic, seed):
    """What it may see are the tiles whose corners are not all beyond one of its sides, with room for the extent."""
    generator = np.random.default_rng(seed)
    camera = any_camera(generator, orthographic=orthographic)
    receivers = receivers_of(camera, picture(generator, 1, 60, 60, empty=0.9))
    if receivers.count == 0:
        return
    center = receivers.corners[0, 0] + generator.normal(size=3) * 10.0 ** generator.uniform(-2.0, 2.0)
    extent = 10.0 ** generator.uniform(-3.0, 1.0)
    corners = receivers.corners - center
    faces = LocalReceivers(receivers, center, extent, EVERYWHERE, inf).faces()
    for face, seen in enumerate(faces):
        axis, sign = face // 2, 1.0 - 2.0 * (face % 2)
        ahead = sign * corners[..., axis] + 2.0 * extent
        sides = np.delete(corners, axis, axis=-1)
        beside = [(ahead < way * sides[..., other]).all(axis=1) for other in range(2) for way in (1.0, -1.0)]
        expected = ~np.logical_or.reduce(beside) & (ahead > 0.0).any(axis=1)
        np.testing.assert_array_equal(seen, np.flatnonzero(expected))


@pytest.mark.parametrize("nearest", [0.0, 0.3, 50.0])
def test_maps_begin_where_the_light_says(nearest):
    receivers = receivers_of(builders.camera(z=0.0), np.full((1, 40, 40), 5.0, np.float32))
    local = LocalReceivers(receivers, np.zeros(3), 0.1, EVERYWHERE, inf, nearest)
    for item in cube_maps(np.zeros(3), local, Fineness(LARGEST)):
        if item is not None:
            assert 0.0 < item.camera.clip_start < item.camera.clip_end
            assert item.camera.clip_start >= nearest
            assert item.camera.clip_end >= local.farthest
