# SPDX-License-Identifier: GPL-3.0-or-later
"""A float64 ray caster that answers what the layers of a deep G-buffer must hold, and where float32 cannot know.

It shares nothing with the renderer but the scene contract: every pixel centre's ray is intersected with every
triangle, the hits are sorted, and layers are selected greedily: Z(0) is the nearest hit, Z(k+1) the nearest one with
z > Z(k) + Δz. The exit surface of layer k is the nearest back face with z > Z(k) + 4 ulp, whatever Δz is.

Where the answer may depend on rounding, the pixel is `ambiguous`. With u = 2⁻²⁴ and s sub-pixel bits:

* A vertex p of an instance reaches camera space by dot products of four terms, so each coordinate is off by at most
  e = K·u·(|M|·|p|), K = 8 (four roundings for the object's matrix, four for the projection).
* On the screen it is off by δ = 2⁻ˢ (snapping to the sub-pixel grid) + F·e/z·(1 + |x|/z) + K·u·|pixel coordinate|,
  F pixels per unit of image plane. Points of an edge move no further than its ends, so whether a pixel centre
  farther than δ from every edge is covered is certain.
* The depth of the triangle's plane at a pixel centre is off by at most e + |∂z/∂pixel|·δ, plus the rounding of the
  interpolation, K·u·z·(1 + c), where c = (z_max / z_min)·L² / 2A is the conditioning of the plane equation
  (L longest side, A area, in pixels).
* A test z > threshold is certain where z is farther from it than the tolerances of both together. The same holds
  between the two nearest hits, and for the clip distances.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from addon.scene import Camera, Scene

UNIT_ROUNDOFF = 2.0**-24
ROUNDINGS = 8.0

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class LayerReference:
    """`depth` (n, H, W), +inf where empty; `tolerance` (n, H, W) of those depths; `owner` (n, H, W) int: pass index
    of the instance hit, 0 where empty; `normal` (n, H, W, 3) geometric, of either sign; `triangle` (n, H, W) int:
    position in `camera_triangles`, −1 where empty; `ambiguous` (H, W). `exits`: the same of the exit surfaces, or None
    of such; ambiguous as well where the layers are."""

    depth: Floats
    tolerance: Floats
    owner: NDArray[np.int64]
    normal: Floats
    triangle: NDArray[np.int64]
    ambiguous: Bools
    exits: "LayerReference | None" = None


@dataclass(frozen=True)
class _Hits:
    """All triangles against all pixels: `depth` (T, P), +inf where missed; `tolerance` (T, P); `unsure` (P,) where
    coverage or clipping may go either way; `owner` (T,) pass indices; `normal` (T, 3) in world space; `triangle` (T,)
    positions in `camera_triangles`; `back` (T,) whether the viewer sees the back."""

    depth: Floats
    tolerance: Floats
    unsure: Bools
    owner: NDArray[np.int64]
    normal: Floats
    triangle: NDArray[np.int64]
    back: Bools


class _Selection:
    """Which hit each layer takes at each pixel, row by row."""

    def __init__(self, hits: _Hits, layers: int) -> None:
        self.hits, self.pixels = hits, np.arange(hits.unsure.size)
        shape = (layers, hits.unsure.size)
        self.depth, self.tolerance = np.full(shape, np.inf), np.zeros(shape)
        self.owner, self.triangle = np.zeros(shape, np.int64), np.full(shape, -1)
        self.normal = np.zeros((*shape, 3))

    def take(self, layer: int, depths: Floats) -> tuple[NDArray[np.int64], Bools]:
        """Put the nearest of `depths` (T, P) into a layer; returns its triangles (P,) and whether there is one (P,).

        The second result also tells where another one is as near, as far as rounding goes.
        """
        chosen = depths.argmin(axis=0)
        nearest, error = depths[chosen, self.pixels], self.hits.tolerance[chosen, self.pixels]
        found = np.isfinite(nearest)
        self.depth[layer], self.tolerance[layer] = nearest, np.where(found, error, 0.0)
        self.owner[layer] = np.where(found, self.hits.owner[chosen], 0)
        self.triangle[layer] = np.where(found, self.hits.triangle[chosen], -1)
        self.normal[layer] = np.where(found[:, None], self.hits.normal[chosen], 0.0)
        others = depths.copy()
        others[chosen, self.pixels] = np.inf
        return chosen, _any_within(others, nearest, self.hits.tolerance + error) & found

    def reference(self, size: tuple[int, int], ambiguous: Bools, exits: LayerReference | None) -> LayerReference:
        """All layers as pictures."""
        shape = (len(self.depth), size[1], size[0])
        return LayerReference(
            self.depth.reshape(shape),
            self.tolerance.reshape(shape),
            self.owner.reshape(shape),
            self.normal.reshape(*shape, 3),
            self.triangle.reshape(shape),
            ambiguous.reshape(shape[1:]),
            exits,
        )


@dataclass(frozen=True)
class _Pixels:
    """Pixel centres: `window` (P, 2) on the image plane, `raster` (P, 2) in pixels; `scale` (2,) pixels per unit."""

    window: Floats
    raster: Floats
    scale: Floats
    origin: Floats


def raycast_layers(
    scene: Scene, camera: Camera, size: tuple[int, int], layers: int, separation: float, *, subpixel_bits: int
) -> LayerReference:
    """The layers of `scene` through the pixel centres of a picture of `size` (width, height), row 0 at the bottom."""
    hits = _intersect(scene, camera, *size, subpixel_bits)
    ambiguous = hits.unsure.copy()
    selection, exits = _Selection(hits, layers), _Selection(hits, layers)
    remaining = hits.depth.copy()
    exits_ambiguous = np.zeros_like(ambiguous)
    for layer in range(layers if len(remaining) else 0):
        chosen, tied = selection.take(layer, remaining)
        depth, error = selection.depth[layer], selection.tolerance[layer]
        found = np.isfinite(depth)
        remaining[chosen, selection.pixels] = np.inf
        threshold = depth + separation
        tied |= _any_within(remaining, threshold, hits.tolerance + error + UNIT_ROUNDOFF * threshold) & found
        ambiguous |= tied
        exits_ambiguous |= _take_exits(exits, layer, chosen, depth, error)
        remaining[remaining <= threshold] = np.inf
    return selection.reference(size, ambiguous, exits.reference(size, ambiguous | exits_ambiguous, None))


def _take_exits(exits: _Selection, layer: int, chosen: NDArray[np.int64], depth: Floats, error: Floats) -> Bools:
    """Select the back faces behind a layer's `depth` (P,), which triangles `chosen` (P,) have; (P,) where unsure."""
    found = np.isfinite(depth)
    behind = np.where(exits.hits.back[:, None] & found, exits.hits.depth, np.inf)
    behind[chosen, exits.pixels] = np.inf
    guard = 8.0 * UNIT_ROUNDOFF * depth
    unsure = _any_within(behind, depth, exits.hits.tolerance + error + np.where(found, guard, 0.0))
    behind[behind <= depth + guard] = np.inf
    return unsure | exits.take(layer, behind)[1]


