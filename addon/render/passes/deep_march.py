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

BOUNCED_SAMPLER = "bounced_layers"


class DeepMarchPass(FullscreenPass):
    """Gathers the irradiance of the nearest layer; for further bounces that of all layers before, as often as needed."""

    name = "deep_march"
    block = DEEP_MARCH_UNIFORMS

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """Every one for two layers; one, and more than two, with everything else."""
        shown = ("", f"DEBUG_{DebugView.MARCH_HITS.value}", f"DEBUG_{DebugView.LIGHT_ORIGIN.value}")
        for defines in subsets(("EXIT", "RADIANCE", "BOUNCED", "WORLD", ENVIRONMENT_DEFINE)):
            for view in shown:
                yield _program(defines | {"LAYERS 2", view} - {""})
        for layers in (1, 3, 8):
            yield _program(frozenset({f"LAYERS {layers}", "EXIT", "RADIANCE", "BOUNCED", "WORLD", ENVIRONMENT_DEFINE}))

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Bounce, then gather what is seen."""
        self._device.context.enable_only(moderngl.NOTHING)
        defines = set(planned.defines)
        if "direct.radiance" in planned.reads:
            defines.add("RADIANCE")
        bounced = self._bounce(frame, planned, frozenset(name for name in defines if not name.startswith("DEBUG_")))
        spec = _program(frozenset(defines | ({"BOUNCED"} if bounced else set[str]())))
        shown = tuple((target.name, 0) for target in planned.writes if target.name not in BOUNCE_TARGETS)
        self._gather(frame, planned, spec, shown, bounced, gather_uniforms(frame), 0)

    def _bounce(self, frame: Frame, planned: PlannedPass, defines: frozenset[str]) -> str:
        """The target that holds the irradiance of all layers before the last bounce; empty where there is none."""
        result, index = "", frame.sample.index
        if not any(target.name in BOUNCE_TARGETS for target in planned.writes):
            return result
        for bounce in range(bounces_before_last(frame)):
            target = BOUNCE_TARGETS[bounce % 2]
            spec = _program(defines | ({"BOUNCED"} if result else set[str]()))
            uniforms = gather_uniforms(frame) | {
                "gather_divisor": BOUNCE_DIVISOR,
                "gather_offset": gather_offset(BOUNCE_DIVISOR, index),
                "gather_rays": frame.settings.indirect.rays,
            }
            for layer in range(frame.plan.indirect.layers):
                self._gather(frame, planned, spec, ((target, layer),), result, uniforms, layer)
            result = target
        return result

    def _gather(
        self,
        frame: Frame,
        planned: PlannedPass,
        spec: ProgramSpec,
        into: tuple[tuple[str, int], ...],
        bounced: str,
        uniforms: dict[str, object],
        layer: int,
    ) -> None:
        self._fullscreen.bind(frame, spec, planned)
        if bounced:
            frame.pool.texture(bounced).use(spec.samplers.index(BOUNCED_SAMPLER))
        world = frame.scene.world
        if ENVIRONMENT_DEFINE in spec.defines and world.environment is not None:
            frame.environment.bind(world.environment, spec)
        frame.pool.framebuffer(into).use()
        self._fullscreen.draw(
            spec,
            **environment_uniforms(world),
            **uniforms,
            march_reach=frame.settings.indirect.march_distance or FARTHEST,
            march_steps=frame.settings.indirect.march_steps,
            layer=layer,
        )


FARTHEST = 1e30
"""Metres: no limit, as `common/deep_march.glsl` has it."""


def bounces_before_last(frame: Frame) -> int:
    """How often light bounces among the layers before it is gathered."""
    bounces = frame.settings.indirect.bounces
    return 8 if bounces is None else bounces - 1


def _program(defines: frozenset[str]) -> ProgramSpec:
    return fullscreen_program(
        "deep_march/deep_march.frag", DEEP_MARCH_UNIFORMS, defines, samplers=(MAP_SAMPLER, BOUNCED_SAMPLER)
    )
