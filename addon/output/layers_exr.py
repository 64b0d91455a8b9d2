# SPDX-License-Identifier: GPL-3.0-or-later
"""Every layer's channels in one multi-layer EXR."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from ..scene.arrays import Float32Array
from .exr import write_channels


class Layer(Protocol):
    """One layer of a deep G-buffer: (H, W) or (H, W, C) float32, row 0 at the bottom.

    `depth` is view depth in metres, +inf where the layer is empty; radiance is scene-linear, normals world-space.
    `motion` is pixels since the previous frame (x right, y up); `exit_depth` is +inf where nothing is left again.
    Motion and exit surfaces are None where they were not rendered.
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
    @property
    def motion(self) -> Float32Array | None: ...
    @property
    def exit_depth(self) -> Float32Array | None: ...
    @property
    def exit_normal(self) -> Float32Array | None: ...
    @property
    def exit_albedo(self) -> Float32Array | None: ...


CHANNELS = (
    ("Depth", "depth", "Z"),
    ("Radiance", "radiance", "RGB"),
    ("Normal", "normal", "XYZ"),
    ("Albedo", "albedo", "RGB"),
    ("Metallic", "metallic", "V"),
    ("Roughness", "roughness", "V"),
    ("Emission", "emission", "RGB"),
    ("ObjectIndex", "object_index", "X"),
    ("Motion", "motion", "XYZ"),
    ("ExitDepth", "exit_depth", "Z"),
    ("ExitNormal", "exit_normal", "XYZ"),
    ("ExitAlbedo", "exit_albedo", "RGB"),
)
"""Pass, attribute, and a letter per channel; channels that an image lacks are 0: Blender 5 reads no pass of two."""

EMPTY_DEPTH = np.float32(1e10)
"""Depth where there is nothing, as in Blender's own Depth pass."""


def write_layers(path: Path, layers: Sequence[Layer]) -> None:
    """Write `layers` as one part with channels `layer0.Depth.Z`, `layer0.Radiance.R`, …, float32.

    Blender opens the file as a multi-layer image and shows each layer's passes; tools that split names at dots show
    the same. Empty pixels have depth 1e10, as Blender's own Depth pass, and 0 elsewhere. Raises OSError.
    """
    channels: dict[str, Float32Array] = {}
    for index, layer in enumerate(layers):
        for name, attribute, letters in CHANNELS:
            image: Float32Array | None = getattr(layer, attribute)
            if image is None:
                continue
            if letters == "Z":
                image = np.where(np.isfinite(image), image, EMPTY_DEPTH)
            planes = dict(zip(letters, np.moveaxis(np.atleast_3d(image), -1, 0), strict=False))
            for letter in letters:
                channels[f"layer{index}.{name}.{letter}"] = planes.get(letter, np.zeros_like(layer.depth))
    write_channels(path, channels)
