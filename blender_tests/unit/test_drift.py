# SPDX-License-Identifier: GPL-3.0-or-later
"""The bound on how far anything moves on screen."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from addon.scene import Camera, Moment
from addon.scene.drift import LARGEST_DRIFT, pixel_drift
from addon.scene.versions import new_version
from blender_tests import builders

WIDTH, HEIGHT = 64, 48
SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.floats(-7.0, 0.0).map(lambda exponent: 10.0**exponent)
FLAGS = st.booleans()


def turn(axis, angle):
    """(3, 3) rotation by Rodrigues' formula."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([(0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def pose(rotation, position):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, position
    return matrix


def random_moments(
    seed, size, orthographic, mirrored, *, camera=True, objects=True, vertices=True, window=True, spread=1.0
):
    """Two frames that differ by motions of about `size`, of what is asked for; four instances before the camera.

    Their middles are seen where `spread` is 0.15 or less.
    """
    rng = np.random.default_rng(seed)

    def small(*shape):
        return size * rng.uniform(-1.0, 1.0, shape)

    origin = rng.uniform(-1.0, 1.0, 3) * 10.0 ** rng.uniform(0.0, 5.0)
    look = turn(rng.normal(size=3), rng.uniform(0.0, 3.0))
    left, right, bottom, top = -rng.uniform(0.2, 1.0), rng.uniform(0.2, 1.0), -rng.uniform(0.2, 1.0), 0.5
    if orthographic:
        left, right, bottom, top = (5.0 * side for side in (left, right, bottom, top))
    if mirrored:
        left, right = right, left
    edges = np.array([left, right, bottom, top])
    first_camera = Camera(pose(look, origin), tuple(edges.tolist()), 0.1, 1000.0, orthographic)
    second_camera = first_camera
    if camera:
        turned = pose(look @ turn(rng.normal(size=3), small()), origin + small(3))
        second_camera = replace(second_camera, world_from_camera=turned)
    if window:
        second_camera = replace(second_camera, window=tuple((edges + small(4)).tolist()))
    positions = rng.uniform(-1.0, 1.0, (40, 3)).astype(np.float32)
    bent = positions + small(40, 3).astype(np.float32) if vertices else positions
    meshes = [replace(builders.mesh("m", corners, [(0, 1, 2)]), version=new_version()) for corners in (positions, bent)]
    before, now = [], []
    for _ in range(4):
        depth = rng.uniform(0.3, 30.0)
        across = spread * (5.0 if orthographic else depth) * rng.uniform(-1.0, 1.0, 2)
        place = origin + look @ np.array([*across, -depth])
        linear = turn(rng.normal(size=3), 1.0) * 10.0 ** rng.uniform(-2.0, 1.0)
        before.append(pose(linear, place))
        now.append(pose(turn(rng.normal(size=3), small()) @ linear, place + small(3)) if objects else before[-1])
    batches = [replace(builders.batch("m", np.array(rows)), version=new_version()) for rows in (before, now)]
    return tuple(
        Moment(builders.scene(mesh, batches=(batch,)), camera)
        for mesh, batch, camera in zip(meshes, batches, (first_camera, second_camera), strict=True)
    )


