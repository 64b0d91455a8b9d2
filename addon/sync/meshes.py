# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluated Blender meshes as indexed triangle meshes.

Reading and building are apart: what is read is compared with what was read last time, array by array, and a mesh
is built anew only when something differs. Blender's own update flags over-report and are not asked.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene import Mesh, SlotRange
from ..scene.arrays import BoolArray, Float32Array, Int32Array, UInt32Array, same_array
from .changes import new_version

if TYPE_CHECKING:
    import bpy

_AREA_CHUNK = 32768
_MOVING = {"positions", "normals", "velocities"}
"""What may differ in a mesh that merely moves."""


@dataclass(frozen=True)
class RawMesh:
    """Blender's arrays, as read; equal ones give equal meshes.

    `positions` (P, 3) float32. `corner_points` (C,) int32. `triangle_corners` (T, 3) int32.
    `normals` float32: (P, 3) if `by_points`, else (C, 3). `triangle_slots` (T,) int32 or None where all are 0.
    `uvs` (C, 2) float32. `colors` float32: (P, 4) if `by_points`, else (C, 4).
    `velocities` (P, 3) float32, metres per frame.
    """

    by_points: bool
    positions: Float32Array
    corner_points: Int32Array
    triangle_corners: Int32Array
    normals: Float32Array
    triangle_slots: Int32Array | None
    uvs: Float32Array | None
    colors: Float32Array | None
    velocities: Float32Array | None

    def changed_fields(self, other: RawMesh) -> set[str]:
        """Names of the arrays that differ."""
        changed = {
            field.name
            for field in fields(self)
            if field.name != "by_points" and not same_array(getattr(self, field.name), getattr(other, field.name))
        }
        return changed if self.by_points == other.by_points else changed | {"by_points"}


@dataclass(frozen=True)
class MeshRecord:
    """A mirrored mesh, what it was built from, and what is wrong with it (complete sentences)."""

    raw: RawMesh
    mesh: Mesh
    warnings: tuple[str, ...]


def update_mesh(
    key: str,
    name: str,
    mesh: bpy.types.Mesh,
    colour_attribute: str | None,
    frames_per_second: float,
    previous: MeshRecord | None,
) -> MeshRecord:
    """The record of an evaluated mesh: `previous` itself where nothing changed, whatever `name` is by now.

    `colour_attribute` names the one that the object's materials read; None takes the mesh's own choice.
    `frames_per_second` turns Blender's velocities, per second, into those of the scene.
    """
    raw = _read(mesh, colour_attribute, frames_per_second)
    if previous is not None:
        changed = raw.changed_fields(previous.raw)
        if not changed:
            return previous
        if changed <= _MOVING and not previous.warnings and np.isfinite(raw.positions).all():
            return MeshRecord(raw, _moved(raw, previous.mesh), ())
    return _build(key, name, raw)


def _read(mesh: bpy.types.Mesh, colour_attribute: str | None, frames_per_second: float) -> RawMesh:
    uvs = _read_uvs(mesh)
    attribute = _find_colour_attribute(mesh, colour_attribute)
    by_points = mesh.normals_domain == "POINT" and uvs is None and (attribute is None or attribute.domain == "POINT")
    corner_points = _read_attribute(mesh, ".corner_vert", "value", np.int32, len(mesh.loops))
    colors = _read_colors(attribute, corner_points, by_points)
    normal_source = mesh.vertex_normals if by_points else mesh.corner_normals
    normals = np.empty(len(normal_source) * 3, np.float32)
    normal_source.foreach_get("vector", normals)
    normals = normals.reshape(-1, 3)
    if mesh.has_custom_normals:  # Blender takes them as they were stored
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        np.divide(normals, lengths, out=normals, where=lengths > 0.0)
    return RawMesh(
        by_points=by_points,
        positions=_read_attribute(mesh, "position", "vector", np.float32, len(mesh.vertices) * 3).reshape(-1, 3),
        corner_points=corner_points,
        triangle_corners=_read_triangle_corners(mesh),
        normals=normals,
        triangle_slots=_read_triangle_slots(mesh),
        uvs=uvs,
        colors=colors,
        velocities=_read_velocities(mesh, frames_per_second),
    )


