# SPDX-License-Identifier: GPL-3.0-or-later
"""How far the layers of one variant are from the reference's, Two-Pass of the same frame."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from addon.scene import Camera
from addon.scene.arrays import BoolArray, Float32Array, Float64Array
from blender_tests.bench._occlusion import obscurance

SAME_DEPTH = 8 * float(np.finfo(np.float32).eps)
"""Largest relative difference of two depths that count as the same surface."""


@dataclass(frozen=True)
class Errors:
    """Shares are of covered pixels, but `missed` is of those where the reference has a layer 1.

    `violating`: some layer lies no more than Δz behind the one before it. `differing`: layer 1 is there in one only, or
    at another depth. `missed`: layer 1 is not there. `occlusion`: root mean square difference of the obscurance.
    """

    violating: float
    differing: float
    missed: float
    occlusion: float


@dataclass(frozen=True)
class Reference:
    """View depths (n, H, W), +inf where empty, normals (H, W, 3) of layer 0, and the camera that saw them."""

    depths: Float32Array
    normals: Float32Array
    camera: Camera

    @cached_property
    def openness(self) -> Float64Array:
        """Obscurance from all layers."""
        return obscurance(self.depths, self.normals, self.camera)


def errors(depths: Float32Array, reference: Reference, separation: float) -> Errors:
    """The errors of one frame's layers (n, H, W). A single one has no others to get wrong, but lacks what they occlude.

    Raises ValueError where layer 0 differs: no variant may change the picture itself.
    """
    expected = reference.depths
    if not np.array_equal(depths[0], expected[0]):
        raise ValueError("layer 0 differs from the reference's")
    if np.array_equal(depths, expected):
        return Errors(0.0, 0.0, 0.0, 0.0)
    occlusion = occlusion_difference(depths, reference)
    if len(depths) == 1:
        return Errors(0.0, 0.0, 0.0, occlusion)
    covered = max(int(np.isfinite(expected[0]).sum()), 1)
    hidden = np.isfinite(expected[1])
    return Errors(
        violating=int(violations(depths, separation).sum()) / covered,
        differing=int(differences(depths[1], expected[1]).sum()) / covered,
        missed=int((hidden & ~np.isfinite(depths[1])).sum()) / max(int(hidden.sum()), 1),
        occlusion=occlusion,
    )


def violations(depths: Float32Array, separation: float) -> BoolArray:
    """Pixels (H, W) of `depths` (n, H, W) where a layer is there, but no more than `separation` behind the last."""
    there = np.isfinite(depths[1:])
    before = np.where(np.isfinite(depths[:-1]), depths[:-1], -np.inf)
    return np.any(there & (depths[1:] <= before + np.float32(separation)), axis=0)


def differences(depth: Float32Array, expected: Float32Array) -> BoolArray:
    """Pixels (H, W) where a surface is there in one only, or the two depths are of different surfaces."""
    there, wanted = np.isfinite(depth), np.isfinite(expected)
    both = there & wanted
    apart = np.zeros(depth.shape, bool)
    apart[both] = np.abs(depth[both] - expected[both]) > SAME_DEPTH * expected[both]
    return (there != wanted) | apart


def occlusion_difference(depths: Float32Array, reference: Reference) -> float:
    """Root mean square difference of the obscurance from `depths` (n, H, W) and from the reference's."""
    apart = obscurance(depths, reference.normals, reference.camera) - reference.openness
    seen = apart[np.isfinite(apart)]
    return float(np.sqrt(np.mean(seen**2))) if seen.size else 0.0