def project(camera, points, size):
    """Pixels (…, 2) and view depths (…) of world points (…, 3), written down apart from the code under test."""
    local = (points - camera.position) @ camera.rotation
    depth = -local[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        plane = local[..., :2] / (1.0 if camera.orthographic else depth[..., None])
    left, right, bottom, top = camera.window
    fractions = (plane - (left, bottom)) / (right - left, top - bottom)
    return fractions * size, depth


def world_points(moment, rng_seed=0, count=500):
    """(4, count, 3) points inside the triangles between the mesh's vertices; the same ones in every frame."""
    rng = np.random.default_rng(rng_seed)
    (mesh,) = moment.scene.meshes.values()
    (batch,) = moment.scene.batches
    corners = rng.integers(0, len(mesh.positions), (count, 3))
    weights = rng.dirichlet((0.5, 0.5, 0.5), count)
    local = np.einsum("nc,nck->nk", weights, mesh.positions[corners].astype(np.float64))
    return local @ batch.matrices[:, :3, :3].transpose(0, 2, 1) + batch.matrices[:, None, :3, 3]


def true_drift(first, second, size):
    """The largest motion, in pixels, of sampled points that the second frame shows in a picture of that size."""
    before, depth_before = project(first.camera, world_points(first), size)
    now, depth = project(second.camera, world_points(second), size)
    seen = (depth > second.camera.clip_start) & ((now >= 0) & (now <= size)).all(axis=-1)
    motion = np.linalg.norm(now - before, axis=-1)
    if not second.camera.orthographic:
        motion = np.where(depth_before > 0.0, motion, np.inf)  # it came through the camera's plane
    return float(np.where(seen, motion, 0.0).max())


@given(SEEDS, SIZES, st.sampled_from([(1, 1), (WIDTH, HEIGHT)]), FLAGS, FLAGS, FLAGS, FLAGS, FLAGS, FLAGS)
def test_nothing_that_is_seen_moves_farther(
    seed, size, picture, orthographic, mirrored, camera, objects, vertices, window
):
    """In a picture of one pixel things may move by as much as the whole view before the bound says nothing more."""
    parts = {"camera": camera, "objects": objects, "vertices": vertices, "window": window}
    first, second = random_moments(seed, size, orthographic, mirrored, **parts)
    bound = pixel_drift(first, second, *picture)
    # Roundings of coordinates up to 1e5 m, seen from 0.1 m: 1e5 * 2**-52 / 0.1 * 320 pixels.
    assert min(true_drift(first, second, picture), LARGEST_DRIFT) <= bound * (1.0 + 1e-6) + 1e-7
    assert 0.0 <= bound <= LARGEST_DRIFT


@given(SEEDS, FLAGS, FLAGS, FLAGS, FLAGS, FLAGS)
def test_it_vanishes_with_the_motion(seed, orthographic, mirrored, camera, objects, vertices):
    """A tenth of a small motion has a tenth of the bound, to within the curvature of the path."""
    parts = {"camera": camera, "objects": objects, "vertices": vertices, "window": not (camera or objects or vertices)}
    sizes = (1e-4, 1e-5, 1e-6)
    bounds = [
        pixel_drift(*random_moments(seed, size, orthographic, mirrored, **parts), WIDTH, HEIGHT) for size in sizes
    ]
    assume(0.0 < bounds[0] < LARGEST_DRIFT)
    # Positions are stored in float32: steps of 1e-6 are off by up to 2**-24, 6 %.
    assert bounds[1] == pytest.approx(0.1 * bounds[0], rel=0.15)
    assert bounds[2] == pytest.approx(0.1 * bounds[1], rel=0.15)


@given(SEEDS, FLAGS, FLAGS)
def test_it_is_zero_where_nothing_moved(seed, orthographic, mirrored):
    still = {"camera": False, "objects": False, "vertices": False, "window": False}
    first, second = random_moments(seed, 1.0, orthographic, mirrored, **still)
    assert pixel_drift(first, second, WIDTH, HEIGHT) == 0.0
    assert pixel_drift(first, first, WIDTH, HEIGHT) == 0.0


def frame(x=0.0, z=0.0, camera=None, mesh=None):
    mesh = builders.quad("q") if mesh is None else mesh
    batch = replace(builders.batch("q", builders.translation(x, 0.0, z)), version=new_version())
    return Moment(builders.scene(mesh, batches=(batch,)), camera or builders.camera())


@pytest.mark.parametrize("orthographic", [False, True])
def test_any_motion_that_is_seen_counts(orthographic):
    camera = builders.camera(orthographic=orthographic)
    assert 0.0 < pixel_drift(frame(camera=camera), frame(1e-9, camera=camera), WIDTH, HEIGHT) < 1e-6
    turned = replace(camera, world_from_camera=camera.world_from_camera @ pose(turn(np.array([0, 1, 0]), 1e-9), 0.0))
    assert 0.0 < pixel_drift(frame(camera=camera), frame(camera=turned), WIDTH, HEIGHT) < 1e-6


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("who", ["object", "camera", "vertices", "window", "object and window"])
def test_a_step_across_the_view_is_measured_exactly(orthographic, who):
    camera = builders.camera(z=4.0, orthographic=orthographic)
    mesh = builders.quad("q")
    depth = 1.0 if orthographic else 4.0
    step = 1.0 / 1024.0
    moved = {
        "object": {"x": step},
        "camera": {"camera": replace(camera, world_from_camera=builders.translation(step, 0.0, 4.0))},
        "vertices": {"mesh": replace(mesh, positions=mesh.positions + np.float32([step, 0, 0]), version=new_version())},
        "window": {"camera": camera.shifted(step / depth / 2.0, 0.0)},
        "object and window": {"x": step, "camera": camera.shifted(-step / depth / 2.0, 0.0)},
    }[who]
    steps = 2 if who == "object and window" else 1
    bound = pixel_drift(frame(camera=camera, mesh=mesh), frame(**{"camera": camera, "mesh": mesh, **moved}), WIDTH, 9)
    assert bound == pytest.approx(steps * step / depth / 2.0 * WIDTH)


def test_a_step_away_from_the_camera_is_measured_at_the_edge_of_the_view():
    """Exactly: a point that is at the edge at depth 4 was a third of half the picture outside at depth 3."""
    corner = builders.mesh("q", [(4.0, 0.0, 0.0)] * 3, [(0, 1, 2)])
    camera = builders.camera(z=3.0)
    bound = pixel_drift(frame(camera=camera, mesh=corner), frame(z=-1.0, camera=camera, mesh=corner), 2, 0)
    assert bound == pytest.approx(1.0 / 3.0)


def test_a_turning_camera_is_measured_at_the_edge_of_the_view_however_large_the_scene():
    angle = 1e-3
    around = builders.mesh("q", 100.0 * np.array([(-1, -1, -1), (1, -1, 1), (1, 1, -1), (-1, 1, 1)]), [(0, 1, 2)])
    camera = builders.camera(z=0.0)
    turned = replace(camera, world_from_camera=pose(turn(np.array([0.0, 1.0, 0.0]), angle), 0.0))
    bound = pixel_drift(frame(camera=camera, mesh=around), frame(camera=turned, mesh=around), WIDTH, HEIGHT)
    at_the_edge = (np.tan(np.pi / 4.0 + angle) - 1.0) / 2.0 * WIDTH
    assert at_the_edge <= bound <= 1.5 * at_the_edge


def test_what_is_not_seen_does_not_count():
    still = builders.quad("q")
    for place in ({"z": 9.0}, {"x": 99.0}, {"x": -99.0}, {"z": -9999.0}):
        there = {"x": 0.0, "z": 0.0, **place}
        moved = {**there, "x": there["x"] + 0.5}
        assert pixel_drift(frame(**there, mesh=still), frame(**moved, mesh=still), WIDTH, HEIGHT) == 0.0


def test_what_only_casts_shadows_does_not_count():
    first, second = (frame(x) for x in (0.0, 0.25))
    assert pixel_drift(first, second, WIDTH, HEIGHT) > 0.0
    unseen = [replace(batch, seen_by_camera=False) for batch in second.scene.batches]
    second = replace(second, scene=replace(second.scene, batches=tuple(unseen)))
    assert pixel_drift(first, second, WIDTH, HEIGHT) == 0.0


def test_the_largest_answer_where_there_is_no_other():
    view = builders.camera()
    assert pixel_drift(frame(), frame(camera=replace(view, orthographic=True)), WIDTH, HEIGHT) == LARGEST_DRIFT
    # Through the camera's plane: no telling where it was on screen.
    assert pixel_drift(frame(z=4.0), frame(z=0.0), WIDTH, HEIGHT) == LARGEST_DRIFT
    assert pixel_drift(frame(), frame(2.0), WIDTH, HEIGHT) == LARGEST_DRIFT


def test_what_is_new_or_empty_has_not_moved():
    empty = Moment(
        builders.scene(builders.quad("q"), batches=(builders.batch("q", np.empty((0, 4, 4))),)), builders.camera()
    )
    assert pixel_drift(empty, frame(), WIDTH, HEIGHT) == 0.0
    assert pixel_drift(frame(), empty, WIDTH, HEIGHT) == 0.0
    nothing = Moment(builders.scene(), builders.camera())
    assert pixel_drift(nothing, nothing, WIDTH, HEIGHT) == 0.0


def test_far_from_the_origin_small_motions_are_still_told_apart():
    camera = replace(builders.camera(), world_from_camera=builders.translation(1e6, 0.0, 3.0))
    step = 1e-8
    bound = pixel_drift(frame(1e6, camera=camera), frame(1e6 + step, camera=camera), WIDTH, HEIGHT)
    assert bound == pytest.approx(step / 3.0 / 2.0 * WIDTH, rel=0.02)  # 1e6 m is stored in steps of 1.2e-10 m
