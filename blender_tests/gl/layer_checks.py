# SPDX-License-Identifier: GPL-3.0-or-later
"""What must hold of the layers of a deep G-buffer."""

from collections.abc import Sequence
from dataclasses import fields
from itertools import pairwise

import numpy as np
from layer_raycast import UNIT_ROUNDOFF, LayerReference

from addon.render import LayerImages


def assert_separated(images: Sequence[LayerImages], separation: float, *, relative: bool = False) -> None:
    """Z(k+1) > Z(k) + Δz everywhere, in the float32 arithmetic that the layers are stored in.

    With `relative`, Δz·Z(k) instead of Δz: its product and sum round twice, by u of the threshold each.
    """
    for nearer, farther in pairwise(images):
        there = np.isfinite(farther.depth)
        assert np.isfinite(nearer.depth[there]).all(), "a layer is covered where the one before it is empty"
        near, far = nearer.depth[there], farther.depth[there]
        if relative:
            threshold = near.astype(np.float64) * (1.0 + separation) * (1.0 - 2.0 * UNIT_ROUNDOFF)
        else:
            threshold = near + np.float32(separation)
        assert (far > threshold).all()


def assert_agrees(images: Sequence[LayerImages], truth: LayerReference) -> None:
    """Coverage, depth, owner and normal of every layer equal the ray caster's at all pixels that are certain."""
    certain = ~truth.ambiguous
    for layer, image in enumerate(images):
        covered = np.isfinite(truth.depth[layer])
        wrong = certain & (covered != np.isfinite(image.depth))
        assert not wrong.any(), f"layer {layer}: coverage differs at (row, column) {np.argwhere(wrong)[:4].tolist()}"
        checked = certain & covered
        depth, expected = image.depth[checked].astype(np.float64), truth.depth[layer][checked]
        excess = np.abs(depth - expected) - truth.tolerance[layer][checked]
        assert excess.max(initial=0.0) <= 0.0, f"layer {layer}: depth is off at {np.argwhere(checked)[excess.argmax()]}"
        np.testing.assert_array_equal(image.object_index[checked], truth.owner[layer][checked])
        cosine = np.abs((image.normal[checked] * truth.normal[layer][checked]).sum(axis=-1))
        assert cosine.min(initial=1.0) > 0.999


def assert_identical(images: Sequence[LayerImages], others: Sequence[LayerImages], message: str = "") -> None:
    """Every channel of every layer is the same to the last bit."""
    assert len(images) == len(others)
    for layer, (image, other) in enumerate(zip(images, others, strict=True)):
        for field in fields(LayerImages):
            where = f"{message} layer {layer} {field.name}"
            np.testing.assert_array_equal(getattr(image, field.name), getattr(other, field.name), err_msg=where)


def assert_defined(images: Sequence[LayerImages]) -> None:
    """Depths are positive and +∞ only where nothing is drawn (pass indices start at 1); all else is finite."""
    for layer, image in enumerate(images):
        for field in fields(LayerImages):
            values = getattr(image, field.name)
            if values is None:
                continue
            if "depth" in field.name:
                assert (values > 0.0).all(), f"layer {layer} {field.name}"
            else:
                assert np.isfinite(values).all(), f"layer {layer} {field.name}"
        np.testing.assert_array_equal(np.isfinite(image.depth), image.object_index > 0, f"layer {layer}")


def differing(images: Sequence[LayerImages], others: Sequence[LayerImages], layer: int = 1) -> np.ndarray:
    """(H, W) whether any channel of a layer differs."""
    different = np.zeros(images[layer].depth.shape, bool)
    for field in fields(LayerImages):
        image, other = getattr(images[layer], field.name), getattr(others[layer], field.name)
        if image is not None and other is not None:
            different |= (image != other).reshape(*different.shape, -1).any(axis=-1)
    return different
