# SPDX-License-Identifier: GPL-3.0-or-later
from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.render.receivers import MOST_TILES, Receivers, visible_receivers
from addon.scene import Camera

TILE = 16

SEEDS = st.integers(0, 2**32 - 1)


def any_camera(generator, *, orthographic, mirrored=False):
    """A camera anywhere, turned at random, with a shifted window; far away as often as near."""
    rotation, _ = np.linalg.qr(generator.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3] = rotation * np.sign(np.linalg.det(rotation))
    pose[:3, 3] = generator.normal(size=3) * 10.0 ** generator.uniform(-2, 4)
    left, bottom = generator.uniform(-2.0, 1.0, 2)
    right, top = np.add((left, bottom), generator.uniform(0.1, 3.0, 2))
    window = (right, left, bottom, top) if mirrored else (left, right, bottom, top)
    return Camera(pose, window, 0.01, 1e5, orthographic)


def picture(generator, layers, width, height, *, empty=0.3):
    """View depths (layers, height, width) of which some are empty."""
    depths = 10.0 ** generator.uniform(-1.5, 3.0, (layers, height, width))
    depths[generator.random(depths.shape) < empty] = inf
    return depths.astype(np.float32)


def tiles_of(depths, size=TILE):
    """What the depth_tiles pass makes of them: (layers, h, w, 2)."""
    layers, height, width = depths.shape
    rows, columns = -(-height // size), -(-width // size)
    tiles = np.empty((layers, rows, columns, 2), np.float32)
    tiles[...] = (inf, -inf)
    for row in range(rows):
        for column in range(columns):
            part = depths[:, row * size : (row + 1) * size, column * size : (column + 1) * size].reshape(layers, -1)
            tiles[:, row, column, 0] = part.min(axis=1)
            tiles[:, row, column, 1] = np.where(np.isinf(part), -inf, part).max(axis=1)
    return tiles


def seen_points(camera, depths, offsets):
    """World-space points (N, 3) that pixels show `offsets` (…, 2) beside their centres, and their view depths (N,)."""
    _, height, width = depths.shape
    _, y, x = np.nonzero(np.isfinite(depths))
    left, right, bottom, top = camera.window
    depth = depths[np.isfinite(depths)].astype(np.float64)
    at = (np.stack([x, y], axis=-1) + 0.5 + offsets) / (width, height)
    window = np.array([left, bottom]) + at * (right - left, top - bottom)
    across = window if camera.orthographic else window * depth[:, None]
    return np.column_stack([across, -depth]) @ camera.rotation.T + camera.position, depth


def held(receivers, camera, points, depth):
    """(N,) whether any tile's eight corners hold each point, in the space of the camera, where they are boxes."""
    corners = (receivers.corners - camera.position) @ camera.rotation
    z = -corners[..., 2]
    across = corners[..., :2] if camera.orthographic else corners[..., :2] / z[..., None]
    view = (points - camera.position) @ camera.rotation
    at = view[:, :2] if camera.orthographic else view[:, :2] / depth[:, None]
    slack = 1e-9 * (1.0 + np.abs(camera.position).max())
    within = ((at[:, None] >= across.min(axis=1) - slack) & (at[:, None] <= across.max(axis=1) + slack)).all(axis=-1)
    return (within & (depth[:, None] >= z.min(axis=1)) & (depth[:, None] <= z.max(axis=1))).any(axis=1)


@given(st.booleans(), st.booleans(), st.integers(1, 3), st.integers(1, 70), st.integers(1, 70), SEEDS)
def test_tiles_hold_whatever_pixels_show(orthographic, mirrored, layers, width, height, seed):
    """Through any place within the margin of a pixel's centre, at a depth that is off by less than that margin's."""
    generator = np.random.default_rng(seed)
    camera = any_camera(generator, orthographic=orthographic, mirrored=mirrored)
    depths = picture(generator, layers, width, height)
    receivers = visible_receivers(tiles_of(depths), TILE, camera, (width, height), 2.0)
    count = int(np.isfinite(depths).sum())
    jittered = depths * generator.uniform(0.9901, 1.0099, depths.shape).astype(np.float32)
    points, depth = seen_points(camera, jittered, generator.uniform(-2.0, 2.0, (count, 2)))
    assert held(receivers, camera, points, depth).all()


@given(st.booleans(), SEEDS)
def test_tiles_hold_no_more_than_their_margin(orthographic, seed):
    """Every corner is within a tile and 2 pixels of something that is seen, and at its depth but for 1 %."""
    generator = np.random.default_rng(seed)
    camera = any_camera(generator, orthographic=orthographic)
    width, height = 48, 40
    depths = picture(generator, 1, width, height, empty=0.98)
    receivers = visible_receivers(tiles_of(depths), TILE, camera, (width, height), 2.0)
    view = (receivers.corners - camera.position) @ camera.rotation
    z = -view[..., 2]
    across = view[..., :2] if orthographic else view[..., :2] / z[..., None]
    left, right, bottom, top = camera.window
    place = (across - (left, bottom)) / (right - left, top - bottom) * (width, height)
    _, y, x = np.nonzero(np.isfinite(depths))
    seen = np.stack([x, y], axis=-1) // TILE * TILE
    for corners, near, far in zip(place, z.min(axis=1), z.max(axis=1), strict=True):
        low, high = corners.min(axis=0), corners.max(axis=0)
        tile = np.rint(low + 2.0)
        np.testing.assert_allclose(low, tile - 2.0, atol=1e-3)
        np.testing.assert_allclose(high, tile + TILE + 2.0, atol=1e-3)
        inside = depths[0][y, x][(seen == tile).all(axis=1)]
        assert near == pytest.approx(0.99 * inside.min(), rel=1e-5)
        assert far == pytest.approx(1.01 * inside.max(), rel=1e-5)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize(("layers", "width", "height"), [(1, 1100, 560), (2, 1504, 400), (8, 400, 400), (1, 16, 20000)])
def test_merged_tiles_hold_the_same(orthographic, layers, width, height):
    generator = np.random.default_rng(1)
    camera = any_camera(generator, orthographic=orthographic)
    depths = np.full((layers, height, width), inf, np.float32)
    shown = generator.integers(0, (layers, height, width), (300, 3))
    depths[tuple(shown.T)] = generator.uniform(1.0, 9.0, 300)
    tiles = tiles_of(depths)
    assert tiles[..., 0].size > MOST_TILES
    receivers = visible_receivers(tiles, TILE, camera, (width, height), 2.0)
    assert 0 < receivers.count <= MOST_TILES
    points, depth = seen_points(camera, depths, 0.0)
    assert held(receivers, camera, points, depth).all()


@given(SEEDS)
def test_balls_hold_their_tiles(seed):
    generator = np.random.default_rng(seed)
    camera = any_camera(generator, orthographic=bool(seed % 2))
    receivers = visible_receivers(tiles_of(picture(generator, 1, 60, 40)), TILE, camera, (60, 40), 2.0)
    centers, radii = receivers.balls
    distances = np.linalg.norm(receivers.corners - centers[:, None], axis=-1)
    assert (distances <= radii[:, None] * (1.0 + 1e-12)).all()


@given(st.lists(st.floats(0.05, 2e3), min_size=1, max_size=4, unique=True), SEEDS)
def test_ranges_of_depth_part_the_receivers_and_lose_nothing(ends, seed):
    generator = np.random.default_rng(seed)
    camera = any_camera(generator, orthographic=False)
    depths = picture(generator, 1, 40, 40)
    receivers = visible_receivers(tiles_of(depths), TILE, camera, (40, 40), 2.0)
    points, depth = seen_points(camera, depths, 0.0)
    found = np.zeros(len(points), np.bool_)
    for start, end in zip([0.0, *sorted(ends)], [*sorted(ends), inf], strict=True):
        part = receivers.between(start, end)
        assert (part.near >= start).all()
        assert (part.far <= end).all()
        assert (part.near <= part.far).all()
        within = (depth >= start) & (depth <= end)
        found |= within & (held(part, camera, points, depth) if part.count else False)
    assert found.all()


def test_a_pixels_width():
    """What it covers: 4 mm a metre away in a window 2 wide with 500 pixels; in an orthographic one 4 mm anywhere."""
    pose = np.eye(4)
    tiles = np.array([[[[10.0, 20.0]]]], np.float32)
    perspective, orthographic = (
        visible_receivers(tiles, 512, Camera(pose, (-1, 1, -0.1, 0.1), 0.1, 100.0, flat), (500, 100), 0.0)
        for flat in (False, True)
    )
    assert perspective.pixels.item() == pytest.approx(0.004 * 9.9)
    assert orthographic.pixels.item() == pytest.approx(0.004)


@pytest.mark.parametrize("orthographic", [False, True])
def test_an_empty_picture_has_no_receivers(orthographic):
    camera = any_camera(np.random.default_rng(0), orthographic=orthographic)
    tiles = tiles_of(np.full((2, 40, 40), inf, np.float32))
    receivers = visible_receivers(tiles, TILE, camera, (40, 40), 2.0)
    assert isinstance(receivers, Receivers)
    assert receivers.count == 0
    assert receivers.corners.shape == (0, 8, 3)
    assert receivers.balls[1].shape == (0,)
    assert receivers.between(0.0, 1.0).count == 0
