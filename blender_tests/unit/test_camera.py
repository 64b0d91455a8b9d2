# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.scene import Camera

depths = st.floats(1e-4, 1e7)


def project(camera, point, zero_to_one=True):
    clip = camera.projection(zero_to_one_depth=zero_to_one) @ [*point, 1.0]
    return clip[:3] / clip[3]


@given(depths, st.floats(-5, 5), st.floats(-5, 5))
def test_perspective_maps_the_window_to_the_clip_square(depth, shift_x, shift_y):
    window = (shift_x - 0.5, shift_x + 0.7, shift_y - 0.3, shift_y + 0.4)
    camera = Camera(np.eye(4), window, 1e-4, 1e7)
    low = project(camera, (window[0] * depth, window[2] * depth, -depth))
    high = project(camera, (window[1] * depth, window[3] * depth, -depth))
    np.testing.assert_allclose([low[:2], high[:2]], [[-1, -1], [1, 1]], atol=1e-9)


@given(depths)
def test_reversed_depth_keeps_relative_precision_in_float32(depth):
    """near/z in float32 recovers z to a few units in the last place, from 1e-4 to 1e7 in one view."""
    camera = Camera(np.eye(4), (-1, 1, -1, 1), 1e-4, 1e7)
    stored = np.float32(project(camera, (0, 0, -depth))[2])
    assert 1e-4 / float(stored) == pytest.approx(depth, rel=4 * 2.0**-23)


@pytest.mark.parametrize("orthographic", [False, True])
def test_depth_is_one_at_the_near_plane_and_falls_away(orthographic):
    camera = Camera(np.eye(4), (-1, 1, -1, 1), 0.5, 20.0, orthographic)
    near, middle, far = (project(camera, (0, 0, -z))[2] for z in (0.5, 5.0, 20.0))
    assert near == pytest.approx(1.0)
    assert near > middle > far >= 0.0
    assert far == pytest.approx(0.0 if orthographic else 0.5 / 20.0)


def test_minus_one_to_one_depth_is_the_same_depth_stretched():
    for orthographic in (False, True):
        camera = Camera(np.eye(4), (-1, 1, -1, 1), 0.5, 20.0, orthographic)
        assert project(camera, (0.1, 0.2, -3), False)[2] == pytest.approx(2 * project(camera, (0.1, 0.2, -3))[2] - 1)


def test_a_crop_shows_its_part_of_the_full_window():
    camera = Camera(np.eye(4), (-2, 2, -1, 1), 0.1, 100.0)
    assert camera.cropped(0.5, 1.0, 0.25, 0.75).window == (0.0, 2.0, -0.5, 0.5)
    assert camera.shifted(0.25, -0.5).window == (-1.0, 3.0, -2.0, 0.0)