def _read_attribute(mesh: Any, name: str, member: str, dtype: type, length: int) -> Any:
    values = np.empty(length, dtype)
    if length:
        mesh.attributes[name].data.foreach_get(member, values)
    return values


def _read_uvs(mesh: bpy.types.Mesh) -> Float32Array | None:
    layer = next((layer for layer in mesh.uv_layers if layer.active_render), None)
    if layer is None or not len(mesh.loops):
        return None
    uvs = np.empty(len(mesh.loops) * 2, np.float32)
    layer.uv.foreach_get("vector", uvs)
    return uvs.reshape(-1, 2)


def _find_colour_attribute(mesh: bpy.types.Mesh, name: str | None) -> Any:
    attributes: Any = mesh.color_attributes
    if name and name in attributes:
        return attributes[name]
    index = attributes.render_color_index
    return attributes[index] if 0 <= index < len(attributes) else None


def _read_colors(attribute: Any, corner_points: Int32Array, by_points: bool) -> Float32Array | None:
    if attribute is None or not len(attribute.data):
        return None
    colors = np.empty(len(attribute.data) * 4, np.float32)
    attribute.data.foreach_get("color", colors)  # linear for byte attributes too
    colors = colors.reshape(-1, 4)
    return colors[corner_points] if attribute.domain == "POINT" and not by_points else colors


def _read_velocities(mesh: bpy.types.Mesh, frames_per_second: float) -> Float32Array | None:
    """Per frame, from the attribute that simulations and caches write, per second; None where it is something else."""
    attribute: Any = mesh.attributes.get("velocity")
    if attribute is None or attribute.domain != "POINT" or attribute.data_type != "FLOAT_VECTOR":
        return None
    velocities = _read_attribute(mesh, "velocity", "vector", np.float32, len(mesh.vertices) * 3).reshape(-1, 3)
    velocities /= np.float32(frames_per_second)
    return velocities


def _read_triangle_slots(mesh: bpy.types.Mesh) -> Int32Array | None:
    if "material_index" not in mesh.attributes:
        return None
    polygon_slots = _read_attribute(mesh, "material_index", "value", np.int32, len(mesh.polygons))
    if not polygon_slots.any():
        return None
    polygons = np.empty(len(mesh.loop_triangles), np.int32)
    mesh.loop_triangle_polygons.foreach_get("value", polygons)
    return polygon_slots[polygons]


def _read_triangle_corners(mesh: bpy.types.Mesh) -> Int32Array:
    """Blender's triangulation, copied in one go from its own array.

    The pointer is outside Blender's documented interface: stride, first and last row are compared with the
    documented access each time, which also serves as the (80 times slower) fallback.
    """
    triangles = mesh.loop_triangles
    count = len(triangles)
    if count == 0:
        return np.empty((0, 3), np.int32)
    first, last = triangles[0], triangles[count - 1]
    address = first.as_pointer()
    if last.as_pointer() - address == (count - 1) * 12:
        corners = np.empty((count, 3), np.int32)
        ctypes.memmove(corners.ctypes.data, address, corners.nbytes)
        if tuple(corners[0]) == tuple(first.loops) and tuple(corners[-1]) == tuple(last.loops):
            return corners
    corners = np.empty(count * 3, np.int32)
    triangles.foreach_get("loops", corners)
    return corners.reshape(-1, 3)


def _moved(raw: RawMesh, previous: Mesh) -> Mesh:
    """`previous` with new positions, normals and velocities; everything else stays the very same array."""
    return Mesh(
        key=previous.key,
        name=previous.name,
        version=new_version(),
        positions=raw.positions if raw.by_points else raw.positions[raw.corner_points],
        normals=_finite_or_zero(raw.normals),
        triangles=previous.triangles,
        slots=previous.slots,
        uvs=previous.uvs,
        colors=previous.colors,
        velocities=_velocities(raw),
    )


