# SPDX-License-Identifier: GPL-3.0-or-later
"""What shadow maps a light needs for what the camera sees: which way they look, how far and how finely."""

from dataclasses import dataclass
from functools import cache
from math import ceil, floor, log, log2, pi, tan

import numpy as np

from ..scene import Camera
from ..scene.arrays import Float64Array, Int64Array
from .receivers import FACE_AXES, SIDE_OF_FACE, SIDES, Receivers

SMALLEST_SIZE = 32
WIDEST_SINGLE = pi / 3.0
"""Half angle (rad) of the widest cone that one map covers; wider ones take the faces of a cube."""

_SMALL_SHARE = 0.5
"""Share of its width below which a map shows only what is seen, not all that the light shines on: otherwise it need not
be drawn again when the camera moves."""

NARROWEST = 1e-3
"""Half angle (rad) of the narrowest cone that a map is drawn for."""

MOST_CASCADES = 4

_FINEST_SHARE = 0.1
"""Share of the tiles that may see their shadow coarser than their pixels: the few nearest would ask for any size."""

_CASCADE_RATIO = 4.0
"""Ratio of view depths of one cascade's ends at most, where a single map would be too coarse."""

_NEAREST_SHARE = 1e-6
"""Near plane of perspective maps over the farthest distance: 1/z in float32 does not mind."""

_ROUNDINGS = 16.0 * float(np.finfo(np.float64).eps)
"""Share of coordinates by which sums of three of them are off at most."""


@dataclass(frozen=True)
class ShadowMap:
    """One map: what its `camera` sees in `size` × `size` texels."""

    camera: Camera
    size: int


@dataclass(frozen=True)
class Fineness:
    """How fine a light's maps are: at most `largest` texels a side; `texels_per_pixel` where that allows it, but texels
    not smaller than `smallest` (m, at a distance of 1 m from a light that is not infinitely far)."""

    largest: int
    texels_per_pixel: float = 1.0
    smallest: float = 0.0


@dataclass(frozen=True)
class Cone:
    """Directions that a light shines in: within `half_angle` (rad) of `axis` (3,); π for all."""

    axis: Float64Array
    half_angle: float


