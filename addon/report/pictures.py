# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures from EXR files, (H, W, 3) float32, top row first."""

from pathlib import Path

import numpy as np
import OpenEXR

from ..scene.arrays import Float32Array


def channels(path: Path) -> dict[str, Float32Array]:
    """Every channel (H, W) of an EXR file, by name. Raises OSError naming the file where it cannot be read."""
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            return {
                name: np.asarray(channel.pixels, np.float32)
                for part in file.parts
                for name, channel in part.channels.items()
            }
    except (RuntimeError, TypeError) as error:  # OpenEXR's own: a broken file, a deep one
        raise OSError(f"OpenEXR could not read {path}: {error}") from error


def combined(path: Path) -> Float32Array:
    """Scene-linear RGB of an EXR file: its first Combined pass as Blender writes it, else plain channels R, G and B.

    Raises OSError where it cannot be read, ValueError where it has neither; both name the file.
    """
    found = channels(path)
    prefix = next((name.removesuffix("R") for name in found if name.endswith("Combined.R")), "")
    try:
        return np.stack([found[f"{prefix}{letter}"] for letter in "RGB"], axis=-1)
    except KeyError as error:
        raise ValueError(f"{path} has no colour channels; it has {', '.join(sorted(found))}") from error