def _build(key: str, name: str, raw: RawMesh) -> MeshRecord:
    warnings: list[str] = []
    positions, corner_points = raw.positions, raw.corner_points
    triangles = corner_points[raw.triangle_corners] if raw.by_points else raw.triangle_corners
    if not raw.by_points:
        positions = positions[corner_points]
    finite = np.asarray(np.isfinite(positions).all(axis=1))
    if not finite.all():
        positions = np.where(finite[:, None], positions, np.float32(0.0))
        broken = int(len(raw.positions) - np.isfinite(raw.positions).all(axis=1).sum())
        warnings.append(f"Mesh “{name}” has {broken} vertices that are not finite numbers; their faces are left out.")
    drawn = _drawable(positions, triangles, finite, name, warnings)
    slots = raw.triangle_slots
    if not drawn.all():
        triangles = triangles[drawn]
        slots = None if slots is None else slots[drawn]
    triangles, ranges = _group_by_slot(triangles.astype(np.uint32), slots)
    mesh = Mesh(
        key=key,
        name=name,
        version=new_version(),
        positions=positions,
        normals=_finite_or_zero(raw.normals),
        triangles=triangles,
        slots=ranges,
        uvs=None if raw.uvs is None else _finite_or_zero(raw.uvs),
        colors=None if raw.colors is None else _finite_or_zero(raw.colors),
        velocities=_velocities(raw),
    )
    return MeshRecord(raw, mesh, tuple(warnings))


def _velocities(raw: RawMesh) -> Float32Array | None:
    """Velocities of the mesh's vertices, finite."""
    if raw.velocities is None:
        return None
    return _finite_or_zero(raw.velocities if raw.by_points else raw.velocities[raw.corner_points])


def _finite_or_zero(values: Float32Array) -> Float32Array:
    finite = np.isfinite(values)
    return values if finite.all() else np.where(finite, values, np.float32(0.0))


def _drawable(
    positions: Float32Array, triangles: Int32Array, finite: BoolArray, name: str, warnings: list[str]
) -> BoolArray:
    """(T,) which triangles have finite corners and an area; says in `warnings` how many have none."""
    drawn = np.empty(len(triangles), np.bool_)
    x, y, z = (np.ascontiguousarray(positions[:, axis]) for axis in range(3))
    for start in range(0, len(triangles), _AREA_CHUNK):  # chunks stay in the cache
        drawn[start : start + _AREA_CHUNK] = _has_area(x, y, z, triangles[start : start + _AREA_CHUNK])
    all_finite = bool(finite.all())
    with_finite_corners = np.ones(len(triangles), np.bool_) if all_finite else finite[triangles].all(axis=1)
    flat = int((~drawn & with_finite_corners).sum())
    if flat:
        warnings.append(f"Mesh “{name}” has {flat} triangles without area; they are left out.")
    return drawn & with_finite_corners


def _has_area(x: Float32Array, y: Float32Array, z: Float32Array, triangles: Int32Array) -> BoolArray:
    """(T,) whether two edges of each triangle are not parallel, by exact comparison: anything more is the
    rasteriser's business. Corners are read axis by axis, which is several times faster than row by row."""
    first, second, third = (np.ascontiguousarray(triangles[:, corner]) for corner in range(3))
    with np.errstate(over="ignore", invalid="ignore"):
        edge1 = tuple(axis[second] - axis[first] for axis in (x, y, z))
        edge2 = tuple(axis[third] - axis[first] for axis in (x, y, z))
        return (
            (edge1[1] * edge2[2] != edge1[2] * edge2[1])
            | (edge1[2] * edge2[0] != edge1[0] * edge2[2])
            | (edge1[0] * edge2[1] != edge1[1] * edge2[0])
        )


def _group_by_slot(triangles: UInt32Array, slots: Int32Array | None) -> tuple[UInt32Array, tuple[SlotRange, ...]]:
    """Triangles in the order of their slots (stable), and the range of each slot that has any."""
    if len(triangles) == 0:
        return triangles, ()
    if slots is None:
        return triangles, (SlotRange(0, 0, len(triangles)),)
    slots = np.maximum(slots, 0)
    if (slots[1:] < slots[:-1]).any():
        order = np.argsort(slots, kind="stable")
        triangles, slots = triangles[order], slots[order]
    numbers, first, counts = np.unique(slots, return_index=True, return_counts=True)
    ranges = (SlotRange(int(n), int(f), int(c)) for n, f, c in zip(numbers, first, counts, strict=True))
    return triangles, tuple(ranges)
