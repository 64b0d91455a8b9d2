# SPDX-License-Identifier: GPL-3.0-or-later
"""The deep G-buffer's channels: what is stored per pixel and layer, in which format."""

from dataclasses import dataclass
from math import inf

_BYTES = {"f4": 4, "f2": 2, "f1": 1, "nu2": 2, "u2": 2}


@dataclass(frozen=True)
class TargetSpec:
    """A texture array that passes write and read.

    `components` 1, 2 or 4 of moderngl's `dtype` (f4/f2 floats, f1/nu2 normalised 8/16 bit, u2 unsigned 16 bit).
    `layers`: array size. `clear`: value of every component where nothing is drawn.
    """

    name: str
    components: int
    dtype: str
    layers: int = 1
    clear: float = 0.0

    @property
    def bytes_per_pixel(self) -> int:
        """Bytes of one pixel over all layers."""
        return self.components * _BYTES[self.dtype] * self.layers


@dataclass(frozen=True)
class GBufferChannel:
    """One channel: its format and the GLSL output that writes it; `meaning` is its row in the README's table."""

    name: str
    components: int
    dtype: str
    glsl_type: str
    meaning: str
    clear: float = 0.0

    def target(self, layers: int) -> TargetSpec:
        """The texture array that holds this channel for `layers` layers."""
        return TargetSpec(f"gbuffer.{self.name}", self.components, self.dtype, layers, self.clear)


MOTION = GBufferChannel("motion", 2, "f2", "vec2", "pixels moved since the previous frame")
"""The slot of the motion vectors. No pass reads it yet, so no plan has it and no shader variant writes it."""

CHANNELS = (
    GBufferChannel("view_depth", 1, "f4", "float", "linear depth along the view axis, m; +inf where empty", inf),
    GBufferChannel("normal", 2, "nu2", "vec2", "world-space shading normal facing the viewer, octahedral"),
    GBufferChannel("base_color", 4, "f2", "vec4", "scene-linear base colour; alpha holds F0, the specular reflectance"),
    GBufferChannel("material", 2, "f1", "vec2", "metallic, roughness"),
    GBufferChannel("emission", 4, "f4", "vec4", "emitted radiance, W/(sr·m²)"),
    GBufferChannel("object_index", 1, "u2", "uint", "Blender's pass index"),
    MOTION,
)

DEPTH_BYTES = 4
"""The 32-bit float hardware depth buffer, shared by all layers."""


ORACLES = (TargetSpec("gbuffer.oracle_0", 1, "f4", 1, inf), TargetSpec("gbuffer.oracle_1", 1, "f4", 1, inf))
"""View depth of the layer being drawn, and of the one before, which fragments are tested against; in turns."""


def outputs_glsl(channels: tuple[GBufferChannel, ...], *, oracle: bool) -> str:
    """GLSL fragment output declarations in attachment order: the channels that are written, then the oracle."""
    outputs = [(channel.glsl_type, channel.name) for channel in channels] + [("float", "oracle")] * oracle
    return "".join(
        f"layout(location = {index}) out {glsl_type} out_{name};\n" for index, (glsl_type, name) in enumerate(outputs)
    )
