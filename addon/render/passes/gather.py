# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance of what is seen: by rays through the layers near each pixel, the radiance grid behind, and the world."""

from collections.abc import Iterator

import moderngl

from ..environment import ENVIRONMENT_DEFINE, ENVIRONMENT_SAMPLERS, ENVIRONMENT_UNIFORMS, environment_uniforms
from ..gathering import GATHER_UNIFORMS, gather_uniforms
from ..grid.radiance import START_OFFSET
from ..grid.textures import GRID_DEFINES, GRID_UNIFORMS, grid_uniforms
from ..planned_pass import PlannedPass
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .base import Frame, subsets
from .fullscreen import FullscreenPass, fullscreen_program

GATHER_BLOCK = UniformBlock(
    "GatherUniforms",
    (
        *GRID_UNIFORMS,
        *ENVIRONMENT_UNIFORMS,
        *GATHER_UNIFORMS,
        ("contact_steps", "int"),  # of a ray through the layers
    ),
)

CONTACT_REACH = 1.0
"""Cells that a ray goes through the layers before it goes on through the grid: what is nearer than that is not told
apart by cells. Two cells made Sponza worse (FLIP .109 for .099): on the screen less is known."""

_FACE_TEXTURES = {
    "face_planes": "planes",
    "face_radiance": "radiance",
    "face_indirect": "indirect",
    "face_emission": "emission",
}
_SAMPLERS = ("grid_cells", *_FACE_TEXTURES, *ENVIRONMENT_SAMPLERS)
_SHOWN = ("DEBUG_GRID_CELLS", "DEBUG_GRID_RADIANCE", "DEBUG_MARCH_HITS", "DEBUG_LIGHT_ORIGIN")


class GatherPass(FullscreenPass):
    """Gathers one texel for every few pixels."""

    name = "gather"
    block = GATHER_BLOCK

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """Every number of layers that differs in code, with and without exit surfaces, world and debug views."""
        for layers in (1, 2, 8):
            for defines in subsets(("CONTACT", "EXIT", "RADIANCE", "SAMPLED_EMISSION", "WORLD", "ENVIRONMENT")):
                if ENVIRONMENT_DEFINE not in defines or "WORLD" in defines:
                    yield _program(defines | {f"LAYERS {layers}"})
        for shown in _SHOWN:
            yield _program(frozenset({shown, "CONTACT", "WORLD", "LAYERS 2"}))

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Gather one sample."""
        grid, world = frame.grid, frame.scene.world
        assert grid is not None
        spec = _program(planned.defines)
        self._device.context.enable_only(moderngl.NOTHING)
        self._fullscreen.bind(frame, spec, planned)
        grid.cells.use(spec.samplers.index("grid_cells"))
        for sampler, name in _FACE_TEXTURES.items():
            grid.texture(name).use(spec.samplers.index(sampler))
        if ENVIRONMENT_DEFINE in planned.defines and world.environment is not None:
            frame.environment.bind(world.environment, spec)
        frame.pool.framebuffer(tuple((target.name, 0) for target in planned.writes)).use()
        self._fullscreen.draw(
            spec,
            **grid_uniforms(grid.levels, frame.view.position),
            **environment_uniforms(world),
            **gather_uniforms(frame),
            contact_steps=frame.settings.indirect.contact_steps,
        )


def _program(defines: frozenset[str]) -> ProgramSpec:
    sizes = {f"START_OFFSET {START_OFFSET}", f"CONTACT_REACH {CONTACT_REACH}"}
    return fullscreen_program("gather/gather.frag", GATHER_BLOCK, defines | sizes | GRID_DEFINES, samplers=_SAMPLERS)
