# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes' geometry on the GPU: buffers mirror meshes and batches by version, and only what changed is uploaded."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import moderngl
import numpy as np

from ..scene import InstanceBatch, Mesh, Scene
from ..scene.arrays import Float32Array, Float64Array, Int64Array, UInt32Array
from ..scene.correspondence import Correspondence
from .device import Device, RenderError

MESH_ATTRIBUTES = ("3f", "in_position"), ("3f", "in_normal"), ("2f", "in_uv"), ("4f", "in_color")
INSTANCE_FORMAT = "4f 4f 4f 3f 1i/i"
INSTANCE_ATTRIBUTES = ("in_row_0", "in_row_1", "in_row_2", "in_translation_low", "in_indices")
_INSTANCE_DTYPE = np.dtype([("rows", "f4", (3, 4)), ("translation_low", "f4", 3), ("indices", "i4")])
_POSES_PER_ROW = 1024
_TEXELS_PER_POSE = 4


class MeshBuffers:
    """Vertex and index buffers of one mesh."""

    def __init__(self, context: moderngl.Context, mesh: Mesh) -> None:
        arrays = (mesh.positions, mesh.normals, mesh.uvs, mesh.colors)
        self.positions = mesh.positions
        self.attributes = [
            (context.buffer(np.ascontiguousarray(array, np.float32)), layout, name)
            for array, (layout, name) in zip(arrays, MESH_ATTRIBUTES, strict=True)
            if array is not None
        ]
        self.indices = context.buffer(np.ascontiguousarray(mesh.triangles, np.uint32))
        self.bytes = self.indices.size + sum(buffer.size for buffer, _, _ in self.attributes)

    def release(self) -> None:
        """Free the buffers."""
        self.indices.release()
        for buffer, _, _ in self.attributes:
            buffer.release()


class InstanceBuffer:
    """Per-instance data of one batch."""

    def __init__(self, context: moderngl.Context, batch: InstanceBatch) -> None:
        self.buffer = context.buffer(pack_instances(batch))
        self.bytes = self.buffer.size

    def release(self) -> None:
        """Free the buffer."""
        self.buffer.release()


class PositionBuffer:
    """Where the vertices of a mesh are at another time."""

    def __init__(self, context: moderngl.Context, positions: Float32Array) -> None:
        self.positions = positions  # kept alive: it is known by identity
        self.buffer = context.buffer(np.ascontiguousarray(positions, np.float32))
        self.bytes = self.buffer.size

    def release(self) -> None:
        """Free the buffer."""
        self.buffer.release()


class IndexBuffer:
    """The triangles of a mesh in another order."""

    def __init__(self, context: moderngl.Context, triangles: UInt32Array) -> None:
        self.triangles = triangles  # kept alive: it is known by identity
        self.buffer = context.buffer(np.ascontiguousarray(triangles, np.uint32))
        self.bytes = self.buffer.size

    def release(self) -> None:
        """Free the buffer."""
        self.buffer.release()


