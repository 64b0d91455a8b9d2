# SPDX-License-Identifier: GPL-3.0-or-later
"""The deep G-buffer: n layers with minimum separation, by sequential peeling (the two-pass reference construction)."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import moderngl
import numpy as np

from ...scene import BaseColorSource, ImageTexture, InstanceBatch, Material, Scene
from ..device import Device
from ..geometry import split_float64
from ..layout import CHANNELS, MOTION, ORACLES, GBufferChannel, outputs_glsl
from ..plan import PlannedPass, is_alpha_tested, is_invisible
from ..programs import ProgramSpec
from ..raw_gl import CLIP_DISTANCE0
from ..uniforms import UniformBlock
from .base import Frame, UniformBuffer, subsets

GBUFFER_UNIFORMS = UniformBlock(
    "GBufferUniforms",
    (
        ("clip_from_relative", "mat4"),
        ("forward", "vec4"),
        ("camera_high", "vec4"),  # the camera's position as two float32 parts
        ("camera_low", "vec4"),
        ("clip_start", "float"),
        ("clip_end", "float"),
        ("minimum_separation", "float"),
        ("alpha_threshold", "float"),
        ("texture_lod_bias", "float"),
        ("layer", "int"),
        ("image_handedness", "float"),  # −1 where the window mirrors the picture
        ("orthographic", "int"),
    ),
)

MATERIAL_UNIFORMS = UniformBlock(
    "MaterialUniforms",
    (
        ("material_base_color", "vec4"),  # rgb, F0
        ("material_emission", "vec4"),  # rgb, alpha
        ("material_surface", "vec4"),  # metallic, roughness
    ),
)

FRAGMENT_DEPTH = "FRAGMENT_DEPTH"
"""Define where the driver has no 0…1 clip space (macOS): its own depth would round far surfaces together."""

_SAMPLERS = ("base_color_texture", "oracle")
_TEXTURE_UNIT, _ORACLE_UNIT = 0, 1
_FRAME_BINDING, _MATERIAL_BINDING = 0, 1


@dataclass(frozen=True)
class Draw:
    """One instanced draw: the triangles of one slot of one batch."""

    batch: InstanceBatch
    vertex_array: moderngl.VertexArray
    first_index: int
    index_count: int
    material_offset: int
    texture: ImageTexture | None


class GBufferPass:
    """Draws every batch once per layer; layer k discards what is not behind layer k − 1 by more than Δz."""

    name = "gbuffer"

    def __init__(self, device: Device) -> None:
        self._device = device
        self._uniforms = UniformBuffer(device, GBUFFER_UNIFORMS)
        self._materials: moderngl.Buffer | None = None
        self._draws: list[Draw] = []
        self._drawn: tuple[Scene, PlannedPass, float, int] | None = None

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """Every surface kind with every set of channels besides view depth, peeling or not, with either depth."""
        optional = [channel.name for channel in CHANNELS if channel is not MOTION and channel.name != "view_depth"]
        surfaces = [frozenset(names) for names in ((), ("TEXTURE",), ("TEXTURE", "ALPHA_TEST"), ("ATTRIBUTE",))]
        for names in subsets(optional):
            channels = tuple(channel for channel in CHANNELS if channel.name in names | {"view_depth"})
            for surface in surfaces:
                for extra in subsets(("PEEL", FRAGMENT_DEPTH)):
                    yield _program(channels, surface | extra)

    @property
    def draws(self) -> int:
        """Draw calls per layer."""
        return len(self._draws)

    @property
    def triangles(self) -> int:
        """Triangles per layer, instances counted."""
        return sum(draw.index_count // 3 * draw.batch.count for draw in self._draws)

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """Upload material constants and build the draw list. Draws are ordered by key, not by submission.

        A camera move brings the same scene object again, and nothing is to do.
        """
        drawn = (frame.scene, planned, frame.settings.alpha_threshold, frame.geometry.generation)
        if self._drawn is not None and self._drawn[0] is drawn[0] and self._drawn[1:] == drawn[1:]:
            return
        self._drawn, self._draws = None, []
        offsets = self._upload_materials(frame.scene)
        depth = frozenset[str](() if self._device.zero_to_one_depth else {FRAGMENT_DEPTH})
        for batch in sorted(frame.scene.batches, key=lambda batch: batch.key):
            mesh = frame.scene.meshes[batch.mesh]
            for slot in mesh.slots:
                material = frame.scene.materials[batch.materials[min(slot.slot, len(batch.materials) - 1)]]
                if slot.count == 0 or is_invisible(material, frame.settings):
                    continue
                spec = _program(frame.plan.channels, _surface_defines(material) | planned.defines | depth)
                program = self._device.programs.get(spec)
                self._draws.append(
                    Draw(
                        batch,
                        frame.geometry.vertex_array(batch, program),
                        3 * slot.first,
                        3 * slot.count,
                        offsets[material.key],
                        material.texture if "TEXTURE" in spec.defines else None,
                    )
                )
        self._drawn = drawn

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Draw all layers, nearest first."""
        context = self._device.context
        for layer in range(frame.plan.layers):
            attachments = [(channel.target(1).name, layer) for channel in frame.plan.channels]
            if "PEEL" in planned.defines:
                # The oracle is a texture of its own: OpenGL 4.1 forbids reading any layer of an attached array.
                attachments.append((ORACLES[layer % 2].name, 0))
                frame.pool.texture(ORACLES[(layer + 1) % 2].name).use(_ORACLE_UNIT)
            framebuffer = frame.pool.framebuffer(tuple(attachments), depth=True)
            framebuffer.use()
            framebuffer.clear(depth=0.0)
            frame.pool.clear(tuple(attachments))
            context.enable_only(moderngl.DEPTH_TEST)
            context.enable_direct(CLIP_DISTANCE0)
            context.depth_func = ">"
            self._bind_frame(frame, layer)
            self._draw_all(frame)
        context.disable_direct(CLIP_DISTANCE0)

    def release(self) -> None:
        """Free the pass's buffers."""
        self._draws, self._drawn = [], None
        self._uniforms.release()
        if self._materials is not None:
            self._materials.release()

    def _draw_all(self, frame: Frame) -> None:
        assert self._materials is not None
        size = MATERIAL_UNIFORMS.dtype.itemsize
        for draw in self._draws:
            self._materials.bind_to_uniform_block(_MATERIAL_BINDING, offset=draw.material_offset, size=size)
            if draw.texture is not None:
                frame.images.use(draw.texture, _TEXTURE_UNIT)
            draw.vertex_array.render(
                moderngl.TRIANGLES, vertices=draw.index_count, first=draw.first_index, instances=draw.batch.count
            )
        self._device.context.clear_samplers()

    def _bind_frame(self, frame: Frame, layer: int) -> None:
        camera = frame.camera
        camera_from_relative = np.eye(4)
        camera_from_relative[:3, :3] = camera.rotation.T
        projection = camera.projection(zero_to_one_depth=self._device.zero_to_one_depth)
        camera_high, camera_low = split_float64(camera.position)
        self._uniforms.bind(
            _FRAME_BINDING,
            camera_high=(*camera_high, 0.0),
            camera_low=(*camera_low, 0.0),
            clip_from_relative=projection @ camera_from_relative,
            forward=(*-camera.rotation[:, 2], 0.0),
            clip_start=camera.clip_start,
            clip_end=camera.clip_end,
            minimum_separation=frame.settings.minimum_separation,
            alpha_threshold=frame.settings.alpha_threshold,
            # N accumulated samples resolve √N times finer than one.
            texture_lod_bias=-0.5 * math.log2(max(frame.settings.samples, 1)),
            layer=layer,
            image_handedness=1.0 if camera.window[1] > camera.window[0] else -1.0,
            orthographic=int(camera.orthographic),
        )

    def _upload_materials(self, scene: Scene) -> dict[str, int]:
        alignment = self._device.uniform_alignment
        stride = -(-MATERIAL_UNIFORMS.dtype.itemsize // alignment) * alignment
        packed = b"".join(_pack_material(material).ljust(stride, b"\0") for material in scene.materials.values())
        if self._materials is not None:
            self._materials.release()
        self._materials = self._device.context.buffer(packed) if packed else self._device.context.buffer(reserve=stride)
        return {key: index * stride for index, key in enumerate(scene.materials)}


def _surface_defines(material: Material) -> frozenset[str]:
    if material.source is BaseColorSource.TEXTURE and material.texture is not None:
        return frozenset({"TEXTURE", "ALPHA_TEST"} if is_alpha_tested(material) else {"TEXTURE"})
    return frozenset({"ATTRIBUTE"} if material.source is BaseColorSource.ATTRIBUTE else ())


def _program(channels: tuple[GBufferChannel, ...], defines: frozenset[str]) -> ProgramSpec:
    return ProgramSpec(
        vertex="gbuffer/gbuffer.vert",
        fragment="gbuffer/gbuffer.frag",
        defines=defines | {f"WRITE_{channel.name.upper()}" for channel in channels},
        blocks=(GBUFFER_UNIFORMS, MATERIAL_UNIFORMS),
        samplers=_SAMPLERS,
        generated=(("outputs", outputs_glsl(channels, oracle="PEEL" in defines)),),
    )


def _pack_material(material: Material) -> bytes:
    return MATERIAL_UNIFORMS.pack(
        material_base_color=(*material.base_color, material.specular),
        material_emission=(*np.minimum(material.emission, np.finfo(np.float32).max), material.alpha),
        material_surface=(material.metallic, material.roughness, 0.0, 0.0),
    )
