# SPDX-License-Identifier: GPL-3.0-or-later
"""Gouraud shading: direct light at the vertices, blended over triangles, in place of the direct pass."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

from ..device import Device
from ..direct_needs import GOURAUD_DEFINES, direct_program_defines
from ..plan import PlannedPass
from ..programs import ProgramSpec
from .base import Frame, UniformBuffer
from .direct import (
    DIRECT_UNIFORMS,
    LIGHT_SAMPLERS,
    LIGHT_TABLE_SIZES,
    bind_lights,
    light_uniforms,
    program_defines,
)
from .fullscreen import CHANNEL_SAMPLERS
from .rasterize import FRAGMENT_DEPTH, GeometryPass, GeometryProgram, GeometryView

_READS = ("gbuffer.view_depth", "gbuffer.base_color", "gbuffer.material", "gbuffer.emission")
_PIERCED = "ALPHA_TEST"


@dataclass(frozen=True)
class GouraudProgram(GeometryProgram):
    """Draws the same triangles as the G-buffer; `defines` as of the direct pass."""

    def spec(self, surface: frozenset[str], depth: frozenset[str]) -> ProgramSpec:
        """The program for a material's `surface` defines; `depth` may add FRAGMENT_DEPTH."""
        drawn = super().spec(surface & {_PIERCED}, depth)
        return replace(
            drawn,
            vertex="gouraud/gouraud.vert",
            fragment="gouraud/gouraud.frag",
            defines=drawn.defines | LIGHT_TABLE_SIZES,
            blocks=(*drawn.blocks, DIRECT_UNIFORMS),
            samplers=(*drawn.samplers, *(CHANNEL_SAMPLERS[name] for name in _READS), *LIGHT_SAMPLERS),
            generated=(),
        )


class GouraudPass(GeometryPass):
    """Draws each layer's triangles once more, lit at their vertices; fragments stay where the layer shows them."""

    name = "gouraud"

    def __init__(self, device: Device) -> None:
        super().__init__(device)
        self._uniforms = UniformBuffer(device, DIRECT_UNIFORMS)

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """What stands for every program that a plan can ask for; how fragments are tested depends on nothing else."""
        every = frozenset(GOURAUD_DEFINES)
        for defines in program_defines([name for name in GOURAUD_DEFINES if name != "PHONG"]):
            yield GouraudProgram((), defines | {"PHONG"}).spec(frozenset(), frozenset())
        for surface, depth in product((frozenset[str](), frozenset({_PIERCED})), (frozenset[str](), {FRAGMENT_DEPTH})):
            for defines in (frozenset({"EMISSION", "PHONG"}), direct_program_defines(every, preview=False)):
                yield GouraudProgram((), defines).spec(surface, frozenset(depth))

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Light all layers; the picture's own tells diffuse from glossy where somebody asks."""
        defines = direct_program_defines(planned.defines, preview=frame.lighting.preview)
        for layer in range(frame.plan.layers):
            split = layer == 0 and "SPLIT" in defines
            program = GouraudProgram((), defines if split else defines - {"SPLIT"})
            spec = program.spec(frozenset(), frozenset())
            for name in planned.reads:
                frame.pool.texture(name).use(spec.samplers.index(CHANNEL_SAMPLERS[name]))
            bind_lights(frame, spec)
            self._uniforms.bind(spec.blocks.index(DIRECT_UNIFORMS), **light_uniforms(frame), layer=layer)
            targets = tuple(target.name for target in (planned.writes if split else planned.writes[:1]))
            self._rasterizer.draw(frame, GeometryView(frame.moment, program, targets, into=layer, first_layer=layer))

    def release(self) -> None:
        """Free the pass's uniforms."""
        super().release()
        self._uniforms.release()