class LocalReceivers:
    """Receivers as one light near them sees them; for all points of the light alike, which is `extent` m about.

    What is nearer to the light than `nearest` m is not in its maps.
    """

    def __init__(
        self,
        receivers: Receivers,
        position: Float64Array,
        extent: float,
        cone: Cone,
        reach: float,
        nearest: float = 0.0,
    ) -> None:
        centers, radii = receivers.balls
        center = centers - position
        radius = radii + extent
        distance = np.sqrt((center**2).sum(axis=1))
        within = distance - radius < reach
        if cone.half_angle < pi:
            cosine = center @ cone.axis / np.maximum(distance, 1e-300)
            angle = np.arccos(np.clip(cosine, -1.0, 1.0))
            slack = np.arcsin(np.clip(radius / np.maximum(distance, 1e-300), 0.0, 1.0))
            within &= (angle < cone.half_angle + slack) | (distance <= radius)
        self._receivers, self._within = receivers, np.flatnonzero(within)
        self._position, self._extent = position, extent
        self._centers, distance, radius = center[self._within], distance[self._within], radius[self._within]
        # How wide a pixel is, seen from the light.
        closest = np.maximum(distance - radius, 0.5 * distance)
        self._pixel_angles = receivers.pixels[self._within] / np.maximum(closest, 1e-12)
        self.farthest = min(float((distance + radius).max(initial=0.0)), reach + extent)
        self._end = _rounded_up(max(self.farthest, 2.0 * nearest, 1e-6))
        self._start = max(nearest, _NEAREST_SHARE * self._end)

    @property
    def any(self) -> bool:
        """Whether the light reaches anything that is seen."""
        return len(self._within) > 0

    @property
    def all(self) -> Int64Array:
        """(P,) the numbers of them."""
        return np.arange(len(self._within))

    def faces(self) -> list[Int64Array]:
        """Six arrays: the numbers of those that each face of a cube about the light may see, in `FACE_AXES`' order."""
        offsets = SIDES @ self._position
        slack = 2.0 * self._extent + _ROUNDINGS * (float(np.abs(offsets).max()) + self.farthest)
        beyond = self._receivers.ends[:, self._within] >= (offsets - slack)[:, None]
        seen = np.logical_and.reduce(beyond[SIDE_OF_FACE], axis=1)
        return [np.flatnonzero(face) for face in seen]

    def map(
        self, point: Float64Array, frame: Float64Array, half: float, fineness: Fineness, seen: Int64Array
    ) -> ShadowMap:
        """What those of them with the numbers `seen` (N,) need of a map from a point of the light.

        `frame` (3, 3): rotation of its camera. `half`: half width, at distance 1, of all that it may show; where they
        fill little of that, it shows no more.
        """
        (x, y), half = self._window(point, frame, half, seen)
        finest = int(_FINEST_SHARE * (len(seen) - 1))
        angle = float(np.partition(self._pixel_angles[seen], finest)[finest]) / fineness.texels_per_pixel
        size = _power_of_two(2.0 * half / max(angle, fineness.smallest, 1e-12), fineness.largest)
        half *= size / (size - 2.0)  # the outermost texels are a margin, so that a lookup beside the edge stays inside
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = frame, point
        return ShadowMap(Camera(pose, (x - half, x + half, y - half, y + half), self._start, self._end), size)

    def _window(
        self, point: Float64Array, frame: Float64Array, half: float, seen: Int64Array
    ) -> tuple[tuple[float, float], float]:
        """Middle and half width, at distance 1, of what is `seen` of a window that is `half` wide.

        In steps, so that it stays the same while the camera moves a little.
        """
        # The corners need no less than the middles between them: where that is too much there is no need to look.
        if _needed(self._centers[seen] - (point - self._position), frame, half) is None:
            return (0.0, 0.0), half
        corners = self._receivers.corners[self._within[seen]] - point
        needed = _needed(corners.reshape(-1, 3), frame, half)
        if needed is None:
            return (0.0, 0.0), half
        middle, width = needed
        step = width / 8.0
        x, y = (step * floor(value / step + 0.5) for value in middle)
        return (x, y), width


def _needed(points: Float64Array, frame: Float64Array, half: float) -> tuple[tuple[float, float], float] | None:
    """Middle and half width at distance 1 of a window that shows points (N, 3) about its camera.

    None where that is hardly less than all of `half`, or where any is beside or behind the camera: it is everywhere.
    """
    x, y, z = frame.T @ points.T
    if z.max() > -1e-9:
        return None
    x, y = x / -z, y / -z
    left, right, low, high = (min(max(float(end), -half), half) for end in (x.min(), x.max(), y.min(), y.max()))
    needed = 0.5 * _rounded_up(1.15 * max(right - left, high - low, 1e-9))
    if needed > _SMALL_SHARE * half:
        return None
    return (0.5 * (left + right), 0.5 * (low + high)), needed


def cone_map(point: Float64Array, cone: Cone, receivers: LocalReceivers, fineness: Fineness) -> ShadowMap:
    """The one map of a light that shines in a narrow cone."""
    half = tan(min(max(cone.half_angle, NARROWEST), WIDEST_SINGLE))
    return receivers.map(point, look_along(cone.axis), half, fineness, receivers.all)


def cube_maps(point: Float64Array, receivers: LocalReceivers, fineness: Fineness) -> tuple[ShadowMap | None, ...]:
    """The six faces of a cube about a light, None where a face sees nothing that is seen."""
    return tuple(
        receivers.map(point, frame, 1.0, fineness, seen) if len(seen) else None
        for frame, seen in zip(_face_frames(), receivers.faces(), strict=True)
    )


