# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of many lights may reach each tile and layer of the picture, as bit masks that the direct pass walks."""

from collections.abc import Iterator

import moderngl

from ..layout import LIGHT_TILES_TARGET, LIGHTS_PER_PAGE, TILE_SIZE
from ..light_table import LIGHTS_PER_ROW, TEXELS_PER_LIGHT, TEXELS_PER_SAMPLE
from ..plan import PlannedPass
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .base import Frame
from .fullscreen import FullscreenPass, fullscreen_program

LIGHT_TILES_UNIFORMS = UniformBlock("LightTilesUniforms", (("layer", "int"), ("page", "int"), ("light_count", "int")))


class LightTilesPass(FullscreenPass):
    """Tests every light of the sample against every tile."""

    name = "light_tiles"
    block = LIGHT_TILES_UNIFORMS

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """The only one."""
        yield _program()

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Write the masks of all layers, in pages of 128 lights."""
        spec = _program()
        self._device.context.enable_only(moderngl.NOTHING)
        self._fullscreen.bind(frame, spec, planned)
        frame.lighting.table().use(spec.samplers.index("light_table"))
        frame.lighting.upload_samples().use(spec.samplers.index("light_samples"))
        pages = frame.pool.texture(LIGHT_TILES_TARGET).layers // frame.plan.layers
        for layer in range(frame.plan.layers):
            for page in range(pages):
                frame.pool.framebuffer(((LIGHT_TILES_TARGET, layer * pages + page),)).use()
                self._fullscreen.draw(spec, layer=layer, page=page, light_count=frame.lighting.count)


def _program() -> ProgramSpec:
    defines = {
        f"TILE_SIZE {TILE_SIZE}",
        f"LIGHTS_PER_PAGE {LIGHTS_PER_PAGE}",
        f"LIGHTS_PER_ROW {LIGHTS_PER_ROW}",
        f"TEXELS_PER_LIGHT {TEXELS_PER_LIGHT}",
        f"TEXELS_PER_SAMPLE {TEXELS_PER_SAMPLE}",
    }
    return fullscreen_program(
        "light_tiles/light_tiles.frag",
        LIGHT_TILES_UNIFORMS,
        frozenset(defines),
        samplers=("light_table", "light_samples"),
    )