class PoseTexture:
    """Where the instances of a batch are at another time: four RGBA32F texels each, three matrix rows and the low parts
    of the translation, in the order of the batch's instance buffer."""

    def __init__(self, context: moderngl.Context, batch: InstanceBatch, matrices: Float64Array) -> None:
        self.matrices = matrices  # kept alive: it is known by identity
        rows, low = _split_poses(matrices[drawing_order(batch)])
        per_row = min(max(batch.count, 1), _POSES_PER_ROW)
        height = max(-(-batch.count // per_row), 1)
        texels = np.zeros((height * per_row, _TEXELS_PER_POSE, 4), np.float32)
        texels[: batch.count, :3] = rows
        texels[: batch.count, 3, :3] = low
        self.texture = context.texture((per_row * _TEXELS_PER_POSE, height), 4, texels, dtype="f4")
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.bytes = texels.nbytes

    def release(self) -> None:
        """Free the texture."""
        self.texture.release()


@dataclass(frozen=True)
class OtherTimes:
    """The other frames that a draw needs to know each vertex's place in: the previous one, and one ahead."""

    previous: Correspondence | None = None
    following: Correspondence | None = None


def split_float64(values: Float64Array) -> tuple[Float32Array, Float32Array]:
    """High and low float32 parts whose exact sum keeps 48 bits of each value.

    Differences taken part by part on the GPU are then as good as a float64 subtraction rounded to float32, so that
    precision near the camera does not depend on where in the world that is, and a camera move uploads nothing.
    """
    high = values.astype(np.float32)
    return high, (values - high).astype(np.float32)


def drawing_order(batch: InstanceBatch) -> Int64Array:
    """The rows (N,) of a batch by what they hold: coincident instances depend neither on who came first nor on ids,
    which are others each time a file is opened."""
    columns = (batch.object_index, *batch.matrices[:, :3, 3].T)
    order = np.lexsort(columns)
    ties = np.all([column[order[1:]] == column[order[:-1]] for column in columns], axis=0)
    if ties.any():
        order = np.lexsort((*batch.matrices[:, :3, :3].reshape(-1, 9).T, *columns))
    return order


def pack_instances(batch: InstanceBatch) -> bytes:
    """Matrix rows, low parts of the translations and indices in drawing order, as the vertex shader reads them."""
    order = drawing_order(batch)
    packed = np.empty(batch.count, _INSTANCE_DTYPE)
    packed["rows"], packed["translation_low"] = _split_poses(batch.matrices[order])
    packed["indices"] = np.clip(batch.object_index[order], 0, 0xFFFF) | batch.link_group << 16
    return packed.tobytes()


def _split_poses(matrices: Float64Array) -> tuple[Float32Array, Float32Array]:
    """(N, 3, 4) rows with the high parts of the translations, and (N, 3) the low parts."""
    rows = matrices[:, :3, :].astype(np.float32)
    rows[:, :, 3], low = split_float64(matrices[:, :3, 3])
    return rows, low


class _Uploaded(Protocol):
    bytes: int

    def release(self) -> None: ...


T = TypeVar("T", bound=_Uploaded)


class _Uploads(Generic[T]):
    """Things on the GPU by key."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._held: dict[Hashable, T] = {}
        self.used: set[Hashable] = set()

    def get(self, key: Hashable, make: Callable[[], T], label: str) -> T:
        """The thing of a key, made where it is not there. Raises RenderError with its label where memory is short."""
        self.used.add(key)
        if key not in self._held:
            made = make()
            try:
                self._device.check_upload(label, made.bytes)
            except RenderError:
                made.release()
                raise
            self._held[key] = made
        return self._held[key]

    def keep(self, keys: set[Hashable]) -> set[Hashable]:
        """Free all others and forget what was used; returns the keys of those that were freed."""
        stale = self._held.keys() - keys
        for key in stale:
            self._held.pop(key).release()
        self.used = set()
        return stale

    def bytes(self) -> int:
        """Bytes of all that is held."""
        return sum(item.bytes for item in self._held.values())


class GeometryStore:
    """GPU mirror of scenes, by key and version: what two frames have in common is there once."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._context = device.context
        self._meshes = _Uploads[MeshBuffers](device)
        self._batches = _Uploads[InstanceBuffer](device)
        self._positions = _Uploads[PositionBuffer](device)
        self._indices = _Uploads[IndexBuffer](device)
        self._poses = _Uploads[PoseTexture](device)
        self._vertex_arrays: dict[tuple[Hashable, ...], moderngl.VertexArray] = {}

    def update(self, scenes: Sequence[Scene]) -> None:
        """Mirror these scenes, and of other times what was drawn since the last update.

        Raises RenderError naming the mesh that graphics memory has no room for.
        """
        meshes = {_mesh_key(mesh) for scene in scenes for mesh in _drawn_meshes(scene)}
        batches = {_batch_key(batch) for scene in scenes for batch in scene.batches}
        self._poses.keep(self._poses.used)
        freed = self._meshes.keep(meshes) | self._batches.keep(batches) | self._positions.keep(self._positions.used)
        freed |= self._indices.keep(self._indices.used)
        self._release_vertex_arrays(freed)
        for scene in scenes:
            for mesh in _drawn_meshes(scene):
                self._mesh(mesh)
            for batch in scene.batches:
                self._batch(batch)

    def vertex_array(
        self,
        scene: Scene,
        batch: InstanceBatch,
        program: moderngl.Program,
        times: OtherTimes,
        copies: int,
        triangles: UInt32Array | None = None,
    ) -> moderngl.VertexArray:
        """The vertex array that draws a batch of a scene with a program, each instance `copies` times in a row.

        `triangles` (T, 3): those of the batch's mesh, in another order than its own.
        """
        mesh = scene.meshes[batch.mesh]
        moved = [
            (other.positions(mesh), name)
            for other, name in ((times.previous, "in_previous_position"), (times.following, "in_next_position"))
            if other is not None and name in program
        ]
        other_places = [_positions_key(mesh, places) for places, _ in moved]
        self._positions.used.update(other_places)
        triangles = mesh.triangles if triangles is None else triangles
        order = _indices_key(mesh, triangles)
        self._indices.used.add(order)
        key = (_batch_key(batch), _mesh_key(mesh), *other_places, order, program, copies)
        if key not in self._vertex_arrays:
            buffers = self._mesh(mesh)
            indices = self._indices_of(mesh, triangles)
            content: list[tuple[Any, ...]] = [attribute for attribute in buffers.attributes if attribute[2] in program]
            content += [(self._positions_at(mesh, places), "3f", name) for places, name in moved]
            used = [name for name in INSTANCE_ATTRIBUTES if name in program]
            instance_layout = INSTANCE_FORMAT if "in_indices" in program else "4f 4f 4f 3f 4x/i"
            content.append((self._batch(batch).buffer, instance_layout, *used))
            vertex_array = self._context.vertex_array(program, content, indices, index_element_size=4)
            if copies > 1:
                for name in used:
                    location = program[name].location  # pyright: ignore[reportAttributeAccessIssue]
                    self._device.raw.set_attribute_divisor(vertex_array, location, copies)
            self._vertex_arrays[key] = vertex_array
        return self._vertex_arrays[key]

    def instances(self, batch: InstanceBatch) -> moderngl.Buffer:
        """Where the instances of a batch are: `INSTANCE_FORMAT`, in `drawing_order`."""
        return self._batch(batch).buffer

    def poses(self, batch: InstanceBatch, other: Correspondence) -> moderngl.Texture:
        """Where the instances of a batch are in another frame. Raises RenderError where memory does not suffice."""
        matrices = other.matrices(batch)
        key = (batch.key, batch.version, id(matrices))
        label = f'{batch.count} earlier or later places of mesh "{batch.mesh}"'
        return self._poses.get(key, lambda: PoseTexture(self._context, batch, matrices), label).texture

    def bytes(self) -> int:
        """Bytes of all buffers and textures of poses."""
        return sum(uploads.bytes() for uploads in self._uploads())

    def release(self) -> None:
        """Free everything."""
        for vertex_array in self._vertex_arrays.values():
            vertex_array.release()
        self._vertex_arrays.clear()
        for uploads in self._uploads():
            uploads.keep(set())

    def _uploads(self) -> tuple[_Uploads[Any], ...]:
        return self._meshes, self._batches, self._positions, self._indices, self._poses

    def _mesh(self, mesh: Mesh) -> MeshBuffers:
        return self._meshes.get(_mesh_key(mesh), lambda: MeshBuffers(self._context, mesh), f'mesh "{mesh.name}"')

    def _batch(self, batch: InstanceBatch) -> InstanceBuffer:
        label = f'{batch.count} instances of mesh "{batch.mesh}"'
        return self._batches.get(_batch_key(batch), lambda: InstanceBuffer(self._context, batch), label)

    def _positions_at(self, mesh: Mesh, positions: Float32Array) -> moderngl.Buffer:
        if positions is mesh.positions:
            return self._mesh(mesh).attributes[0][0]
        label = f'earlier or later vertices of mesh "{mesh.name}"'
        key = _positions_key(mesh, positions)
        return self._positions.get(key, lambda: PositionBuffer(self._context, positions), label).buffer

    def _indices_of(self, mesh: Mesh, triangles: UInt32Array) -> moderngl.Buffer:
        if triangles is mesh.triangles:
            return self._mesh(mesh).indices
        label = f'sorted triangles of mesh "{mesh.name}"'
        key = _indices_key(mesh, triangles)
        return self._indices.get(key, lambda: IndexBuffer(self._context, triangles), label).buffer

    def _release_vertex_arrays(self, of: set[Hashable]) -> None:
        """Free those that read anything whose key is among `of`."""
        for key in [key for key in self._vertex_arrays if of and not of.isdisjoint(key)]:
            self._vertex_arrays.pop(key).release()


def _drawn_meshes(scene: Scene) -> list[Mesh]:
    return [scene.meshes[batch.mesh] for batch in scene.batches]


def _mesh_key(mesh: Mesh) -> Hashable:
    return "mesh", mesh.key, mesh.version


def _batch_key(batch: InstanceBatch) -> Hashable:
    return "batch", batch.key, batch.version


def _indices_key(mesh: Mesh, triangles: UInt32Array) -> Hashable:
    return _mesh_key(mesh) if triangles is mesh.triangles else ("indices", id(triangles))


def _positions_key(mesh: Mesh, positions: Float32Array) -> Hashable:
    return _mesh_key(mesh) if positions is mesh.positions else ("positions", id(positions))
