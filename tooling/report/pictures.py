# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts and sizes of pictures, NVIDIA's FLIP between them, and files for people. (H, W, 3) float32, top row first."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from addon.scene.arrays import Float32Array
from tooling import places

CAPTION = 22
"""Height in pixels of the line above each picture."""


def centre(image: np.ndarray, size: tuple[int, int] | None) -> np.ndarray:
    """The rectangle of `size` (width, height) about the centre of an image (H, W, …); None: all of it.

    Raises ValueError where the image is smaller.
    """
    if size is None:
        return image
    (height, width), (wide, high) = image.shape[:2], size
    if not (0 < wide <= width and 0 < high <= height):
        raise ValueError(f"no rectangle of {wide}×{high} pixels lies in a picture of {width}×{height}")
    left, top = (width - wide) // 2, (height - high) // 2
    return image[top : top + high, left : left + wide]


def enlarged(picture: Float32Array, size: tuple[int, int]) -> Float32Array:
    """`picture` at `size` (width, height), bilinearly; itself where it is of that size. Raises ValueError if larger."""
    height, width = picture.shape[:2]
    if (width, height) == size:
        return picture
    if width > size[0] or height > size[1]:
        raise ValueError(f"the picture is {width}×{height}, larger than {size[0]}×{size[1]}")
    planes = [Image.fromarray(np.ascontiguousarray(plane, np.float32)) for plane in np.moveaxis(picture, -1, 0)]
    return np.stack([np.asarray(plane.resize(size, Image.Resampling.BILINEAR)) for plane in planes], axis=-1)


def flip(reference: Float32Array, other: Float32Array) -> tuple[Float32Array, float]:
    """Error map in FLIP's colours and its mean, of sRGB pictures at 67 pixels per degree.

    Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating Images".
    """
    import flip_evaluator  # here, so that the rest can be used where it is not installed

    colored, mean, _ = flip_evaluator.evaluate(reference, other, "LDR")
    return np.asarray(colored, np.float32), float(mean)


def write_png(path: Path, shown: Float32Array) -> None:
    """Write an sRGB picture 0…1 as PNG of 8 bits, under another name first; makes the folder. Raises OSError."""
    with places.replacing(path) as draft:
        _bytes(shown).save(draft, optimize=True)


def write_sheet(path: Path, rows: Sequence[Sequence[tuple[str, Float32Array]]], quality: int = 88) -> None:
    """Rows of captioned sRGB pictures 0…1 of one size as one JPEG."""
    height, width, _ = rows[0][0][1].shape
    sheet = Image.new("RGB", (width * len(rows[0]), (height + CAPTION) * len(rows)), "white")
    draw = ImageDraw.Draw(sheet)
    for line, pictures in enumerate(rows):
        for column, (caption, pixels) in enumerate(pictures):
            corner = (column * width, line * (height + CAPTION))
            draw.text((corner[0] + 6, corner[1] + 4), caption, fill="black", font_size=13)
            sheet.paste(_bytes(pixels), (corner[0], corner[1] + CAPTION))
    sheet.save(path, quality=quality)


def _bytes(shown: Float32Array) -> Image.Image:
    """An sRGB picture 0…1 as 8-bit image."""
    return Image.fromarray(np.rint(255.0 * np.clip(shown, 0.0, 1.0)).astype(np.uint8))
