# SPDX-License-Identifier: GPL-3.0-or-later
"""Every layer's channels in one multi-layer EXR."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from ..scene.arrays import Float32Array
from .exr import write_channels


class Layer(Protocol):
    """One layer of a deep G-buffer: (H, W) or (H, W, 3) float32, row 0 at the bottom.

    `depth` is view depth in metres, +inf where the layer is empty; radiance is scene-linear, normals world-space.
    """

    @property
    def depth(self) -> Float32Array: ...
    @property
    def radiance(self) -> Float32Array: ...
    @property
    def normal(self) -> Float32Array: ...
    @property
    def albedo(self) -> Float32Array: ...
    @property
    def metallic(self) -> Float32Array: ...
    @property
    def roughness(self) -> Float32Array: ...
    @property
    def emission(self) -> Float32Array: ...
    @property
    def object_index(self) -> Float32Array: ...


CHANNELS = (
    ("Radiance", "radiance", "RGB"),
    ("Normal", "normal", "XYZ"),
    ("Albedo", "albedo", "RGB"),
    ("Metallic", "metallic", "V"),
    ("Roughness", "roughness", "V"),
    ("Emission", "emission", "RGB"),
    ("ObjectIndex", "object_index", "X"),
)


def write_layers(path: Path, layers: Sequence[Layer]) -> None:
    """Write `layers` as one part with channels `layer0.Depth.Z`, `layer0.Radiance.R`, …, float32.

    Blender opens the file as a multi-layer image and shows each layer's passes; tools that split names at dots show
    the same. Empty pixels have depth 1e10, as Blender's own Depth pass, and 0 elsewhere. Raises OSError.
    """
    channels: dict[str, Float32Array] = {}
    for index, layer in enumerate(layers):
        depth = np.where(np.isfinite(layer.depth), layer.depth, np.float32(1e10)).astype(np.float32)
        channels[f"layer{index}.Depth.Z"] = depth
        for name, attribute, letters in CHANNELS:
            image = getattr(layer, attribute)
            planes = image[..., None] if image.ndim == 2 else image
            for channel, letter in enumerate(letters):
                channels[f"layer{index}.{name}.{letter}"] = planes[..., channel]
    write_channels(path, channels)
