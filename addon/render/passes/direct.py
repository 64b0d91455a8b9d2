# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light: outgoing radiance of every layer from lamps, the constant world and emission. No shadows yet."""

from collections.abc import Iterator

import moderngl

from ..device import Device
from ..direct_needs import DIRECT_DEFINES
from ..light_table import LIGHTS_PER_ROW, TEXELS_PER_LIGHT, light_table
from ..plan import PlannedPass
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .base import Frame, subsets
from .fullscreen import FullscreenDraw, fullscreen_program

DIRECT_UNIFORMS = UniformBlock(
    "DirectUniforms",
    (("world_radiance", "vec4"), ("light_sample", "vec2"), ("light_count", "int"), ("layer", "int")),
)


class DirectPass:
    """Shades each layer of the deep G-buffer once."""

    name = "direct"

    def __init__(self, device: Device) -> None:
        self._device = device
        self._fullscreen = FullscreenDraw(device, DIRECT_UNIFORMS)
        self._lights: moderngl.Texture | None = None

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """Every combination of what a scene may have."""
        yield from (_program(defines) for defines in subsets(DIRECT_DEFINES) if defines)

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """Upload the light table."""
        if self._lights is not None:
            self._lights.release()
            self._lights = None
        if frame.scene.lights:
            table = light_table(frame.scene.lights, frame.camera.position)
            self._lights = self._device.context.texture((table.shape[1], table.shape[0]), 4, table, dtype="f4")
            self._lights.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Shade all layers."""
        spec = _program(planned.defines)
        self._device.context.enable_only(moderngl.NOTHING)
        self._fullscreen.bind(frame, spec, planned)
        if self._lights is not None:
            self._lights.use(spec.samplers.index("light_table"))
        for layer in range(frame.plan.layers):
            frame.pool.framebuffer(tuple((target.name, layer) for target in planned.writes)).use()
            self._fullscreen.draw(
                spec,
                world_radiance=(*frame.scene.world.radiance, 0.0),
                light_sample=frame.sample.light,
                light_count=len(frame.scene.lights),
                layer=layer,
            )

    def release(self) -> None:
        """Free the pass's buffers and textures."""
        self._fullscreen.release()
        if self._lights is not None:
            self._lights.release()


def _program(defines: frozenset[str]) -> ProgramSpec:
    table_shape = {f"LIGHTS_PER_ROW {LIGHTS_PER_ROW}", f"TEXELS_PER_LIGHT {TEXELS_PER_LIGHT}"}
    return fullscreen_program("direct/direct.frag", DIRECT_UNIFORMS, defines | table_shape, samplers=("light_table",))
