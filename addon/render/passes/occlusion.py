# SPDX-License-Identifier: GPL-3.0-or-later
"""Ambient obscurance: the world's light, as far as the layers around each pixel leave it open."""

from collections.abc import Iterator

import moderngl

from ..environment import BLURS_SAMPLER, ENVIRONMENT_DEFINE, ENVIRONMENT_UNIFORMS, environment_uniforms
from ..gathering import GATHER_UNIFORMS, gather_uniforms
from ..plan import PlannedPass
from ..programs import ProgramSpec
from ..screen_taps import TAP_UNIFORMS, tap_uniforms
from ..uniforms import UniformBlock
from .base import Frame
from .fullscreen import FullscreenPass, fullscreen_program

OCCLUSION_UNIFORMS = UniformBlock("OcclusionUniforms", (*ENVIRONMENT_UNIFORMS, *GATHER_UNIFORMS, *TAP_UNIFORMS))


class OcclusionPass(FullscreenPass):
    """Writes the nearest layer's irradiance from the world, by ambient obscurance or by SSAO."""

    name = "occlusion"
    block = OCCLUSION_UNIFORMS

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """Both methods, with a map of the world and without, one layer and several."""
        for method in ("OCCLUSION", "SSAO"):
            for layers in ("LAYERS 1", "LAYERS 2"):
                yield _program(frozenset({method, layers}))
                yield _program(frozenset({method, layers, ENVIRONMENT_DEFINE}))

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Gather once."""
        spec, world = _program(planned.defines), frame.scene.world
        self._device.context.enable_only(moderngl.NOTHING)
        frame.pool.framebuffer(((planned.writes[0].name, 0),)).use()
        self._fullscreen.bind(frame, spec, planned)
        if world.environment is not None:
            frame.environment.bind(world.environment, spec)
        self._fullscreen.draw(spec, **environment_uniforms(world), **gather_uniforms(frame), **tap_uniforms(frame))


def _program(defines: frozenset[str]) -> ProgramSpec:
    return fullscreen_program("occlusion/occlusion.frag", OCCLUSION_UNIFORMS, defines, samplers=(BLURS_SAMPLER,))
