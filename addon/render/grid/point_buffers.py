# SPDX-License-Identifier: GPL-3.0-or-later
"""The points of the scene's meshes on the GPU, for as long as what they lie on is there."""

from dataclasses import dataclass
from math import ceil, log2

import moderngl
import numpy as np

from ...scene import Mesh, Scene
from ...scene.arrays import Float64Array
from ..device import Device
from ..draws import Draw
from .levels import GridLevel
from .points import POINTS_PER_CELL, SurfacePoints, surface_points

_DENSITIES_PER_OCTAVE = 32
_ROUNDING = 1e-3
"""Steps: what float32 makes of a turned matrix (1e-7, times the steps per octave) must not be another density."""

_Key = tuple[str, int, int, float, bytes | None]
"""Mesh, its version, where its slot begins, points per m², and what of object space they are from."""


@dataclass
class PointBuffers:
    """Points of one slot of a mesh on the GPU, and what moderngl binds them as. `area` (m²): what each stands for."""

    count: int
    area: float
    attributes: list[tuple[moderngl.Buffer, str, str]]

    def release(self) -> None:
        """Free them."""
        for buffer, _, _ in self.attributes:
            buffer.release()


class PointCache:
    """Points of all that a grid holds."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._held: dict[_Key, PointBuffers] = {}
        self._used: set[_Key] = set()

    def of(self, scene: Scene, draw: Draw, level: GridLevel) -> PointBuffers | None:
        """Points that are dense enough for a level; None where there are none."""
        key = _key(scene, draw, level)
        self._used.add(key)
        if key not in self._held:
            mesh = scene.meshes[draw.batch.mesh]
            slot = next(slot for slot in mesh.slots if 3 * slot.first == draw.first_index)
            box = _object_box(mesh, draw.batch.matrices, level)
            self._held[key] = self._upload(surface_points(mesh, slot, _density(draw, level), box))
        points = self._held[key]
        return points if points.count else None

    def tidy(self, scene: Scene) -> None:
        """Free the points of meshes that are gone, and of those that were asked for since the last time all others."""
        slots = {(mesh.key, mesh.version, 3 * slot.first) for mesh in scene.meshes.values() for slot in mesh.slots}
        asked = {key[:3] for key in self._used}
        for key in [key for key in self._held if key not in self._used]:
            if key[:3] in asked or key[:3] not in slots:
                self._held.pop(key).release()
        self._used = set()

    def release(self) -> None:
        """Free everything."""
        for points in self._held.values():
            points.release()
        self._held.clear()

    def _upload(self, points: SurfacePoints) -> PointBuffers:
        arrays = (
            (points.positions, "3f", "in_position"),
            (points.normals, "3f", "in_normal"),
            (points.uvs, "2f", "in_uv"),
            (points.uv_scale, "1f", "in_uv_scale"),
            (points.colors, "4f", "in_color"),
            (points.reaches[:, 0], "4f1", "in_reach_low"),
            (points.reaches[:, 1], "4f1", "in_reach_high"),
        )
        if points.count == 0:
            return PointBuffers(0, 0.0, [])
        context = self._device.context
        held = [
            (context.buffer(np.ascontiguousarray(array)), layout, name)
            for array, layout, name in arrays
            if array is not None
        ]
        size = sum(buffer.size for buffer, _, _ in held)
        self._device.check_upload("points for the radiance grid", size)
        return PointBuffers(points.count, points.area, held)


def _key(scene: Scene, draw: Draw, level: GridLevel) -> _Key:
    mesh = scene.meshes[draw.batch.mesh]
    box = _object_box(mesh, draw.batch.matrices, level)
    return mesh.key, mesh.version, draw.first_index, _density(draw, level), None if box is None else box.tobytes()


def _density(draw: Draw, level: GridLevel) -> float:
    """Points per m² of object space: enough where an instance is largest. Rounded up: not another for every turn."""
    largest_scale = float(np.linalg.norm(draw.batch.matrices[:, :3, :3], axis=1).max())
    if not (largest_scale > 0.0 and np.isfinite(largest_scale)):
        return POINTS_PER_CELL / level.cell**2
    steps = ceil(_DENSITIES_PER_OCTAVE * log2(largest_scale / level.cell) - _ROUNDING)
    return POINTS_PER_CELL * 2.0 ** (2.0 * steps / _DENSITIES_PER_OCTAVE)


def _object_box(mesh: Mesh, matrices: Float64Array, level: GridLevel) -> Float64Array | None:
    """(2, 3) what of object space a level holds of a mesh's only instance; None where all of the mesh is needed."""
    if len(matrices) > 1:
        return None
    bounds = level.bounds
    inverse = np.linalg.pinv(matrices[0, :3, :3])
    corners = np.stack(np.meshgrid(*bounds.T, indexing="ij"), axis=-1).reshape(-1, 3) - matrices[0, :3, 3]
    placed = corners @ inverse.T
    low, high = placed.min(axis=0), placed.max(axis=0)
    if (mesh.bounds[0] >= low).all() and (mesh.bounds[1] <= high).all():
        return None
    return np.stack([low, high])
