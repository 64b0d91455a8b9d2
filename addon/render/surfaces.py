# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles as surfaces that points are drawn from. Pure: no OpenGL, no Blender."""

from bisect import bisect_right
from functools import cached_property

import numpy as np

from ..scene import Mesh, SlotRange
from ..scene.arrays import Float32Array, Float64Array

_BELOW_ONE = float(np.nextafter(1.0, 0.0))

_UNIFORMITY = 1e-6
"""Relative difference of a matrix's squared scales up to which all areas are as many times those of the mesh."""

_ROUNDINGS = 64.0
"""Roundings of float32 that a light leaves out in front of it: a sum of four products has 7, and a triangle that is off
by these is met several times as far away by light that leaves at a grazing angle."""


class SlotSurface:
    """The triangles (T, 3) of one slot of a mesh, rows of its `positions` (V, 3) float32, in object space."""

    def __init__(self, mesh: Mesh, slot: SlotRange) -> None:
        self.positions = mesh.positions
        self.triangles = mesh.triangles[slot.first : slot.first + slot.count]

    def areas(self, linear: Float64Array) -> Float64Array:
        """(T,) m², where a matrix (3, 3) places them."""
        places = self.positions.astype(np.float64) @ linear.T
        first = places[self.triangles[:, 0]]
        (ax, ay, az), (bx, by, bz) = ((places[self.triangles[:, corner]] - first).T for corner in (1, 2))
        return 0.5 * np.sqrt((ay * bz - az * by) ** 2 + (az * bx - ax * bz) ** 2 + (ax * by - ay * bx) ** 2)


class Surface:
    """A slot's triangles in world space. Works out only what it is asked for.

    `matrix` (4, 4): world-from-object. `similar`: the same surface in object space, where the matrix scales uniformly.
    """

    def __init__(self, slot: SlotSurface, matrix: Float64Array, similar: "Surface | None" = None) -> None:
        self._slot, self._similar = slot, similar
        self._linear, self._translation = matrix[:3, :3], matrix[:3, 3]
        determinant = float(np.linalg.det(self._linear))
        self._mirrored, self._scale = determinant < 0.0, abs(determinant) ** (1.0 / 3.0)

    def placed(self, matrix: Float64Array) -> "Surface":
        """One in object space where `matrix` (4, 4), world-from-object, puts it."""
        squared = matrix[:3, :3].T @ matrix[:3, :3]
        scale = float(np.trace(squared)) / 3.0
        uniform = np.abs(squared - scale * np.eye(3)).max() <= _UNIFORMITY * scale
        return Surface(self._slot, matrix, self if uniform else None)

    @cached_property
    def area(self) -> float:
        """m²."""
        if self._similar is not None:
            return self._scale**2 * self._similar.area
        return float(self._slot.areas(self._linear).sum())

    @cached_property
    def cumulative(self) -> Float32Array:
        """(T,) share of the area up to and including each triangle."""
        if self._similar is not None:
            return self._similar.cumulative
        sums = np.cumsum(self._slot.areas(self._linear))
        return (sums / sums[-1]).astype(np.float32)

    @property
    def center(self) -> Float64Array:
        """(3,) the mean point of its surface, world space."""
        return self._placed(self._shape[0])

    @property
    def radius(self) -> float:
        """Of the ball about its centre that holds it, m."""
        return self._shape[1]

    @cached_property
    def rounding(self) -> float:
        """How far (m) from a point of it the GPU, which has float32 only, may find the triangle that it lies on.

        `_ROUNDINGS` of the products that place it about its object's origin: coordinates times matrix entries.
        """
        products = np.abs(self._linear) @ self._shape[2]
        return _ROUNDINGS * float(np.finfo(np.float32).eps) * float(np.linalg.norm(products))

    def triangle(self, index: int) -> Float64Array:
        """(3, 3) corners of one, counter-clockwise from its front, world space."""
        corners = self._placed(self._slot.positions[self._slot.triangles[index]].astype(np.float64))
        return corners[::-1] if self._mirrored else corners  # mirrored: the front stays the front

    def point(self, u: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Point and unit front normal (3,) for u (3,) in [0, 1), of which it takes two: uniform over the area."""
        share = min(float(u[0]), _BELOW_ONE)
        at = bisect_right(self.cumulative, share, key=float)
        a, b, c = self.triangle(at)
        before = float(self.cumulative[at - 1]) if at > 0 else 0.0
        within = (share - before) / (float(self.cumulative[at]) - before)
        root = np.sqrt(within)  # Turk 1990, "Generating Random Points in Triangles"
        normal = np.cross(b - a, c - a)
        return a + root * (1.0 - u[1]) * (b - a) + root * u[1] * (c - a), normal / np.linalg.norm(normal)

    @cached_property
    def _shape(self) -> tuple[Float64Array, float, Float64Array]:
        """Mean point (3,) in object space, radius (m) in world space, and greatest coordinates (3,) in object space.

        Only of triangles that points may be on.
        """
        if self._similar is not None:
            center, radius, greatest = self._similar._shape
            return center, self._scale * radius, greatest
        shares = np.diff(self.cumulative.astype(np.float64), prepend=0.0)
        corners, count = self._slot.triangles.ravel(), len(self._slot.positions)
        weights = np.bincount(corners, np.repeat(shares / 3.0, 3), count).astype(np.float64)
        places = self._slot.positions.astype(np.float64)
        center, places = weights @ places, places[weights > 0.0]
        away = (places - center) @ self._linear.T
        return center, float(np.sqrt((away**2).sum(axis=1).max())), np.abs(places).max(axis=0)

    def _placed(self, positions: Float64Array) -> Float64Array:
        return positions @ self._linear.T + self._translation
