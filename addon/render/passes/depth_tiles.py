# SPDX-License-Identifier: GPL-3.0-or-later
"""Between which view depths the surfaces of each tile and layer are: what lights and shadow maps are fitted to."""

from collections.abc import Iterator

import moderngl

from ..layout import DEPTH_TILES_TARGET, TILE_SIZE
from ..plan import PlannedPass
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .base import Frame
from .fullscreen import FullscreenPass, fullscreen_program

DEPTH_TILES_UNIFORMS = UniformBlock("DepthTilesUniforms", (("layer", "int"),))


class DepthTilesPass(FullscreenPass):
    """Reduces the view depth of each layer of the deep G-buffer to its tiles' ranges."""

    name = "depth_tiles"
    block = DEPTH_TILES_UNIFORMS

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """The only one."""
        yield _program()

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Reduce all layers."""
        spec = _program()
        self._device.context.enable_only(moderngl.NOTHING)
        self._fullscreen.bind(frame, spec, planned)
        for layer in range(frame.plan.layers):
            frame.pool.framebuffer(((DEPTH_TILES_TARGET, layer),)).use()
            self._fullscreen.draw(spec, layer=layer)


def _program() -> ProgramSpec:
    defines = frozenset({f"TILE_SIZE {TILE_SIZE}"})
    return fullscreen_program("depth_tiles/depth_tiles.frag", DEPTH_TILES_UNIFORMS, defines)
