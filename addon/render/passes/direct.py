# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light: outgoing radiance of every layer from lamps, the constant world and emission. No shadows yet."""

from collections.abc import Iterator

import moderngl

from ..device import Device
from ..light_table import TEXELS_PER_LIGHT, light_table
from ..plan import PlannedPass
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .base import (
    CAMERA_UNIFORMS,
    FULLSCREEN,
    GBUFFER_SAMPLERS,
    Frame,
    FullscreenDraw,
    UniformBuffer,
    bind_camera,
    bind_targets,
    subsets,
)

DIRECT_UNIFORMS = UniformBlock(
    "DirectUniforms",
    (("world_radiance", "vec4"), ("light_sample", "vec2"), ("light_count", "int"), ("layer", "int")),
)

_CAMERA_BINDING, _DIRECT_BINDING = 0, 1


class DirectPass:
    """Shades each layer of the deep G-buffer once."""

    name = "direct"

    def __init__(self, device: Device) -> None:
        self._device = device
        self._camera = UniformBuffer(device, CAMERA_UNIFORMS)
        self._uniforms = UniformBuffer(device, DIRECT_UNIFORMS)
        self._fullscreen = FullscreenDraw(device)
        self._lights: moderngl.Texture | None = None

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """Every combination of light sources."""
        for defines in subsets(("LIGHTS", "WORLD", "EMISSION")):
            if defines:
                yield _program(defines)

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """Upload the light table."""
        if self._lights is not None:
            self._lights.release()
            self._lights = None
        if "LIGHTS" in planned.defines:
            table = light_table(frame.scene.lights, frame.camera.position)
            self._lights = self._device.context.texture((TEXELS_PER_LIGHT, len(table)), 4, table, dtype="f4")
            self._lights.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Shade all layers."""
        spec = _program(planned.defines)
        self._device.context.enable_only(moderngl.NOTHING)
        bind_targets(frame, spec, planned)
        self._device.ggx_albedo.use(spec.samplers.index("ggx_albedo_table"))
        if self._lights is not None:
            self._lights.use(spec.samplers.index("light_table"))
        bind_camera(self._camera, _CAMERA_BINDING, frame)
        for layer in range(frame.plan.layers):
            frame.pool.framebuffer(tuple(target.name for target in planned.writes), layer).use()
            self._uniforms.bind(
                _DIRECT_BINDING,
                world_radiance=(*frame.scene.world.radiance, 0.0),
                light_sample=frame.sample.light,
                light_count=len(frame.scene.lights),
                layer=layer,
            )
            self._fullscreen.draw(spec)

    def release(self) -> None:
        """Free the pass's buffers and textures."""
        self._camera.release()
        self._uniforms.release()
        self._fullscreen.release()
        if self._lights is not None:
            self._lights.release()


def _program(defines: frozenset[str]) -> ProgramSpec:
    return ProgramSpec(
        vertex=FULLSCREEN,
        fragment="direct/direct.frag",
        defines=defines,
        blocks=(CAMERA_UNIFORMS, DIRECT_UNIFORMS),
        samplers=(*GBUFFER_SAMPLERS.values(), "light_table", "ggx_albedo_table"),
    )
