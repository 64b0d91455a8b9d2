# SPDX-License-Identifier: GPL-3.0-or-later
"""Indirect light by rays marched through the layers of the deep G-buffer; bounces at a low resolution before that."""

from collections.abc import Iterator

import moderngl

from ...scene import DebugView
from ..environment import ENVIRONMENT_DEFINE, ENVIRONMENT_UNIFORMS, MAP_SAMPLER, environment_uniforms
from ..gathering import GATHER_UNIFORMS, gather_offset, gather_uniforms
from ..indirect_plan import BOUNCE_DIVISOR, BOUNCE_TARGETS
from ..plan import PlannedPass
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .base import Frame, subsets
from .fullscreen import FullscreenPass, fullscreen_program
from .radiosity import BOUNCED_SAMPLER, bounce_count

DEEP_MARCH_UNIFORMS = UniformBlock(
    "DeepMarchUniforms",
    (
        *ENVIRONMENT_UNIFORMS,
        *GATHER_UNIFORMS,
        ("march_reach", "float"),  # m
        ("march_steps", "int"),
        ("layer", "int"),  # whose irradiance is found
    ),
)

FARTHEST = 1e30
"""Metres: no limit, as `common/deep_march.glsl` has it."""

_ORIGIN_DEFINES = tuple(f"DEBUG_{view.value}" for view in (DebugView.MARCH_HITS, DebugView.LIGHT_ORIGIN))


class DeepMarchPass(FullscreenPass):
    """Writes the nearest layer's irradiance; for further bounces first that of all layers, as often as it takes."""

    name = "deep_march"
    block = DEEP_MARCH_UNIFORMS

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """Everything there is for two layers; for other numbers of layers with and without exit surfaces."""
        for defines in subsets(("EXIT", "RADIANCE", "SAMPLED_EMISSION", "BOUNCED", "WORLD", ENVIRONMENT_DEFINE)):
            if ENVIRONMENT_DEFINE not in defines or "WORLD" in defines:
                yield _program(defines | {"LAYERS 2"})
        for shown in _ORIGIN_DEFINES:
            yield _program(frozenset({shown, "LAYERS 2", "EXIT", "RADIANCE", "BOUNCED", "WORLD"}))
        for layers in ("LAYERS 1", "LAYERS 3", "LAYERS 8"):
            for defines in subsets(("EXIT",)):
                yield _program(defines | {layers, "RADIANCE", "WORLD"})

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Gather once for each bounce; all but the last in all layers and for few texels, which bounds what it takes:
        at most 1/8² of the rays of a full-resolution picture per bounce and layer."""
        self._device.context.enable_only(moderngl.NOTHING)
        lit = "direct.radiance" in planned.reads
        defines = planned.defines | ({"RADIANCE"} if lit else set[str]())
        gathering = gather_uniforms(frame)
        offset = gather_offset(BOUNCE_DIVISOR, frame.sample.index)
        coarse = gathering | {"gather_divisor": BOUNCE_DIVISOR, "gather_offset": offset}
        before = None
        for bounce in range(bounce_count(frame.settings.indirect.bounces, frame.scene) - 1):
            into = BOUNCE_TARGETS[bounce % 2]
            for layer in range(frame.plan.indirect.layers):
                self._gather(frame, planned, defines - set(_ORIGIN_DEFINES), before, ((into, layer),), coarse)
            before = into
        shown = tuple((target.name, 0) for target in planned.writes if target.name not in BOUNCE_TARGETS)
        self._gather(frame, planned, defines, before, shown, gathering)

    def _gather(
        self,
        frame: Frame,
        planned: PlannedPass,
        defines: frozenset[str],
        before: str | None,
        into: tuple[tuple[str, int], ...],
        gathering: dict[str, object],
    ) -> None:
        """One bounce; `before`: the target of the bounce before, None where there is none."""
        spec = _program(defines | ({"BOUNCED"} if before else set[str]()))
        self._fullscreen.bind(frame, spec, planned)
        if before:
            frame.pool.texture(before).use(spec.samplers.index(BOUNCED_SAMPLER))
        world, indirect = frame.scene.world, frame.settings.indirect
        if ENVIRONMENT_DEFINE in spec.defines and world.environment is not None:
            frame.environment.bind(world.environment, spec)
        frame.pool.framebuffer(into).use()
        self._fullscreen.draw(
            spec,
            **environment_uniforms(world),
            **gathering,
            march_reach=indirect.march_distance or FARTHEST,
            march_steps=indirect.march_steps,
            layer=into[0][1],
        )


def _program(defines: frozenset[str]) -> ProgramSpec:
    defines |= {f"BOUNCE_DIVISOR {BOUNCE_DIVISOR}"}
    samplers = (MAP_SAMPLER, BOUNCED_SAMPLER)
    return fullscreen_program("deep_march/deep_march.frag", DEEP_MARCH_UNIFORMS, defines, samplers=samplers)
