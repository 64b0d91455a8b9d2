# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.render.atlas import Slot
from addon.render.shadow_table import TEXELS_PER_MAP, empty_row, shadow_row
from addon.scene import Camera


@given(st.booleans(), st.integers(5, 11), st.integers(0, 2**32 - 1))
def test_a_row_projects_as_its_camera_does(orthographic, power, seed):
    """Texel x, y of the page to a hundredth, nearness to float32's precision, of points relative to an origin."""
    generator = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(generator.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3] = rotation * np.sign(np.linalg.det(rotation))
    pose[:3, 3] = generator.normal(size=3) * 1e3
    left, bottom = generator.uniform(-1.0, 0.0, 2)
    right, top = np.add((left, bottom), generator.uniform(0.5, 2.0))
    camera = Camera(pose, (left, right, bottom, top), 1e-6, 20.0, orthographic)
    size = 2**power
    slot = Slot(3, size * int(generator.integers(0, 2048 // size)), size * int(generator.integers(0, 2)), size)
    depth = generator.uniform(0.5, 20.0, 50)
    share = generator.random((50, 2))
    across = np.array([left, bottom]) + share * (right - left, top - bottom)
    view = np.column_stack([across * (1.0 if orthographic else depth[:, None]), -depth])
    points = view @ camera.rotation.T + camera.position
    origin = camera.position + generator.normal(size=3) * 5.0
    row = shadow_row(camera, slot, origin, 50.0)
    assert row.dtype == np.float32
    assert row.shape == (TEXELS_PER_MAP, 4)
    mapped = np.column_stack([points - origin, np.ones(50)]) @ row[:4].astype(np.float64).T
    np.testing.assert_allclose(mapped[:, 0] / mapped[:, 3], slot.x + share[:, 0] * size, atol=0.02)
    np.testing.assert_allclose(mapped[:, 1] / mapped[:, 3], slot.y + share[:, 1] * size, atol=0.02)
    nearness = 20.0 - depth if orthographic else 1.0 / depth
    np.testing.assert_allclose(mapped[:, 2] / mapped[:, 3], nearness, rtol=1e-4, atol=2e-5)
    assert row[4].tolist() == [slot.x, slot.y, size, 3]
    assert row[5, 0] == pytest.approx((right - left) / size)
    assert bool(row[5, 1]) == orthographic
    assert row[5, 2] == 50.0


def test_an_empty_row_has_no_size():
    assert empty_row().shape == (TEXELS_PER_MAP, 4)
    assert not empty_row().any()
