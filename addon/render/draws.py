# SPDX-License-Identifier: GPL-3.0-or-later
"""What there is to draw of a scene: its visible triangles by material, in an order that no submission changes."""

from collections.abc import Iterable
from dataclasses import dataclass

import moderngl
import numpy as np

from ..scene import BaseColorSource, ImageTexture, InstanceBatch, Material, Scene
from .device import Device
from .uniforms import UniformBlock

MATERIAL_UNIFORMS = UniformBlock(
    "MaterialUniforms",
    (
        ("material_base_color", "vec4"),  # rgb, F0
        ("material_emission", "vec4"),  # rgb, alpha
        ("material_surface", "vec4"),  # metallic, roughness, diffuse roughness
    ),
)


@dataclass(frozen=True)
class Draw:
    """One instanced draw: the triangles of one slot of one batch. `surface`: the defines of its material, `alpha` its
    constant factor."""

    batch: InstanceBatch
    first_index: int
    index_count: int
    material_offset: int
    surface: frozenset[str]
    texture: ImageTexture | None
    alpha: float


class SceneDraws:
    """The draws of one scene, those that the camera sees among them, and its materials' constants on the GPU."""

    def __init__(self, device: Device, scene: Scene, alpha_threshold: float) -> None:
        self.scene = scene
        self.alpha_threshold = alpha_threshold
        self._device = device
        self._materials, offsets = _upload_materials(device, scene)
        self.draws = tuple(_draws(scene, alpha_threshold, offsets))
        self.seen = tuple(draw for draw in self.draws if draw.batch.seen_by_camera)

    @property
    def triangles(self) -> int:
        """Triangles of one geometry pass, instances counted."""
        return sum(draw.index_count // 3 * draw.batch.count for draw in self.seen)

    def bind_material(self, draw: Draw, binding: int) -> None:
        """Bind the constants of a draw's material."""
        size = MATERIAL_UNIFORMS.dtype.itemsize
        self._materials.bind_to_uniform_block(binding, offset=draw.material_offset, size=size)

    def release(self) -> None:
        """Free the constants."""
        self._materials.release()


class DrawLists:
    """The draws of the scenes that a view draws: its own, and maybe another frame's."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._lists: list[SceneDraws] = []

    def prepare(self, scenes: Iterable[Scene], alpha_threshold: float) -> None:
        """Have the draws of exactly these scenes. A camera move brings the same scene object: nothing is to do."""
        kept: list[SceneDraws] = []
        for scene in scenes:
            held = self._find(scene)
            if held is None or held.alpha_threshold != alpha_threshold:
                held = SceneDraws(self._device, scene, alpha_threshold)
            kept.append(held)
        for draws in self._lists:
            if draws not in kept:
                draws.release()
        self._lists = kept

    def of(self, scene: Scene) -> SceneDraws:
        """The draws of a scene that `prepare` was told of."""
        draws = self._find(scene)
        assert draws is not None
        return draws

    def release(self) -> None:
        """Free everything."""
        for draws in self._lists:
            draws.release()
        self._lists = []

    def _find(self, scene: Scene) -> SceneDraws | None:
        return next((draws for draws in self._lists if draws.scene is scene), None)


def _draws(scene: Scene, alpha_threshold: float, offsets: dict[str, int]) -> Iterable[Draw]:
    for batch in sorted(scene.batches, key=lambda batch: batch.key):
        for slot in scene.meshes[batch.mesh].slots:
            material = scene.materials[batch.materials[min(slot.slot, len(batch.materials) - 1)]]
            if slot.count == 0 or material.alpha < alpha_threshold:  # no fragment can pass the alpha test
                continue
            surface = _surface_defines(material)
            texture = material.texture if "TEXTURE" in surface else None
            yield Draw(batch, 3 * slot.first, 3 * slot.count, offsets[material.key], surface, texture, material.alpha)


def _surface_defines(material: Material) -> frozenset[str]:
    if material.source is BaseColorSource.TEXTURE and material.texture is not None:
        return frozenset({"TEXTURE", "ALPHA_TEST"} if material.is_alpha_tested else {"TEXTURE"})
    return frozenset({"ATTRIBUTE"} if material.source is BaseColorSource.ATTRIBUTE else ())


def _upload_materials(device: Device, scene: Scene) -> tuple[moderngl.Buffer, dict[str, int]]:
    """The constants of all materials in one buffer, and where those of each are."""
    alignment = device.uniform_alignment
    stride = -(-MATERIAL_UNIFORMS.dtype.itemsize // alignment) * alignment
    packed = b"".join(_pack_material(material).ljust(stride, b"\0") for material in scene.materials.values())
    buffer = device.context.buffer(packed) if packed else device.context.buffer(reserve=stride)
    return buffer, {key: index * stride for index, key in enumerate(scene.materials)}


def _pack_material(material: Material) -> bytes:
    return MATERIAL_UNIFORMS.pack(
        material_base_color=(*material.base_color, material.specular),
        material_emission=(*np.minimum(material.emission, np.finfo(np.float32).max), material.alpha),
        material_surface=(material.metallic, material.roughness, material.diffuse_roughness, 0.0),
    )
