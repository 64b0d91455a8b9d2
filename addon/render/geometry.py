# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's geometry on the GPU: buffers mirror meshes and batches, and only what changed is uploaded."""

from collections.abc import Iterable
from typing import Any

import moderngl
import numpy as np

from ..scene import InstanceBatch, Mesh, Scene
from ..scene.arrays import Float32Array, Float64Array
from .device import Device

MESH_ATTRIBUTES = ("3f", "in_position"), ("3f", "in_normal"), ("2f", "in_uv"), ("4f", "in_color")
INSTANCE_FORMAT = "4f 4f 4f 3f 1i/i"
INSTANCE_ATTRIBUTES = ("in_row_0", "in_row_1", "in_row_2", "in_translation_low", "in_object_index")
_INSTANCE_DTYPE = np.dtype([("rows", "f4", (3, 4)), ("translation_low", "f4", 3), ("object_index", "i4")])


class MeshBuffers:
    """Vertex and index buffers of one mesh."""

    def __init__(self, context: moderngl.Context, mesh: Mesh) -> None:
        self.version = mesh.version
        arrays = (mesh.positions, mesh.normals, mesh.uvs, mesh.colors)
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
        self.version = batch.version
        self.buffer = context.buffer(pack_instances(batch))

    def release(self) -> None:
        """Free the buffer."""
        self.buffer.release()


def split_float64(values: Float64Array) -> tuple[Float32Array, Float32Array]:
    """High and low float32 parts whose exact sum keeps 48 bits of each value.

    Differences taken part by part on the GPU are then as good as a float64 subtraction rounded to float32, so that
    precision near the camera does not depend on where in the world that is, and a camera move uploads nothing.
    """
    high = values.astype(np.float32)
    return high, (values - high).astype(np.float32)


def pack_instances(batch: InstanceBatch) -> bytes:
    """Matrix rows, low parts of the translations and pass indices, as the vertex shader reads them."""
    packed = np.empty(batch.count, _INSTANCE_DTYPE)
    packed["rows"] = batch.matrices[:, :3, :]
    packed["rows"][:, :, 3], packed["translation_low"] = split_float64(batch.matrices[:, :3, 3])
    packed["object_index"] = batch.object_index
    return packed.tobytes()


class GeometryStore:
    """GPU mirror of `Scene.meshes` and `Scene.batches`.

    `generation` changes whenever vertex arrays that were handed out are no longer valid.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        self._context = device.context
        self._meshes: dict[str, MeshBuffers] = {}
        self._batches: dict[str, InstanceBuffer] = {}
        self.generation = 0
        self._vertex_arrays: dict[tuple[str, str, moderngl.Program], moderngl.VertexArray] = {}

    def update(self, scene: Scene) -> None:
        """Mirror the scene. Raises RenderError naming the mesh that graphics memory has no room for."""
        replaced = self._drop(
            self._meshes, (key for key, held in self._meshes.items() if _is_stale(held, scene.meshes.get(key)))
        )
        batches = {batch.key: batch for batch in scene.batches}
        replaced |= self._drop(
            self._batches, (key for key, held in self._batches.items() if _is_stale(held, batches.get(key)))
        )
        if replaced:
            self._release_vertex_arrays()
        for batch in scene.batches:
            if batch.mesh not in self._meshes:
                mesh = scene.meshes[batch.mesh]
                held = self._meshes[batch.mesh] = MeshBuffers(self._context, mesh)
                self._device.check_upload(f'mesh "{mesh.name}"', held.bytes)
            if batch.key not in self._batches:
                placed = self._batches[batch.key] = InstanceBuffer(self._context, batch)
                self._device.check_upload(f'{batch.count} instances of mesh "{batch.mesh}"', placed.buffer.size)

    def vertex_array(self, batch: InstanceBatch, program: moderngl.Program) -> moderngl.VertexArray:
        """The vertex array that draws a batch with a program."""
        key = (batch.key, batch.mesh, program)
        if key not in self._vertex_arrays:
            mesh = self._meshes[batch.mesh]
            content: list[tuple[Any, ...]] = [attribute for attribute in mesh.attributes if attribute[2] in program]
            used = [name for name in INSTANCE_ATTRIBUTES if name in program]
            instance_layout = INSTANCE_FORMAT if "in_object_index" in program else "4f 4f 4f 3f 4x/i"
            content.append((self._batches[batch.key].buffer, instance_layout, *used))
            self._vertex_arrays[key] = self._context.vertex_array(program, content, mesh.indices, index_element_size=4)
        return self._vertex_arrays[key]

    def bytes(self) -> int:
        """Bytes of all buffers."""
        return sum(mesh.bytes for mesh in self._meshes.values()) + sum(
            batch.buffer.size for batch in self._batches.values()
        )

    def release(self) -> None:
        """Free everything."""
        self._release_vertex_arrays()
        self._drop(self._meshes, list(self._meshes))
        self._drop(self._batches, list(self._batches))

    def _release_vertex_arrays(self) -> None:
        self.generation += 1
        for vertex_array in self._vertex_arrays.values():
            vertex_array.release()
        self._vertex_arrays.clear()

    @staticmethod
    def _drop(held: "dict[str, MeshBuffers] | dict[str, InstanceBuffer]", keys: Iterable[str]) -> bool:
        stale = list(keys)
        for key in stale:
            held.pop(key).release()
        return bool(stale)


def _is_stale(held: MeshBuffers | InstanceBuffer, current: Mesh | InstanceBatch | None) -> bool:
    return current is None or current.version != held.version
