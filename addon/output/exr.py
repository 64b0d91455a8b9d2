# SPDX-License-Identifier: GPL-3.0-or-later
"""What the EXR writers share."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from ..scene.arrays import Float32Array


def write_atomically(path: Path, header: dict[str, Any], channels: dict[str, Any]) -> None:
    """Write an EXR under a temporary name beside `path`, then rename it: a reader never sees half a file.

    Makes the folder. `channels` are row 0 at the top. Raises OSError naming the path where the file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        with OpenEXR.File(header, channels) as file:
            file.write(str(temporary))
        temporary.replace(path)
    except RuntimeError as error:  # OpenEXR's only exception
        raise OSError(f"OpenEXR could not write {path}: {error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def write_channels(path: Path, channels: dict[str, Float32Array]) -> None:
    """Write named images (H, W) float32, row 0 at the bottom, as the channels of one scanline EXR. Raises OSError."""
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    planes = {name: np.ascontiguousarray(top_down(image), np.float32) for name, image in channels.items()}
    write_atomically(path, header, planes)


def top_down(image: Float32Array) -> Float32Array:
    """An image whose row 0 is at the bottom, as EXR stores it."""
    return image[::-1]
