# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of one sample, added to the film: radiance over background, or a debug view; and the mean passes."""

from collections.abc import Iterator

from ...scene import Channel, DebugView
from ..device import Device
from ..plan import SUM_CHANNELS, PlannedPass
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

COMPOSITE_UNIFORMS = UniformBlock("CompositeUniforms", (("background", "vec4"), ("shown_layer", "int")))

_CAMERA_BINDING, _COMPOSITE_BINDING = 0, 1


class CompositePass:
    """Writes the film."""

    name = "composite"

    def __init__(self, device: Device) -> None:
        self._device = device
        self._camera = UniformBuffer(device, CAMERA_UNIFORMS)
        self._uniforms = UniformBuffer(device, COMPOSITE_UNIFORMS)
        self._fullscreen = FullscreenDraw(device)

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """Radiance, black or a debug view, with every set of mean passes."""
        shown = [{"DIRECT"}, set[str](), *({f"DEBUG_{view.value}"} for view in DebugView if view is not DebugView.NONE)]
        for film in subsets(f"FILM_{channel.value}" for channel in SUM_CHANNELS if channel is not Channel.COMBINED):
            for view in shown:
                yield _program(film | view)

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """Nothing but uniforms, which `run` writes."""

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Add one sample to the film."""
        spec = _program(planned.defines)
        frame.film.begin_sample(frame.pool.framebuffer(tuple(target.name for target in planned.writes), 0))
        bind_targets(frame, spec, planned)
        self._device.ggx_albedo.use(spec.samplers.index("ggx_albedo_table"))
        bind_camera(self._camera, _CAMERA_BINDING, frame)
        debug = frame.settings.debug_view is not DebugView.NONE
        visible = not debug and not frame.settings.transparent_film
        self._uniforms.bind(
            _COMPOSITE_BINDING,
            background=(*frame.scene.world.radiance, 1.0) if visible else (0.0, 0.0, 0.0, 0.0),
            shown_layer=min(frame.settings.debug_layer, frame.plan.layers - 1) if debug else 0,
        )
        self._fullscreen.draw(spec)

    def release(self) -> None:
        """Free the pass's buffers."""
        self._camera.release()
        self._uniforms.release()
        self._fullscreen.release()


def _program(defines: frozenset[str]) -> ProgramSpec:
    sums = [channel for channel in SUM_CHANNELS if channel is Channel.COMBINED or f"FILM_{channel.value}" in defines]
    outputs = "".join(
        f"layout(location = {index}) out vec4 out_{channel.value.lower()};\n" for index, channel in enumerate(sums)
    )
    return ProgramSpec(
        vertex=FULLSCREEN,
        fragment="composite/composite.frag",
        defines=defines,
        blocks=(CAMERA_UNIFORMS, COMPOSITE_UNIFORMS),
        samplers=(*GBUFFER_SAMPLERS.values(), "radiance_layers", "ggx_albedo_table"),
        generated=(("outputs", outputs),),
    )
