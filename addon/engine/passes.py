# SPDX-License-Identifier: GPL-3.0-or-later
"""The one table of output passes: registered with Blender, asked of the renderer and written from here."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import bpy
import numpy as np

from ..scene import Channel
from ..scene.arrays import Float32Array


@dataclass(frozen=True)
class OutputPass:
    """One pass of Blender's render result.

    `flag`: the view layer's property that asks for it; empty for the pass that is always there.
    `names`: its name before Blender 5.0 and since.
    `channel_ids`: one letter per channel. `kind`: Blender's socket type.
    `color`: the channel whose colour the light is divided by; None where the pass is `channel` itself.
    """

    channel: Channel
    flag: str
    names: tuple[str, str]
    channel_ids: str
    kind: Literal["VALUE", "VECTOR", "COLOR"]
    color: Channel | None = None

    @property
    def name(self) -> str:
        """The name in the running Blender."""
        return self.names[bpy.app.version >= (5, 0, 0)]


PASSES = (
    OutputPass(Channel.COMBINED, "", ("Combined", "Combined"), "RGBA", "COLOR"),
    OutputPass(Channel.DEPTH, "use_pass_z", ("Depth", "Depth"), "Z", "VALUE"),
    OutputPass(Channel.NORMAL, "use_pass_normal", ("Normal", "Normal"), "XYZ", "VECTOR"),
    OutputPass(Channel.POSITION, "use_pass_position", ("Position", "Position"), "XYZ", "VECTOR"),
    OutputPass(Channel.DIFFUSE_COLOR, "use_pass_diffuse_color", ("DiffCol", "Diffuse Color"), "RGB", "COLOR"),
    OutputPass(
        Channel.DIFFUSE_DIRECT,
        "use_pass_diffuse_direct",
        ("DiffDir", "Diffuse Direct"),
        "RGB",
        "COLOR",
        Channel.DIFFUSE_COLOR,
    ),
    OutputPass(
        Channel.DIFFUSE_INDIRECT,
        "use_pass_diffuse_indirect",
        ("DiffInd", "Diffuse Indirect"),
        "RGB",
        "COLOR",
        Channel.DIFFUSE_COLOR,
    ),
    OutputPass(Channel.GLOSSY_COLOR, "use_pass_glossy_color", ("GlossCol", "Glossy Color"), "RGB", "COLOR"),
    OutputPass(
        Channel.GLOSSY_DIRECT,
        "use_pass_glossy_direct",
        ("GlossDir", "Glossy Direct"),
        "RGB",
        "COLOR",
        Channel.GLOSSY_COLOR,
    ),
    OutputPass(Channel.EMISSION, "use_pass_emit", ("Emit", "Emission"), "RGB", "COLOR"),
    OutputPass(Channel.ENVIRONMENT, "use_pass_environment", ("Env", "Environment"), "RGB", "COLOR"),
    OutputPass(Channel.OBJECT_INDEX, "use_pass_object_index", ("IndexOB", "Object Index"), "X", "VALUE"),
)


def requested(view_layer: bpy.types.ViewLayer) -> tuple[OutputPass, ...]:
    """The passes that `view_layer` asks for, Combined first."""
    return tuple(item for item in PASSES if not item.flag or getattr(view_layer, item.flag))


def channels(wanted: Iterable[OutputPass]) -> frozenset[Channel]:
    """What the renderer must deliver for these passes."""
    return frozenset(item for each in wanted for item in (each.channel, each.color) if item is not None)


def images(wanted: Iterable[OutputPass], delivered: Mapping[Channel, Float32Array]) -> dict[str, Float32Array]:
    """(H, W, C) float32 of each pass by its name in the running Blender, from all its channels (H, W, C)."""
    return {item.name: _image(item, delivered) for item in wanted}


def _image(item: OutputPass, delivered: Mapping[Channel, Float32Array]) -> Float32Array:
    pixels = delivered[item.channel]
    return pixels if item.color is None else over(pixels, delivered[item.color])


def over(light: Float32Array, color: Float32Array) -> Float32Array:
    """`light` divided by the `color` that reflects it, both (H, W, 3) float32, as compositors multiply them again.

    A channel whose colour is 0 gets the mean of those that have a colour, so that it is grey where it cannot be known;
    black where none has one. Cycles' passes are divided so (`safe_divide_even_color`).
    """
    colored = color != 0.0
    quotient = np.divide(light, color, out=np.zeros_like(light), where=colored)
    count = colored.sum(axis=-1, keepdims=True)
    mean = quotient.sum(axis=-1, keepdims=True) / np.maximum(count, 1)
    return np.where(colored, quotient, mean.astype(np.float32))


def register(engine: bpy.types.RenderEngine, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> None:
    """Tell Blender which passes `view_layer` will deliver."""
    for item in requested(view_layer):
        engine.register_pass(scene, view_layer, item.name, len(item.channel_ids), item.channel_ids, item.kind)


def write(result: Any, images: Mapping[str, Float32Array]) -> None:
    """Fill the passes of `result`, every stereo view alike.

    `images` holds (H, W, C) float32 of `result`'s resolution by pass name, row 0 at the bottom.
    """
    for layer in result.layers:
        for render_pass in layer.passes:
            if render_pass.name in images:
                pixels = np.ascontiguousarray(images[render_pass.name], dtype=np.float32)
                render_pass.rect.foreach_set(pixels.ravel())
