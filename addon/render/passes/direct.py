# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light: outgoing radiance of every layer from lamps, emissive surfaces, the world and the surface itself."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from math import sqrt

import moderngl

from ..direct_needs import DIRECT_DEFINES, direct_program_defines
from ..environment import ENVIRONMENT_DEFINE, ENVIRONMENT_SAMPLERS, ENVIRONMENT_UNIFORMS, environment_uniforms
from ..layout import LIGHTS_PER_PAGE, TILE_SIZE, light_pages
from ..light_table import LIGHTS_PER_ROW, TEXELS_PER_LIGHT, TEXELS_PER_SAMPLE
from ..plan import PlannedPass
from ..programs import ProgramSpec
from ..sampling import pixel_shift
from ..shadow_table import TEXELS_PER_MAP
from ..uniforms import UniformBlock
from .base import Frame
from .fullscreen import FullscreenPass, fullscreen_program

DIRECT_UNIFORMS = UniformBlock(
    "DirectUniforms",
    (
        *ENVIRONMENT_UNIFORMS,
        ("world_factors", "vec2"),  # on what it causes by diffuse and by glossy reflection
        ("shadow_jitter", "vec2"),  # texels from where a sample looks a shadow up
        ("pixel_shift", "vec2"),  # of every pixel's random numbers
        ("highlight_jitter", "float"),  # about half the distance between a light's samples, its half size being 1
        ("smallest_world_alpha", "float"),  # GGX roughness below which the world's samples show one by one
        ("light_count", "int"),
        ("light_tile_pages", "int"),
        ("layer", "int"),
    ),
)

LIGHT_SAMPLERS = ("light_table", "light_samples", *ENVIRONMENT_SAMPLERS)
LIGHT_TABLE_SIZES = frozenset(
    {
        f"LIGHTS_PER_ROW {LIGHTS_PER_ROW}",
        f"TEXELS_PER_LIGHT {TEXELS_PER_LIGHT}",
        f"TEXELS_PER_SAMPLE {TEXELS_PER_SAMPLE}",
    }
)

DIRECT_SIZES = LIGHT_TABLE_SIZES | {
    f"TEXELS_PER_MAP {TEXELS_PER_MAP}",
    f"TILE_SIZE {TILE_SIZE}",
    f"LIGHTS_PER_PAGE {LIGHTS_PER_PAGE}",
}
DIRECT_SAMPLERS = (*LIGHT_SAMPLERS, "shadow_atlas", "shadow_table")
"""What `common/direct_light.glsl` needs besides DIRECT_UNIFORMS."""

_DIRECTIONS_PER_LOBE = 8.0
"""The world's samples must fall that densely into a reflection's lobe, or a wider one is taken for what they show."""


class DirectPass(FullscreenPass):
    """Shades each layer of the deep G-buffer once."""

    name = "direct"
    block = DIRECT_UNIFORMS

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """What stands for every program that a plan can ask for."""
        yield from (_program(defines) for defines in program_defines(DIRECT_DEFINES))

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Shade all layers; the picture's own tells diffuse from glossy where somebody asks."""
        defines = direct_program_defines(planned.defines, preview=frame.lighting.preview)
        self._device.context.enable_only(moderngl.NOTHING)
        for layer in range(frame.plan.layers):
            split = layer == 0 and "SPLIT" in defines
            spec = _program(defines if split else defines - {"SPLIT"})
            self._fullscreen.bind(frame, spec, planned)
            bind_lights_and_shadows(frame, spec)
            targets = planned.writes if split else planned.writes[:1]
            frame.pool.framebuffer(tuple((target.name, layer) for target in targets)).use()
            self._fullscreen.draw(spec, **light_uniforms(frame), layer=layer)


def program_defines(names: Sequence[str]) -> list[frozenset[str]]:
    """Of programs that may have these defines: every two alone, with everything else, and left out of everything."""
    every = frozenset(names)
    pairs = [frozenset(pair) for pair in combinations(names, 2)]
    chosen = {every, frozenset({"EMISSION"}), *pairs, *(every - pair for pair in pairs)}
    chosen |= {every - {name} for name in every} | {pair | {"SPLIT"} for pair in pairs}
    programs = {direct_program_defines(defines, preview=preview) for defines in chosen for preview in (False, True)}
    return sorted(programs, key=sorted)


def bind_lights(frame: Frame, spec: ProgramSpec) -> None:
    """Bind what the lights of this sample and the world are to the units of LIGHT_SAMPLERS."""
    if "LIGHTS" in spec.defines:
        frame.lighting.table().use(spec.samplers.index("light_table"))
        frame.lighting.upload_samples().use(spec.samplers.index("light_samples"))
    if ENVIRONMENT_DEFINE in spec.defines and frame.scene.world.environment is not None:
        frame.environment.bind(frame.scene.world.environment, spec)


def bind_lights_and_shadows(frame: Frame, spec: ProgramSpec) -> None:
    """Bind those, and this sample's shadow maps, to the units of DIRECT_SAMPLERS."""
    bind_lights(frame, spec)
    if "SHADOWS" in spec.defines and frame.shadows is not None:
        if frame.shadows.atlas is not None:
            frame.shadows.atlas.use(spec.samplers.index("shadow_atlas"))
        frame.shadows.table.use(spec.samplers.index("shadow_table"))


def light_uniforms(frame: Frame) -> dict[str, object]:
    """DIRECT_UNIFORMS of this sample, except the layer."""
    world, lighting = frame.scene.world, frame.lighting
    shift = pixel_shift(frame.sample.index)
    directions = max(lighting.plan.world_directions * lighting.sample_count, 1)
    return {
        **environment_uniforms(world),
        "world_factors": lighting.world_factors,
        "shadow_jitter": (shift[0] - 0.5, shift[1] - 0.5),
        "pixel_shift": shift,
        "highlight_jitter": lighting.point_spacing,
        # A lobe of roughness α is about 4πα² wide; so many of the directions, spread over 4π, fall into it.
        "smallest_world_alpha": sqrt(_DIRECTIONS_PER_LOBE / directions),
        "light_count": lighting.count,
        "light_tile_pages": light_pages(lighting.plan.count) if lighting.plan.many else 0,
    }


def _program(defines: frozenset[str]) -> ProgramSpec:
    return fullscreen_program("direct/direct.frag", DIRECT_UNIFORMS, defines | DIRECT_SIZES, samplers=DIRECT_SAMPLERS)
