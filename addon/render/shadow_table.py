# SPDX-License-Identifier: GPL-3.0-or-later
"""Where shadow maps are and what they see, as rows of a float texture that shaders read."""

import numpy as np

from ..scene import Camera
from ..scene.arrays import Float32Array, Float64Array
from .atlas import Slot

TEXELS_PER_MAP = 6

SHADOW_CUBE = -1.0
"""Stands in place of a light's number of maps where they are the six faces of a cube."""


def shadow_row(camera: Camera, slot: Slot, origin: Float64Array, extent: float) -> Float32Array:
    """(6, 4) float32 of one map: four matrix rows from camera-relative (`origin` (3,)) to map space, its place, optics.

    Map space (x, y, n, w): texel of the map's page x/w, y/w, nearness n/w as `shadow_maps.frag` has it. The place:
    lower left texel x, y, texels a side (0: there is no map), page. The optics: width of a texel at distance 1
    (orthographic: m), whether it is orthographic, and `extent`: m from its camera to the farthest corner of a caster.
    """
    left, right, bottom, top = camera.window
    to_texel = np.array([slot.size / (right - left), slot.size / (top - bottom)])
    rows = np.zeros((4, 4))
    rotation = camera.rotation.T
    view = np.column_stack([rotation, rotation @ (origin - camera.position)])
    depth = -view[2]
    # x/w runs from the lower left texel's corner.
    if camera.orthographic:
        rows[0], rows[1] = view[0] * to_texel[0], view[1] * to_texel[1]
        rows[0, 3] += slot.x - left * to_texel[0]
        rows[1, 3] += slot.y - bottom * to_texel[1]
        rows[2] = -depth
        rows[2, 3] += camera.clip_end
        rows[3, 3] = 1.0
    else:
        rows[0] = view[0] * to_texel[0] + depth * (slot.x - left * to_texel[0])
        rows[1] = view[1] * to_texel[1] + depth * (slot.y - bottom * to_texel[1])
        rows[2, 3] = 1.0
        rows[3] = depth
    place = (slot.x, slot.y, slot.size, slot.page)
    optics = ((right - left) / slot.size, camera.orthographic, extent, 0.0)
    return np.vstack([rows, place, optics]).astype(np.float32)


def empty_row() -> Float32Array:
    """(6, 4) float32: nothing is there, so that light passes."""
    return np.zeros((TEXELS_PER_MAP, 4), np.float32)
