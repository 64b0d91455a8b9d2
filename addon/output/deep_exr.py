# SPDX-License-Identifier: GPL-3.0-or-later
"""The layers as a deep scanline EXR: one sample per layer and pixel, for deep compositing."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import OpenEXR

from ..scene.arrays import Float32Array, Int32Array
from .exr import top_down, write_atomically
from .layers_exr import Layer


def write_deep(path: Path, layers: Sequence[Layer]) -> None:
    """Write depth Z and premultiplied RGBA (A = 1, surfaces are opaque) of every layer that is there, front to back.

    A pixel has as many samples as layers that are not empty there. Where exit surfaces were rendered, a sample reaches
    from its surface to the exit (ZBack; the surface again where there is none). Raises OSError.
    """
    present = np.isfinite(np.stack([top_down(layer.depth) for layer in layers], axis=-1))
    counts = present.sum(axis=-1, dtype=np.int32)
    planes: dict[str, list[Float32Array]] = {"Z": [layer.depth for layer in layers]}
    if any(layer.exit_depth is not None for layer in layers):
        planes["ZBack"] = [_back(layer) for layer in layers]
    planes |= {letter: [layer.radiance[..., index] for layer in layers] for index, letter in enumerate("RGB")}
    planes["A"] = [np.ones_like(layer.depth) for layer in layers]
    channels = {
        name: _per_pixel(np.stack([top_down(image) for image in images], axis=-1)[present], counts)
        for name, images in planes.items()
    }
    header = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    write_atomically(path, header, channels)


def _back(layer: Layer) -> Float32Array:
    """View depth (H, W) at which a layer's samples end."""
    if layer.exit_depth is None:
        return layer.depth
    return np.where(np.isfinite(layer.exit_depth), layer.exit_depth, layer.depth)


def _per_pixel(samples: Float32Array, counts: Int32Array) -> np.ndarray:
    """(H, W) object array of each pixel's samples (count,) float32, some of them empty, as OpenEXR takes it.

    `samples` holds all pixels' samples one after another, in C order of `counts` (H, W).
    """
    samples = samples.astype(np.float32, copy=False)
    ends = np.cumsum(counts, axis=None).tolist()
    pixels = np.empty(counts.size, dtype=object)
    pixels[:] = [samples[first:last] for first, last in zip([0, *ends], ends, strict=False)]
    return pixels.reshape(counts.shape)
