# SPDX-License-Identifier: GPL-3.0-or-later
"""NVIDIA's FLIP between pictures, and pictures side by side with it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

CAPTION = 22
"""Height in pixels of the line above each picture."""


def read(path: Path) -> np.ndarray:
    """An 8-bit picture as (H, W, 3) float32 in 0…1, encoded as it is."""
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"), np.float32) / 255.0


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
