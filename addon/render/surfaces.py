# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles as surfaces that points are drawn from. Pure: no OpenGL, no Blender."""

from bisect import bisect_right
from functools import cached_property

import numpy as np

from ..scene import Mesh, SlotRange
from ..scene.arrays import Float32Array, Float64Array

_BELOW_ONE = float(np.nextafter(1.0, 0.0))

_UNIFORMITY = 1e-6
"""How much the squared scales of a matrix may differ, relatively, where areas are those of the mesh times one of them."""

_ROUNDINGS = 64.0
"""Roundings of float32 that separate a point from where the GPU puts its triangle: a sum of four products has 7, and
light that leaves at a grazing angle meets a displaced triangle several times as far away."""


class SlotSurface:
    """The triangles (T, 3) of one slot of a mesh: rows of its `positions` (V, 3) float64, object space."""

    def __init__(self, mesh: Mesh, slot: SlotRange) -> None:
        self.triangles = mesh.triangles[slot.first : slot.first + slot.count]
        self._mesh = mesh

    @property
    def positions(self) -> Float32Array:
        """(V, 3) of the whole mesh."""
        return self._mesh.positions

    def areas(self, linear: Float64Array) -> Float64Array:
        """(T,) m², where a matrix (3, 3) places them."""
        places = self.positions.astype(np.float64) @ linear.T
        first = places[self.triangles[:, 0]]
        (ax, ay, az), (bx, by, bz) = ((places[self.triangles[:, corner]] - first).T for corner in (1, 2))
        return 0.5 * np.sqrt((ay * bz - az * by) ** 2 + (az * bx - ax * bz) ** 2 + (ax * by - ay * bx) ** 2)

    @cached_property
    def whole(self) -> tuple[float, Float32Array]:
        """Area in object space, and the share (T,) of it up to and including each triangle."""
        return _shares(self.areas(np.eye(3)))


class Surface:
    """A slot's triangles where `matrix` (4, 4), world-from-object, places them. Works out only what it is asked for."""

    def __init__(self, slot: SlotSurface, matrix: Float64Array) -> None:
        self._slot = slot
        self._linear, self._translation = matrix[:3, :3], matrix[:3, 3]
        self._mirrored = bool(np.linalg.det(self._linear) < 0.0)

    @cached_property
    def area(self) -> float:
        """m²."""
        if self._squared_scale is not None:
            return self._squared_scale * self._slot.whole[0]
        return float(self._slot.areas(self._linear).sum())

    @cached_property
    def cumulative(self) -> Float32Array:
        """(T,) share of the area up to and including each triangle."""
        if self._squared_scale is not None:
            return self._slot.whole[1]
        return _shares(self._slot.areas(self._linear))[1]

    @cached_property
    def center(self) -> Float64Array:
        """(3,) the mean point of its surface, world space."""
        return self._placed(self._weights @ self._slot.positions.astype(np.float64))

    @cached_property
    def radius(self) -> float:
        """Of the ball about its centre that holds it, m."""
        return float(np.linalg.norm(self._placed(self._corners) - self.center, axis=-1).max())

    @cached_property
    def rounding(self) -> float:
        """How far (m) from a point of it the GPU, which has float32 only, may find the triangle that it lies on.

        `_ROUNDINGS` of the products that place it about its object's origin: coordinates times matrix entries.
        """
        products = np.abs(self._linear) @ np.abs(self._corners).max(axis=0)
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
    def _squared_scale(self) -> float | None:
        """None where directions are scaled differently."""
        squared = self._linear.T @ self._linear
        scale = float(np.trace(squared)) / 3.0
        return scale if np.abs(squared - scale * np.eye(3)).max() <= _UNIFORMITY * scale else None

    @cached_property
    def _weights(self) -> Float64Array:
        """(V,) share of each vertex in the mean point; 0 where no triangle that has it is ever drawn from."""
        shares = np.diff(self.cumulative.astype(np.float64), prepend=0.0)
        return np.bincount(
            self._slot.triangles.ravel(), np.repeat(shares / 3.0, 3), minlength=len(self._slot.positions)
        )

    @property
    def _corners(self) -> Float64Array:
        """(N, 3) the vertices that it has, object space."""
        return self._slot.positions[self._weights > 0.0].astype(np.float64)

    def _placed(self, positions: Float64Array) -> Float64Array:
        return positions @ self._linear.T + self._translation


def _shares(areas: Float64Array) -> tuple[float, Float32Array]:
    """The sum of areas (T,), and the share of it up to and including each."""
    cumulative = np.cumsum(areas)
    total = float(cumulative[-1]) if len(cumulative) else 0.0
    return total, (cumulative / (total or 1.0)).astype(np.float32)
