# SPDX-License-Identifier: GPL-3.0-or-later
"""NVIDIA's FLIP between pictures, and pictures side by side with it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image, ImageDraw

CAPTION = 22
"""Height in pixels of the line above each picture."""


def combined(path: Path) -> np.ndarray:
    """Scene-linear RGB (H, W, 3) float32 of the first Combined pass of an EXR file that Blender wrote."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: channel.pixels for part in file.parts for name, channel in part.channels.items()}
    group = next(name.removesuffix(".R") for name in channels if name.endswith("Combined.R"))
    return np.stack([np.asarray(channels[f"{group}.{letter}"], np.float32) for letter in "RGB"], axis=-1)


def shown(linear: np.ndarray) -> np.ndarray:
    """Scene-linear values as Blender's view transform Standard shows them: cut to 0…1, encoded after IEC 61966-2-1."""
    values = np.clip(linear, 0.0, 1.0)
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1.0 / 2.4) - 0.055).astype(np.float32)


def flip(reference: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, float]:
    """Error map (H, W, 3) in FLIP's colours and its mean, of sRGB pictures (H, W, 3) at 67 pixels per degree.

    Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating Images".
    """
    import flip_evaluator  # here, so that the rest can be used where it is not installed

    colored, mean, _ = flip_evaluator.evaluate(reference, other, "LDR")
    return np.asarray(colored, np.float32), float(mean)


def write_sheet(path: Path, rows: Sequence[Sequence[tuple[str, np.ndarray]]], quality: int = 88) -> None:
    """Rows of captioned pictures (H, W, 3) of one size as one JPEG."""
    height, width, _ = rows[0][0][1].shape
    sheet = Image.new("RGB", (width * len(rows[0]), (height + CAPTION) * len(rows)), "white")
    draw = ImageDraw.Draw(sheet)
    for line, pictures in enumerate(rows):
        for column, (caption, pixels) in enumerate(pictures):
            corner = (column * width, line * (height + CAPTION))
            draw.text((corner[0] + 6, corner[1] + 4), caption, fill="black", font_size=13)
            tile = Image.fromarray(np.rint(255.0 * np.clip(pixels, 0.0, 1.0)).astype(np.uint8))
            sheet.paste(tile, (corner[0], corner[1] + CAPTION))
    sheet.save(path, quality=quality)
