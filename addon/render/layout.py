# SPDX-License-Identifier: GPL-3.0-or-later
"""The deep G-buffer's channels: what is stored per pixel and layer, in which format."""

from dataclasses import dataclass
from math import inf

_BYTES = {"f4": 4, "f2": 2, "f1": 1, "nu2": 2, "u2": 2, "u4": 4}
_OPENGL_NAMES = {"f4": "32F", "f2": "16F", "f1": "8", "nu2": "16", "u2": "16UI", "u4": "32UI"}

TILE_SIZE = 16
"""Pixels along each side of the tiles that lights are sorted into; those at the right and upper edge may be smaller."""


@dataclass(frozen=True)
class TargetSpec:
    """A texture array that passes write and read.

    `components` 1, 2 or 4 of moderngl's `dtype` (f4/f2 floats, f1/nu2 normalised 8/16 bit, u2/u4 unsigned 16/32 bit).
    `layers`: array size. `clear`: value of every component where nothing is drawn. `guarded`: whether the guard band
    surrounds it; otherwise it has the picture's own size. `divisor`: pixels along each side of what one texel is for,
    counted from the lower left corner of all that.
    """

    name: str
    components: int
    dtype: str
    layers: int = 1
    clear: float = 0.0
    guarded: bool = True
    divisor: int = 1

    @property
    def bytes_per_texel(self) -> int:
        """Bytes of one texel over all layers."""
        return self.components * _BYTES[self.dtype] * self.layers

    def size(self, covered: tuple[int, int]) -> tuple[int, int]:
        """Width and height in texels of what covers so many pixels."""
        width, height = covered
        return -(-width // self.divisor), -(-height // self.divisor)


@dataclass(frozen=True)
class GBufferChannel:
    """One channel: its format and the GLSL output that writes it.

    `meaning` is its row in the README's table; `group` names the pass that writes it.
    """

    name: str
    components: int
    dtype: str
    glsl_type: str
    meaning: str
    clear: float = 0.0
    group: str = "gbuffer"

    @property
    def target_name(self) -> str:
        """The name of the texture array that holds this channel."""
        return f"{self.group}.{self.name}"

    def target(self, layers: int) -> TargetSpec:
        """The texture array that holds this channel for `layers` layers."""
        return TargetSpec(self.target_name, self.components, self.dtype, layers, self.clear)


CHANNELS = (
    GBufferChannel("view_depth", 1, "f4", "float", "linear depth along the view axis, m; +inf where empty", inf),
    GBufferChannel("normal", 2, "nu2", "vec2", "world-space shading normal facing the viewer, octahedral"),
    GBufferChannel("base_color", 4, "f2", "vec4", "scene-linear base colour; alpha holds F0, the specular reflectance"),
    GBufferChannel(
        "material", 4, "f1", "vec4", "metallic, roughness, diffuse roughness, and the link group of lights, 0…63"
    ),
    GBufferChannel(
        "emission", 4, "f2", "vec4", "emitted radiance, W/(sr·m²), over 2^alpha: one exponent for all three"
    ),
    GBufferChannel("object_index", 1, "u2", "uint", "Blender's pass index"),
    GBufferChannel("motion", 2, "f2", "vec2", "pixels moved since the previous frame, x right and y up"),
)
"""What the G-buffer holds of the nearest surface of every layer."""

EXIT_CHANNELS = (
    GBufferChannel(
        "view_depth", 1, "f4", "float", "linear depth of the first back face behind, m; +inf where none", inf, "exit"
    ),
    GBufferChannel("normal", 2, "f1", "vec2", "normal of the exit surface facing the viewer, octahedral", 0.0, "exit"),
    GBufferChannel("base_color", 4, "f1", "vec4", "albedo of the exit surface", 0.0, "exit"),
)
"""What it holds of the surface where a ray that enters a layer leaves the solid behind it."""

DEPTH_BYTES = 4
"""One layer of the 32-bit float hardware depth array."""

DEPTH_TILES_TARGET = "tiles.depth"
"""Nearest and farthest finite view depth (m) of each tile and layer, (+inf, −inf) where all of it is empty."""


def depth_tiles_target(layers: int) -> TargetSpec:
    """What the depth_tiles pass writes for as many layers of the deep G-buffer."""
    return TargetSpec(DEPTH_TILES_TARGET, 2, "f4", layers, divisor=TILE_SIZE)


LIGHT_TILES_TARGET = "tiles.lights"
"""Bit masks of the lights that may reach each tile: of every layer in turn, as many pages as all lights need."""

LIGHTS_PER_PAGE = 128
"""Bits of a texel."""


def light_pages(lights: int) -> int:
    """How many texels the masks of so many lights take, at least one."""
    return max(-(-lights // LIGHTS_PER_PAGE), 1)


def light_tiles_target(layers: int, lights: int) -> TargetSpec:
    """What the light_tiles pass writes for as many layers of the deep G-buffer and so many lights."""
    return TargetSpec(LIGHT_TILES_TARGET, 4, "u4", layers * light_pages(lights), divisor=TILE_SIZE)


def outputs_glsl(channels: tuple[GBufferChannel, ...]) -> str:
    """GLSL fragment output declarations of the channels that are written, in attachment order."""
    return "".join(
        f"layout(location = {index}) out {channel.glsl_type} out_{channel.name};\n"
        for index, channel in enumerate(channels)
    )


def channels_table() -> str:
    """The README's table of what a pixel and layer may hold, as Markdown, and the sums of its bytes."""
    rows = [channel.target(1) for channel in (*CHANNELS, *EXIT_CHANNELS)]
    meanings = [channel.meaning for channel in (*CHANNELS, *EXIT_CHANNELS)]
    lines = ["| target | format | bytes | holds |", "|---|---|---|---|"]
    for row, meaning in zip(rows, meanings, strict=True):
        texture_format = "RGBA"[: row.components] + _OPENGL_NAMES[row.dtype]
        lines.append(f"| {row.name} | {texture_format} | {row.bytes_per_texel} | {meaning} |")
    surface = sum(row.bytes_per_texel for row in rows[: len(CHANNELS)])
    both = sum(row.bytes_per_texel for row in rows)
    sums = f"{surface} of every layer, {both} with its exit surface, {both + DEPTH_BYTES} with its hardware depth"
    lines += ["", f"Bytes per pixel: {sums}."]
    return "\n".join(lines) + "\n"
