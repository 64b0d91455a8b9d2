# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of one sample, added to the film: radiance over background, or a debug view; and the mean passes."""

from collections.abc import Iterator

from ...scene import Channel, DebugView
from ..device import Device
from ..plan import SUM_CHANNELS, PlannedPass
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .base import Frame, subsets
from .fullscreen import FullscreenDraw, fullscreen_program

COMPOSITE_UNIFORMS = UniformBlock("CompositeUniforms", (("background", "vec4"), ("shown_layer", "int")))


class CompositePass:
    """Writes the film."""

    name = "composite"

    def __init__(self, device: Device) -> None:
        self._fullscreen = FullscreenDraw(device, COMPOSITE_UNIFORMS)

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """Radiance, black or a debug view, with every set of mean passes."""
        shown = [{"DIRECT"}, set[str](), *({f"DEBUG_{view.value}"} for view in DebugView if view is not DebugView.NONE)]
        for film in subsets(f"FILM_{channel.value}" for channel in SUM_CHANNELS if channel is not Channel.COMBINED):
            for view in shown:
                yield _program(film | view)
                if "FILM_DIFFUSE_COLOR" in film:
                    yield _program(film | view | {"SPECULAR"})

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """Nothing but uniforms, which `run` writes."""

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Add one sample to the film."""
        spec = _program(planned.defines)
        frame.film.begin_sample(frame.pool.framebuffer(tuple((target.name, 0) for target in planned.writes)))
        self._fullscreen.bind(frame, spec, planned)
        debug = frame.settings.debug_view is not DebugView.NONE
        visible = not debug and not frame.settings.transparent_film
        self._fullscreen.draw(
            spec,
            background=(*frame.scene.world.radiance, 1.0) if visible else (0.0, 0.0, 0.0, 0.0),
            shown_layer=min(frame.settings.debug_layer, frame.plan.layers - 1) if debug else 0,
        )

    def release(self) -> None:
        """Free the pass's buffers."""
        self._fullscreen.release()


def _program(defines: frozenset[str]) -> ProgramSpec:
    sums = [channel for channel in SUM_CHANNELS if channel is Channel.COMBINED or f"FILM_{channel.value}" in defines]
    outputs = "".join(
        f"layout(location = {index}) out vec4 out_{channel.value.lower()};\n" for index, channel in enumerate(sums)
    )
    return fullscreen_program(
        "composite/composite.frag", COMPOSITE_UNIFORMS, defines, generated=(("outputs", outputs),)
    )