def _any_within(values: Floats, center: Floats, tolerance: Floats) -> Bools:
    """(P,) whether any finite one of `values` (T, P) lies within `tolerance` of `center` (P,)."""
    finite = np.isfinite(values) & np.isfinite(center)
    distance = np.full(values.shape, np.inf)
    np.subtract(values, center, out=distance, where=finite)
    return (np.abs(distance) <= tolerance).any(axis=0)


def _intersect(scene: Scene, camera: Camera, width: int, height: int, subpixel_bits: int) -> _Hits:
    pixels = _pixel_centres(camera, width, height)
    count = width * height
    depths, tolerances, owners, normals, triangles, backs = [], [], [], [], [], []
    unsure = np.zeros(count, bool)
    for number, (corners, error, index, handedness) in enumerate(camera_triangles(scene, camera)):
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        length = np.linalg.norm(normal)
        if length == 0.0:
            continue
        polygon = _clip_near(corners, camera.clip_start)
        if not polygon.size:
            continue
        depth, slope = _plane_depth(corners[0], normal, camera, pixels)
        screen, shift = _project(polygon, error, camera, pixels, subpixel_bits)
        interpolation = ROUNDINGS * UNIT_ROUNDOFF * (1.0 + _conditioning(screen, polygon))
        tolerance = error + slope * shift + interpolation * np.abs(depth)
        unsure |= _near_edge(screen, shift, pixels.raster)
        inside = _inside(corners, camera, pixels.window) & np.isfinite(depth)
        for clip in (camera.clip_start, camera.clip_end):
            unsure |= inside & (np.abs(depth - clip) <= tolerance)
        inside &= (depth >= camera.clip_start) & (depth <= camera.clip_end)
        depths.append(np.where(inside, depth, np.inf))
        tolerances.append(np.where(inside, tolerance, 0.0))
        owners.append(index)
        normals.append(camera.rotation @ (normal / length * (1.0, 1.0, -1.0)))
        triangles.append(number)
        # With depth as z, space is mirrored: the cross product of a front face's sides points away from the viewer.
        backs.append(handedness * (normal[2] if camera.orthographic else normal @ corners[0]) < 0.0)
    return _Hits(
        np.array(depths).reshape(-1, count),
        np.array(tolerances).reshape(-1, count),
        unsure,
        np.array(owners, np.int64),
        np.array(normals).reshape(-1, 3),
        np.array(triangles, np.int64),
        np.array(backs, bool),
    )


def _pixel_centres(camera: Camera, width: int, height: int) -> _Pixels:
    left, right, bottom, top = camera.window
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    raster = np.stack([column.ravel(), row.ravel()], axis=-1)
    scale = np.array([width / (right - left), height / (top - bottom)])
    origin = np.array([left, bottom])
    return _Pixels(origin + raster / scale, raster, scale, origin)


