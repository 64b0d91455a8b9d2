# SPDX-License-Identifier: GPL-3.0-or-later
"""What passes that shade every pixel share: one triangle over the viewport, the G-buffer and the camera bound."""

import moderngl
import numpy as np

from ..device import Device
from ..plan import PlannedPass
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .base import Frame, UniformBuffer

CAMERA_UNIFORMS = UniformBlock(
    "CameraUniforms",
    (
        ("world_from_camera", "mat4"),
        ("camera_window", "vec4"),
        ("camera_resolution", "vec2"),
        ("camera_orthographic", "int"),
        ("guard_band", "int"),  # pixels between the edges of what the camera sees and the picture
    ),
)

CHANNEL_SAMPLERS = {
    "gbuffer.view_depth": "view_depth_layers",
    "gbuffer.normal": "normal_layers",
    "gbuffer.base_color": "base_color_layers",
    "gbuffer.material": "material_layers",
    "gbuffer.emission": "emission_layers",
    "gbuffer.object_index": "object_index_layers",
    "gbuffer.motion": "motion_layers",
    "exit.view_depth": "exit_view_depth_layers",
    "exit.normal": "exit_normal_layers",
    "exit.base_color": "exit_base_color_layers",
    "tiles.depth": "tile_depth_layers",
    "tiles.lights": "tile_lights",
    "direct.radiance": "radiance_layers",
    "direct.diffuse": "diffuse_layers",
    "direct.glossy": "glossy_layers",
    "indirect.gathered": "gathered",
    "indirect.blended": "blended",
    "indirect.irradiance": "irradiance_layers",
    "indirect.origin": "origin_layers",
}
"""Target -> the sampler that shaders read it through."""

_GGX_ALBEDO, _LTC = "ggx_albedo_table", "ltc_table"
_CAMERA_BINDING, _PASS_BINDING = 0, 1


def fullscreen_program(
    fragment: str,
    block: UniformBlock,
    defines: frozenset[str],
    *,
    samplers: tuple[str, ...] = (),
    generated: tuple[tuple[str, str], ...] = (),
) -> ProgramSpec:
    """A variant that draws over the viewport: the camera block, the pass's own, every target and more samplers."""
    return ProgramSpec(
        vertex="common/fullscreen.vert",
        fragment=fragment,
        defines=defines,
        blocks=(CAMERA_UNIFORMS, block),
        samplers=(*CHANNEL_SAMPLERS.values(), _GGX_ALBEDO, _LTC, *samplers),
        generated=generated,
    )


class FullscreenDraw:
    """Draws one triangle over the viewport; attribute-less vertex arrays are kept per program.

    Shaders see the camera of the whole guarded picture, in whose pixels they address the targets.
    """

    def __init__(self, device: Device, block: UniformBlock) -> None:
        self._device = device
        self._camera = UniformBuffer(device, CAMERA_UNIFORMS)
        self._uniforms = UniformBuffer(device, block)
        self._vertex_arrays: dict[ProgramSpec, moderngl.VertexArray] = {}

    def bind(self, frame: Frame, spec: ProgramSpec, planned: PlannedPass) -> None:
        """Bind the camera, the targets that the pass reads and the tables of the GGX BRDF."""
        for name in planned.reads:
            frame.pool.texture(name).use(spec.samplers.index(CHANNEL_SAMPLERS[name]))
        self._device.ggx_albedo.use(spec.samplers.index(_GGX_ALBEDO))
        self._device.ltc.use(spec.samplers.index(_LTC))
        rotation = np.eye(4)
        rotation[:3, :3] = frame.camera.rotation
        self._camera.bind(
            _CAMERA_BINDING,
            world_from_camera=rotation,
            camera_window=frame.camera.window,
            camera_resolution=frame.pool.size,
            camera_orthographic=int(frame.camera.orthographic),
            guard_band=frame.pool.guard_band,
        )

    def draw(self, spec: ProgramSpec, **uniforms: object) -> None:
        """Draw with the pass's own uniforms into the bound framebuffer."""
        if spec not in self._vertex_arrays:
            self._vertex_arrays[spec] = self._device.context.vertex_array(self._device.programs.get(spec), [])
        self._uniforms.bind(_PASS_BINDING, **uniforms)
        self._vertex_arrays[spec].render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the buffers and vertex arrays."""
        self._camera.release()
        self._uniforms.release()
        for vertex_array in self._vertex_arrays.values():
            vertex_array.release()
        self._vertex_arrays.clear()


class FullscreenPass:
    """What passes that shade every texel have in common; `block`: a pass's own uniforms."""

    block: UniformBlock

    def __init__(self, device: Device) -> None:
        self._device = device
        self._fullscreen = FullscreenDraw(device, self.block)

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """Nothing but uniforms, which `run` writes."""

    def release(self) -> None:
        """Free the pass's buffers."""
        self._fullscreen.release()
