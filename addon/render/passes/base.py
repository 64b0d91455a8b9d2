# SPDX-License-Identifier: GPL-3.0-or-later
"""What every pass is and what it may use while it runs."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import moderngl
import numpy as np

from ...scene import Camera, RenderSettings, Scene
from ..device import Device
from ..film import Film
from ..geometry import GeometryStore
from ..images import ImageStore
from ..plan import Plan, PlannedPass
from ..programs import ProgramSpec
from ..sampling import Sample
from ..targets import TexturePool
from ..uniforms import UniformBlock

FULLSCREEN = "common/fullscreen.vert"

CAMERA_UNIFORMS = UniformBlock(
    "CameraUniforms",
    (
        ("world_from_camera", "mat4"),
        ("camera_window", "vec4"),
        ("camera_resolution", "vec2"),
        ("camera_orthographic", "int"),
    ),
)

GBUFFER_SAMPLERS = {
    "view_depth": "view_depth_layers",
    "normal": "normal_layers",
    "base_color": "base_color_layers",
    "material": "material_layers",
    "emission": "emission_layers",
    "object_index": "object_index_layers",
}
"""G-buffer channel -> the sampler that shaders read it through."""


@dataclass
class Frame:
    """One view's state during one sample. `camera` already has the sample's sub-pixel jitter."""

    device: Device
    pool: TexturePool
    geometry: GeometryStore
    images: ImageStore
    film: Film
    scene: Scene
    settings: RenderSettings
    plan: Plan
    camera: Camera
    sample: Sample


class Pass(Protocol):
    """A pass of the pipeline; one object per view, built when the plan first needs it."""

    name: str

    def __init__(self, device: Device) -> None: ...

    @classmethod
    def variants(cls) -> Iterable[ProgramSpec]:
        """Every program variant that a plan can ask for."""
        ...

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """Upload what is the same for all samples."""
        ...

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Draw one sample."""
        ...

    def release(self) -> None:
        """Free what the pass owns."""
        ...


class UniformBuffer:
    """The GPU copy of one uniform block."""

    def __init__(self, device: Device, block: UniformBlock) -> None:
        self._block = block
        self._buffer = device.context.buffer(reserve=block.dtype.itemsize)

    def bind(self, binding: int, **values: object) -> None:
        """Write the block's fields and bind it."""
        self._buffer.write(self._block.pack(**values))
        self._buffer.bind_to_uniform_block(binding)

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()


class FullscreenDraw:
    """Draws one triangle over the viewport with a program; attribute-less vertex arrays are kept per program."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._vertex_arrays: dict[ProgramSpec, moderngl.VertexArray] = {}

    def draw(self, spec: ProgramSpec) -> None:
        """Draw with the program of a variant into the bound framebuffer."""
        if spec not in self._vertex_arrays:
            program = self._device.programs.get(spec)
            self._vertex_arrays[spec] = self._device.context.vertex_array(program, [])
        self._vertex_arrays[spec].render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the vertex arrays."""
        for vertex_array in self._vertex_arrays.values():
            vertex_array.release()
        self._vertex_arrays.clear()


def bind_camera(buffer: UniformBuffer, binding: int, frame: Frame) -> None:
    """Bind the camera block that `common/camera.glsl` reads."""
    rotation = np.eye(4)
    rotation[:3, :3] = frame.camera.rotation
    buffer.bind(
        binding,
        world_from_camera=rotation,
        camera_window=frame.camera.window,
        camera_resolution=frame.pool.size,
        camera_orthographic=int(frame.camera.orthographic),
    )


def bind_targets(frame: Frame, spec: ProgramSpec, planned: PlannedPass) -> None:
    """Bind the targets that a pass reads to the units of its samplers."""
    for name in planned.reads:
        sampler = GBUFFER_SAMPLERS[name.removeprefix("gbuffer.")] if name.startswith("gbuffer.") else "radiance_layers"
        frame.pool.texture(name).use(spec.samplers.index(sampler))


def subsets(names: Iterable[str]) -> list[frozenset[str]]:
    """Every subset of the names."""
    result = [frozenset[str]()]
    for name in names:
        result += [subset | {name} for subset in result]
    return result