def camera_triangles(scene: Scene, camera: Camera) -> Iterator[tuple[Floats, float, int, float]]:
    """Yields ((3, 3) corners in camera space with positive depth as z, vertex error e (m), pass index, handedness).

    Handedness is −1 where the instance is mirrored, which turns clockwise triangles into front faces.
    """
    camera_from_world = np.eye(4)
    camera_from_world[:3, :3] = camera.rotation.T
    for batch in scene.batches:
        mesh = scene.meshes[batch.mesh]
        positions = np.concatenate([mesh.positions.astype(np.float64), np.ones((len(mesh.positions), 1))], axis=1)
        for matrix, index in zip(batch.matrices, batch.object_index, strict=True):
            relative = matrix.copy()
            relative[:3, 3] -= camera.position
            camera_from_object = (camera_from_world @ relative)[:3]
            corners = positions @ camera_from_object.T * (1.0, 1.0, -1.0)
            handedness = -1.0 if np.linalg.det(matrix[:3, :3]) < 0.0 else 1.0
            error = ROUNDINGS * UNIT_ROUNDOFF * (np.abs(positions) @ np.abs(camera_from_object).T).max(axis=1)
            for triangle in mesh.triangles:
                yield corners[triangle], error[triangle].max(), int(index), handedness


def _clip_near(corners: Floats, near: float) -> Floats:
    """The part of a triangle at depth ≥ `near`: (n, 3) polygon, n = 0, 3 or 4."""
    polygon = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if start[2] >= near:
            polygon.append(start)
        if (start[2] >= near) != (end[2] >= near):
            polygon.append(start + (end - start) * ((near - start[2]) / (end[2] - start[2])))
    return np.array(polygon)


def _plane_depth(corner: Floats, normal: Floats, camera: Camera, pixels: _Pixels) -> tuple[Floats, Floats]:
    """View depth (P,) of a plane at the pixel centres and its largest change per pixel (P,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        if camera.orthographic:
            depth = (normal @ corner - pixels.window @ normal[:2]) / normal[2]
            gradient = np.abs(normal[:2] / normal[2] / pixels.scale).sum()
            return depth, np.full(len(depth), gradient)
        along = pixels.window @ normal[:2] + normal[2]
        depth = (normal @ corner) / along
        return depth, np.abs(depth / along) * np.abs(normal[:2] / pixels.scale).sum()


def _project(
    polygon: Floats, error: float, camera: Camera, pixels: _Pixels, subpixel_bits: int
) -> tuple[Floats, float]:
    """Corners in pixels (n, 2) and how far rounding may move them, δ."""
    if camera.orthographic:
        plane, spread = polygon[:, :2], np.full(len(polygon), error)
    else:
        plane = polygon[:, :2] / polygon[:, 2:]
        spread = error / polygon[:, 2] * (1.0 + np.abs(plane).max(axis=1))
    screen = (plane - pixels.origin) * pixels.scale
    rounding = ROUNDINGS * UNIT_ROUNDOFF * np.abs(screen).max(axis=1)
    return screen, float((2.0**-subpixel_bits + spread * pixels.scale.max() + rounding).max())


def _conditioning(screen: Floats, polygon: Floats) -> float:
    sides = np.roll(screen, -1, axis=0) - screen
    fan = screen[1:] - screen[0]
    area = np.abs(fan[:-1, 0] * fan[1:, 1] - fan[:-1, 1] * fan[1:, 0]).sum()
    longest = (sides**2).sum(axis=1).max()
    return polygon[:, 2].max() / polygon[:, 2].min() * longest / max(area, np.finfo(np.float64).tiny)


def _near_edge(screen: Floats, shift: float, raster: Floats) -> Bools:
    """(P,) whether a pixel centre is within `shift` pixels of the polygon's boundary."""
    near = np.zeros(len(raster), bool)
    for start, end in zip(screen, np.roll(screen, -1, axis=0), strict=True):
        side = end - start
        offset = raster - start
        along = np.clip(offset @ side / max(side @ side, np.finfo(np.float64).tiny), 0.0, 1.0)
        near |= ((offset - along[:, None] * side) ** 2).sum(axis=1) <= shift**2
    return near


def _inside(corners: Floats, camera: Camera, window: Floats) -> Bools:
    """(P,) whether the ray (both directions) through a pixel centre meets the triangle, by three edge functions."""
    following = np.roll(corners, -1, axis=0)
    if camera.orthographic:
        sides = following[:, :2] - corners[:, :2]
        offset = window[None] - corners[:, None, :2]
        edges = sides[:, None, 0] * offset[..., 1] - sides[:, None, 1] * offset[..., 0]
    else:
        planes = np.cross(corners, following)
        edges = window @ planes[:, :2].T + planes[:, 2]
        edges = edges.T
    return (edges >= 0.0).all(axis=0) | (edges <= 0.0).all(axis=0)