def sun_maps(
    direction: Float64Array, receivers: Receivers, casters: Float64Array, fineness: Fineness, cascades: int
) -> tuple[ShadowMap, ...]:
    """Maps of light that comes along `direction` (3,), nearest part of the view first.

    `casters` (K, 2, 3): bounds of what may cast shadows, world space. At most `cascades` maps, which are as large as
    allowed.
    """
    if receivers.count == 0:
        return ()
    frame = look_along(direction)
    whole = _extent(receivers, frame)
    nearest = float(np.quantile(receivers.near, 0.02))
    farthest = float(receivers.far.max())
    pixel = receivers.pixel_size + max(nearest, farthest * 1e-4) * receivers.pixel_slope
    coarseness = whole / (fineness.largest * max(pixel, fineness.smallest, 1e-12))
    count = 1
    if coarseness > 2.0 and receivers.pixel_slope > 0.0:
        count = min(ceil(log(coarseness / 2.0) / log(_CASCADE_RATIO)) + 1, cascades)
    start = max(nearest, farthest * 1e-4)
    ends = [start * (farthest / start) ** ((i + 1) / count) for i in range(count - 1)]
    parts = [receivers.between(low, high) for low, high in zip([0.0, *ends], [*ends, farthest], strict=True)]
    return tuple(_orthographic(part, frame, casters, fineness) for part in parts if part.count)


def look_along(direction: Float64Array) -> Float64Array:
    """(3, 3) rotation whose −Z is a unit direction; without jumps except at one (Duff et al. 2017)."""
    z = -np.asarray(direction, np.float64)
    sign = 1.0 if z[2] >= 0.0 else -1.0
    a = -1.0 / (sign + z[2])
    b = z[0] * z[1] * a
    x = np.array([1.0 + sign * z[0] * z[0] * a, sign * b, -sign * z[0]])
    y = np.array([b, sign + z[1] * z[1] * a, -z[1]])
    return np.stack([x, y, z], axis=1)


@cache
def _face_frames() -> tuple[Float64Array, ...]:
    return tuple(look_along(axis) for axis in FACE_AXES)


def _extent(receivers: Receivers, frame: Float64Array) -> float:
    corners = receivers.corners.reshape(-1, 3) @ frame[:, :2]
    return float((corners.max(axis=0) - corners.min(axis=0)).max())


def _orthographic(receivers: Receivers, frame: Float64Array, casters: Float64Array, fineness: Fineness) -> ShadowMap:
    """One map around receivers. Its place is snapped, so that it stays the same while the camera moves a little."""
    corners = receivers.corners.reshape(-1, 3) @ frame
    low, high = corners.min(axis=0), corners.max(axis=0)
    side = _rounded_up(1.15 * max(float((high - low)[:2].max()), 1e-9))
    step = side / 16.0
    x, y = (step * floor(value / step + 0.5) for value in 0.5 * (low + high)[:2])
    towards = [float(high[2])]  # light space: the light is at +Z
    if len(casters):
        towards.append(float(_greatest(casters, frame[:, 2]).max()))
    depth = _rounded_up(max(towards) - float(low[2]) + 0.05 * side)
    end = step * floor(float(low[2]) / step) - 0.01 * side
    pose = np.eye(4)
    pose[:3, :3] = frame
    pose[:3, 3] = frame @ np.array([x, y, end + depth + step])
    size = _power_of_two(side / max(fineness.smallest, 1e-12), fineness.largest)
    half = 0.5 * side * size / (size - 2.0)  # with the margin of `find_map`
    return ShadowMap(Camera(pose, (-half, half, -half, half), 0.0, depth + step, orthographic=True), size)


def _greatest(bounds: Float64Array, axis: Float64Array) -> Float64Array:
    """Greatest coordinate (K,) of each box along an axis."""
    return np.maximum(bounds[:, 0] * axis, bounds[:, 1] * axis).sum(axis=1)


def _rounded_up(value: float) -> float:
    """To the next of four steps per octave: small changes of what is seen change no map."""
    return 2.0 ** (ceil(4.0 * log2(value)) / 4.0)


def _power_of_two(texels: float, largest: int) -> int:
    return int(min(max(2 ** ceil(log2(max(texels, 1.0))), SMALLEST_SIZE), largest))
