# SPDX-License-Identifier: GPL-3.0-or-later
"""Radiosity: what the layers around each pixel send to it, after Mara et al. 2016, "Deep G-Buffers for Stable Global
Illumination Approximation"."""

from collections.abc import Iterator
from math import ceil, log

import moderngl

from ...scene import Scene
from ..environment import BLURS_SAMPLER, ENVIRONMENT_DEFINE, ENVIRONMENT_UNIFORMS, environment_uniforms
from ..gathering import GATHER_UNIFORMS, gather_offset, gather_uniforms
from ..indirect_plan import BOUNCE_DIVISOR
from ..plan import PlannedPass
from ..programs import ProgramSpec
from ..screen_taps import TAP_UNIFORMS, tap_uniforms
from ..uniforms import UniformBlock
from .base import Frame, subsets
from .fullscreen import FullscreenPass, fullscreen_program

RADIOSITY_UNIFORMS = UniformBlock(
    "RadiosityUniforms", (*ENVIRONMENT_UNIFORMS, *GATHER_UNIFORMS, *TAP_UNIFORMS, ("layer", "int"))
)

DIRECT_TARGET = "direct.radiance"
BOUNCED_SAMPLER = "bounced_layers"
MATERIAL_DEFINES = ("SPECULAR", "DIFFUSE_ROUGHNESS", "PHONG")
"""What decides how much a surface reflects diffusely."""

MOST_BOUNCES = 32
_LAST_BOUNCE = 0.01
"""Share of the first bounce's light below which one adds nothing to see."""


class RadiosityPass(FullscreenPass):
    """Writes the nearest layer's irradiance from what is around it in all layers."""

    name = "radiosity"
    block = RADIOSITY_UNIFORMS

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """The first bounce and later ones, in both composites."""
        sent = [
            set[str](),
            {"RADIANCE"},
            {"RADIANCE", "SAMPLED_EMISSION"},
            *({"RADIANCE", "BOUNCED"} | material for material in subsets(MATERIAL_DEFINES)),
        ]
        composites = [set[str](), {"PAPER"}, {"PAPER", "WORLD"}, {"PAPER", "WORLD", ENVIRONMENT_DEFINE}]
        for layers in ("LAYERS 1", "LAYERS 2"):
            yield from (_program(frozenset({layers} | first | last)) for first in sent for last in composites)
            yield _paper_direct_program(frozenset({layers}))

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Gather once for each bounce; all but the last in all layers."""
        self._device.context.enable_only(moderngl.NOTHING)
        lit = DIRECT_TARGET in planned.reads
        defines = planned.defines | ({"RADIANCE"} if lit else set[str]())
        target, *bounced = (written.name for written in planned.writes)
        gathering = gather_uniforms(frame)
        coarse = _gathering_at(frame, BOUNCE_DIVISOR)
        before = None
        for bounce in range(bounce_count(frame.settings.indirect.bounces, frame.scene) - 1 if lit else 0):
            into = bounced[bounce % 2]
            for layer in range(frame.plan.indirect.layers):
                self._gather(frame, planned, defines - {"PAPER"}, before, (into, layer), coarse)
            before = into
        self._gather(frame, planned, defines, before, (target, 0), gathering)
        if lit and "PAPER" in defines:
            self._darken_direct_light(frame, planned)

    def _gather(
        self,
        frame: Frame,
        planned: PlannedPass,
        defines: frozenset[str],
        before: str | None,
        into: tuple[str, int],
        gathering: dict[str, object],
    ) -> None:
        """One bounce; `before`: the target of the bounce before, None for direct light."""
        spec = _program(defines | {"BOUNCED"} if before else defines - set(MATERIAL_DEFINES))
        self._fullscreen.bind(frame, spec, planned)
        if before:
            frame.pool.texture(before).use(spec.samplers.index(BOUNCED_SAMPLER))
        self._draw(frame, spec, into, gathering)

    def _darken_direct_light(self, frame: Frame, planned: PlannedPass) -> None:
        """Multiply the nearest layer's direct light by what the authors' composite leaves of it."""
        spec = _paper_direct_program(planned.defines)
        reads = tuple(name for name in planned.reads if name != DIRECT_TARGET)
        self._fullscreen.bind(frame, spec, PlannedPass(planned.name, reads))
        self._device.context.enable_only(moderngl.BLEND)
        self._device.context.blend_func = moderngl.ZERO, moderngl.SRC_COLOR
        self._draw(frame, spec, (DIRECT_TARGET, 0), _gathering_at(frame, 1))

    def _draw(self, frame: Frame, spec: ProgramSpec, into: tuple[str, int], gathering: dict[str, object]) -> None:
        world = frame.scene.world
        if ENVIRONMENT_DEFINE in spec.defines and world.environment is not None:
            frame.environment.bind(world.environment, spec)
        frame.pool.framebuffer((into,)).use()
        self._fullscreen.draw(spec, **environment_uniforms(world), **gathering, **tap_uniforms(frame), layer=into[1])


def _gathering_at(frame: Frame, divisor: int) -> dict[str, object]:
    """`gather_uniforms` for texels of `divisor`² pixels."""
    offset = gather_offset(divisor, frame.sample.index)
    return gather_uniforms(frame) | {"gather_divisor": divisor, "gather_offset": offset}


def bounce_count(bounces: int | None, scene: Scene) -> int:
    """How often light is gathered; None for as long as the scene's brightest material leaves something to be seen."""
    if bounces is not None:
        return bounces
    brightest = max((max(material.base_color) for material in scene.materials.values()), default=0.0)
    if brightest <= _LAST_BOUNCE:
        return 1
    return min(ceil(log(_LAST_BOUNCE) / log(brightest)), MOST_BOUNCES) if brightest < 1.0 else MOST_BOUNCES


def _program(defines: frozenset[str]) -> ProgramSpec:
    samplers = (BOUNCED_SAMPLER, BLURS_SAMPLER)
    defines |= {f"BOUNCE_DIVISOR {BOUNCE_DIVISOR}"}
    return fullscreen_program("radiosity/radiosity.frag", RADIOSITY_UNIFORMS, defines, samplers=samplers)


def _paper_direct_program(defines: frozenset[str]) -> ProgramSpec:
    layers = frozenset(define for define in defines if define.startswith("LAYERS"))
    return fullscreen_program("radiosity/paper_direct.frag", RADIOSITY_UNIFORMS, layers)
