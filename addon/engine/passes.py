# SPDX-License-Identifier: GPL-3.0-or-later
"""The one table of output passes: registered with Blender, asked of the renderer and written from here."""

from collections.abc import Mapping
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
    """

    channel: Channel
    flag: str
    names: tuple[str, str]
    channel_ids: str
    kind: Literal["VALUE", "VECTOR", "COLOR"]

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
    OutputPass(Channel.OBJECT_INDEX, "use_pass_object_index", ("IndexOB", "Object Index"), "X", "VALUE"),
)


def requested(view_layer: bpy.types.ViewLayer) -> tuple[OutputPass, ...]:
    """The passes that `view_layer` asks for, Combined first."""
    return tuple(item for item in PASSES if not item.flag or getattr(view_layer, item.flag))


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
