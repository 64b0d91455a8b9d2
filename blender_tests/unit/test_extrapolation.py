# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame that two frames foretell."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.scene import Moment
from addon.scene.extrapolation import extrapolated
from addon.scene.versions import new_version
from blender_tests import builders

ULP = np.finfo(np.float64).eps
LENGTHS = st.floats(-1e6, 1e6)
VECTORS = st.tuples(LENGTHS, LENGTHS, LENGTHS).map(np.array)
ANGLES = st.floats(-3.0, 3.0)
AXES = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda axis: np.linalg.norm(axis) > 1e-3)


def rotation(axis, angle):
    """(3, 3) by Rodrigues' formula."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([(0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def rigid(axis, angle, position):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation(axis, angle), position
    return matrix


def about(axis, angle, center):
    """A rotation about an axis through a point."""
    return builders.translation(*center) @ rigid(axis, angle, (0.0, 0.0, 0.0)) @ builders.translation(*-center)


def moment(matrices=None, mesh=None, camera=None, ids=None):
    """A frame of its own, with versions that no other has."""
    mesh = builders.quad("q") if mesh is None else mesh
    batch = builders.batch("q", matrices)
    batch = replace(batch, version=new_version(), ids=batch.ids if ids is None else np.array(ids))
    return Moment(builders.scene(mesh, batches=(batch,)), camera or builders.camera())


def moved(mesh, step):
    return replace(mesh, version=new_version(), positions=mesh.positions + np.asarray(step, np.float32))


rigid_motions = given(AXES, ANGLES, VECTORS, AXES, ANGLES, VECTORS)


@rigid_motions
def test_constant_rotation_about_any_axis_is_exact(axis, angle, position, step_axis, step_angle, center):
    start = rigid(axis, angle, position) @ np.diag([2.0, 1.0, 0.5, 1.0])
    step = about(step_axis, step_angle, center)
    result = extrapolated(moment(start), moment(step @ start))
    # The frames themselves are known to a few roundings of the largest number that went into them.
    roundings = 64 * ULP * max(1.0, np.abs(position).max(), np.abs(center).max())
    np.testing.assert_allclose(result.scene.batches[0].matrices[0], step @ step @ start, rtol=0, atol=roundings)


@given(AXES, ANGLES, VECTORS, VECTORS)
def test_constant_velocity_is_exact_to_the_last_rounding(axis, angle, position, velocity):
    frames = [rigid(axis, angle, position + k * velocity) for k in range(3)]
    result = extrapolated(moment(frames[0]), moment(frames[1])).scene.batches[0].matrices[0]
    np.testing.assert_array_equal(result[:3, :3], frames[2][:3, :3])
    roundings = 4 * ULP * (np.abs(position).max() + 2 * np.abs(velocity).max())
    np.testing.assert_allclose(result[:3, 3], frames[2][:3, 3], rtol=0, atol=roundings)


@rigid_motions
def test_what_is_rigid_stays_rigid(axis, angle, position, step_axis, step_angle, center):
    start = rigid(axis, angle, position)
    step = about(step_axis, step_angle, center)
    cameras = [replace(builders.camera(), world_from_camera=pose) for pose in (start, step @ start)]
    result = extrapolated(moment(start, camera=cameras[0]), moment(step @ start, camera=cameras[1]))
    for linear in (result.scene.batches[0].matrices[0, :3, :3], result.camera.rotation):
        np.testing.assert_allclose(linear.T @ linear, np.eye(3), rtol=0, atol=32 * ULP)
        assert np.linalg.det(linear) > 0.0
    roundings = 64 * ULP * max(1.0, np.abs(position).max(), np.abs(center).max())
    np.testing.assert_allclose(result.camera.world_from_camera, step @ step @ start, rtol=0, atol=roundings)


def test_a_camera_that_is_not_quite_rigid_comes_out_rigid():
    bent = rigid(np.array([1.0, 2.0, 3.0]), 0.5, (1.0, 2.0, 3.0))
    bent[0, 0] += 1e-6
    cameras = [replace(builders.camera(), world_from_camera=pose) for pose in (np.eye(4), bent)]
    result = extrapolated(moment(camera=cameras[0]), moment(camera=cameras[1])).camera.rotation
    np.testing.assert_allclose(result.T @ result, np.eye(3), rtol=0, atol=32 * ULP)


def test_where_nothing_moved_everything_is_the_very_same_object():
    earlier, previous = moment(), moment()
    assert extrapolated(previous, previous) is previous
    assert extrapolated(earlier, previous) is previous


def test_what_stands_still_beside_what_moves_keeps_its_version():
    still = replace(builders.batch("q", key="still"), version=new_version())
    frames = []
    for x in (0.0, 1.0):
        moving = replace(builders.batch("q", builders.translation(x), key="moving"), version=new_version())
        frames.append(Moment(builders.scene(builders.quad("q"), batches=(moving, still)), builders.camera()))
    previous, result = frames[1], extrapolated(*frames)
    assert result.camera is previous.camera
    assert result.scene.meshes["q"] is previous.scene.meshes["q"]
    assert result.scene.batches[1] is still
    assert result.scene.batches[0].version not in [frame.scene.batches[0].version for frame in frames]
    assert result.scene.batches[0].matrices[0, 0, 3] == 2.0
    before, after = previous.scene.versions, result.scene.versions
    assert after == replace(before, transforms=after.transforms)
    assert after.transforms != before.transforms


def test_instances_are_told_apart_by_id():
    earlier = moment([builders.translation(x) for x in (0.0, 10.0)], ids=[7, 8])
    previous = moment([builders.translation(x) for x in (11.0, 5.0, 2.0)], ids=[8, 9, 7])
    matrices = extrapolated(earlier, previous).scene.batches[0].matrices
    assert matrices[:, 0, 3].tolist() == [12.0, 5.0, 4.0]


@pytest.mark.parametrize("flat", [np.zeros((3, 3)), np.diag([1.0, 1.0, 0.0]), np.diag([1.0, 1e-13, 1.0])])
def test_what_had_no_volume_stays(flat):
    start = np.eye(4)
    start[:3, :3] = flat
    previous = moment(builders.translation(1.0))
    assert extrapolated(moment(start), previous).scene is previous.scene


@pytest.mark.parametrize("scale", [1e-120, 1e-5, 1e120])
def test_scale_alone_does_not_make_singular(scale):
    frames = [builders.translation(x) @ np.diag([scale, scale, scale, 1.0]) for x in range(3)]
    result = extrapolated(moment(frames[0]), moment(frames[1])).scene.batches[0].matrices[0]
    np.testing.assert_array_equal(result, frames[2])


def test_growth_beyond_all_numbers_stays():
    frames = [np.diag([scale, scale, scale, 1.0]) for scale in (1e-200, 1e200)]
    previous = moment(frames[1])
    assert extrapolated(moment(frames[0]), previous).scene is previous.scene


def test_vertices_move_on_linearly():
    meshes = [moved(builders.quad("q"), (0.25 * k, 0.0, -0.5 * k)) for k in range(3)]
    result = extrapolated(moment(mesh=meshes[0]), moment(mesh=meshes[1])).scene
    np.testing.assert_array_equal(result.meshes["q"].positions, meshes[2].positions)
    assert result.meshes["q"].positions.dtype == np.float32
    assert result.meshes["q"].version not in [mesh.version for mesh in meshes]
    assert result.meshes["q"].triangles is meshes[1].triangles


def test_velocities_count_before_positions():
    mesh = builders.quad("q")
    velocities = np.array([(1, 0, 0), (0, 2, 0), (0, 0, 3), (0, 0, 0)], np.float32)
    flying = replace(moved(mesh, (9.0, 9.0, 9.0)), velocities=velocities)
    result = extrapolated(moment(mesh=mesh), moment(mesh=flying)).scene.meshes["q"]
    np.testing.assert_array_equal(result.positions, flying.positions + velocities)
    resting = replace(flying, version=new_version(), velocities=np.zeros((4, 3), np.float32))
    assert extrapolated(moment(mesh=mesh), moment(mesh=resting)).scene.meshes["q"] is resting


def test_velocities_serve_where_the_topology_changed():
    mesh = builders.quad("q")
    other = builders.mesh("q", mesh.positions, [(0, 1, 2)])
    splash = replace(other, version=new_version(), velocities=np.ones((4, 3), np.float32))
    result = extrapolated(moment(mesh=mesh), moment(mesh=splash)).scene.meshes["q"]
    np.testing.assert_array_equal(result.positions, splash.positions + 1.0)


def test_another_topology_stays():
    previous = moment(mesh=replace(builders.mesh("q", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]), version=99))
    assert extrapolated(moment(), previous).scene is previous.scene


def test_vertices_never_reach_infinity():
    mesh = builders.quad("q")
    far = moved(mesh, (3e38, 0.0, 0.0))
    positions = extrapolated(moment(mesh=mesh), moment(mesh=far)).scene.meshes["q"].positions
    assert np.isfinite(positions).all()


def camera_with(window, **changes):
    return replace(builders.camera(), window=window, **changes)


def continued_window(before, now, **changes):
    return extrapolated(moment(camera=camera_with(before)), moment(camera=camera_with(now, **changes))).camera.window


def test_the_window_moves_and_grows_linearly():
    assert continued_window((-1, 1, -1, 1), (-2, 1, -1.5, 1)) == (-3, 1, -2, 1)
    assert continued_window((1, -1, -1, 1), (2, -1, -1, 1)) == (3, -1, -1, 1)


def test_a_window_never_turns_inside_out():
    assert continued_window((-4, 4, -4, 4), (-2, 2, -2, 2)) == (-2, 2, -2, 2)
    assert continued_window((1, -1, -1, 1), (-1, 1, -1, 1)) == (-3, 3, -1, 1)
    assert continued_window((-9, 9, -1, 1), (-1, 1, -2, 2)) == (-1, 1, -2, 2)


def test_windows_of_different_projections_do_not_mix():
    assert continued_window((-1, 1, -1, 1), (-2, 2, -2, 2), orthographic=True) == (-2, 2, -2, 2)
