# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.render.frustum import boxes_inside, boxes_near, frustum_planes, scene_boxes
from addon.scene import Camera
from blender_tests import builders


def any_camera(generator, *, orthographic, mirrored):
    """A camera anywhere, turned at random, with a shifted window."""
    rotation, _ = np.linalg.qr(generator.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3] = rotation * np.sign(np.linalg.det(rotation))
    pose[:3, 3] = generator.uniform(-10.0, 10.0, 3)
    left, bottom = generator.uniform(-2.0, 1.0, 2)
    right, top = np.add((left, bottom), generator.uniform(0.1, 3.0, 2))
    window = (right, left, bottom, top) if mirrored else (left, right, bottom, top)
    return Camera(pose, window, 0.5, 20.0, orthographic)


def is_seen(camera, points):
    """(N,) by the projection matrix, and the distance in its units from the nearest border, to leave those out."""
    view = (points - camera.position) @ camera.rotation
    clip = np.column_stack([view, np.ones(len(view))]) @ camera.projection(zero_to_one_depth=True).T
    across = np.abs(clip[:, :2] / clip[:, 3:])
    depth = -view[:, 2]
    seen = (across < 1.0).all(axis=1) & (depth > camera.clip_start) & (depth < camera.clip_end)
    return seen, np.abs(np.column_stack([across - 1.0, depth - camera.clip_start, depth - camera.clip_end])).min(axis=1)


@given(st.booleans(), st.booleans(), st.integers(0, 2**32 - 1))
def test_planes_part_what_a_camera_sees_from_the_rest(orthographic, mirrored, seed):
    generator = np.random.default_rng(seed)
    camera = any_camera(generator, orthographic=orthographic, mirrored=mirrored)
    planes = frustum_planes(camera)
    depth = generator.uniform(-5.0, 25.0, 400)
    across = generator.uniform(-4.0, 4.0, (400, 2)) * (1.0 if orthographic else depth[:, None])
    points = np.column_stack([across, -depth]) @ camera.rotation.T + camera.position
    inside = (points @ planes[:, :3].T + planes[:, 3] >= 0.0).all(axis=1)
    seen, border = is_seen(camera, points)
    clear = border > 1e-9
    assert np.array_equal(inside[clear], seen[clear])
    assert np.allclose(np.linalg.norm(planes[:, :3], axis=1), 1.0, rtol=0.0, atol=1e-12)


@given(st.booleans(), st.integers(0, 2**32 - 1))
def test_a_box_that_holds_a_seen_point_is_inside(orthographic, seed):
    generator = np.random.default_rng(seed)
    camera = any_camera(generator, orthographic=orthographic, mirrored=False)
    points = generator.uniform(-20.0, 20.0, (500, 3))
    reach = generator.uniform(0.0, 3.0, (2, 500, 3))
    boxes = np.stack([points - reach[0], points + reach[1]], axis=1)
    inside = boxes_inside(boxes, frustum_planes(camera))
    assert inside[is_seen(camera, points)[0]].all()


def test_boxes_beyond_a_plane_are_outside_and_in_an_objects_own_space_too():
    camera = builders.camera(z=3.0, half_width=1.0, clip_start=0.1, clip_end=10.0)
    centers = np.array([(0, 0, 0), (5, 0, 0), (0, -5, 0), (0, 0, 5), (0, 0, -9)], np.float64)
    boxes = np.stack([centers - 0.5, centers + 0.5], axis=1)
    expected = [True, False, False, False, False]
    assert boxes_inside(boxes, frustum_planes(camera)).tolist() == expected
    world_from_object = builders.translation(x=100.0) @ np.diag([4.0, 0.5, 2.0, 1.0])
    linear, shift = world_from_object[:3, :3], world_from_object[:3, 3]
    own = (boxes - shift) / linear.diagonal()
    assert boxes_inside(own, frustum_planes(camera) @ world_from_object).tolist() == expected


@pytest.mark.parametrize(("radius", "near"), [(0.99, False), (1.01, True), (1.5, True)])
def test_a_ball_reaches_a_box_by_its_nearest_point(radius, near):
    box = np.array([[(-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)]])
    assert boxes_near(box, np.array([1.6, 1.8, 0.5]), radius).tolist() == [near]


def test_scene_boxes_hold_every_instance_in_few_boxes():
    generator = np.random.default_rng(2)
    matrices = np.tile(np.eye(4), (1000, 1, 1))
    matrices[:, :3] = generator.normal(size=(1000, 3, 4))
    scene = builders.scene(
        builders.box("many", 0.7),
        builders.box("one"),
        batches=(builders.batch("many", matrices), builders.batch("one"), builders.batch("one", [], key="none")),
    )
    boxes = scene_boxes(scene, most=32)
    assert len(boxes) <= 32 + 2
    corners = np.array([[x, y, z] for x in (-0.7, 0.7) for y in (-0.7, 0.7) for z in (-0.7, 0.7)], np.float32)
    placed = corners @ np.swapaxes(matrices[:, :3, :3], 1, 2) + matrices[:, None, :3, 3]
    inside = ((placed[:, :, None] >= boxes[:, 0] - 1e-12) & (placed[:, :, None] <= boxes[:, 1] + 1e-12)).all(axis=-1)
    assert inside.any(axis=-1).all()
    assert boxes[-1].tolist() == [[-1, -1, -1], [1, 1, 1]]
    assert scene_boxes(builders.scene(batches=())).shape == (0, 2, 3)
