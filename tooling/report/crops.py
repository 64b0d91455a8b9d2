# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of a scene side by side: the reference, our best and the other engines', and where they are wrong."""

import io
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from addon.report.metrics import display
from addon.report.pictures import combined
from addon.scene.arrays import Float32Array, Float64Array
from tooling.report.columns import number, seconds
from tooling.report.pictures import centre
from tooling.report.results import Measurement, SceneReport
from tooling.report.summary import best_within, fastest, is_denoised_cycles, is_ours
from tooling.report.tables import Row

RULE = (
    "Shown are the reference; the point of Deep G-Buffer with the lowest FLIP in the time of the fastest denoised "
    "Cycles; its point with the lowest FLIP at all; and of every series of the other engines the point with the lowest "
    "FLIP in that time or, where none is so fast, the fastest. The rectangle is where the errors of these pictures "
    "differ most."
)
HEAT = "Below each rectangle is FLIP's error map: black is equal, purple, orange and yellow more and more different."
SHARE = 3
"""The rectangle has this part of the picture's width and height."""
STEPS = 24
"""Places that are tried for it along each side."""
WIDEST = 640
"""Pixels; larger pictures are shown smaller."""
COLUMN = 240
"""Width in pixels of a picture on the sheet."""
GAP = 6
"""Pixels between columns of the sheet."""
LETTERS = 32
"""Of a caption's line; more than that do not surely fit into a column."""
LINE = 17
"""Height in pixels of a caption's line."""
FONT = 13
"""Size in pixels of a caption's letters."""
QUALITY = 85
"""Of the sheet."""


@dataclass(frozen=True)
class View:
    """One way to show the scene: its name, what is to know of it, and sRGB pictures of one size.

    `heat`: FLIP's error map, None for the reference. `crop`, `crop_heat`: the rectangle of both.
    """

    name: str
    note: str
    whole: Image.Image
    crop: Image.Image
    crop_heat: Image.Image | None


@dataclass(frozen=True)
class Views:
    """All of a scene's; `box` is the rectangle in the whole pictures: left, top, right, bottom."""

    views: tuple[View, ...]
    box: tuple[int, int, int, int]


def chosen(rows: Sequence[Row]) -> list[int]:
    """Indices of the rows that are shown, after `RULE`."""
    timed = [row for row in rows if row.warm_renders]
    ours, peers = [row for row in timed if is_ours(row)], [row for row in timed if not is_ours(row)]
    limit = fastest([row for row in timed if is_denoised_cycles(row)]) or fastest(peers)
    budget = limit.warm_s if limit else float("inf")
    picked = [best_within(ours, budget), best_within(ours, float("inf"))]
    for _, series in groupby(peers, key=lambda row: row.series):
        of_series = list(series)
        picked.append(best_within(of_series, budget) or fastest(of_series))
    indices = [next(index for index, row in enumerate(rows) if row is one) for one in picked if one is not None]
    return list(dict.fromkeys(indices))


def rectangle(errors: Sequence[Float64Array], width: int, height: int) -> tuple[int, int]:
    """Left and top of the rectangle in which error maps (H, W) differ most: the sum of greatest minus least.

    A single map counts as it is. Where several places are equal, the uppermost and leftmost one.
    """
    stack = np.stack(errors)
    differing = stack[0] if len(errors) == 1 else stack.max(axis=0) - stack.min(axis=0)
    total = np.pad(differing.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    tops = np.unique(np.linspace(0, differing.shape[0] - height, STEPS).astype(int))
    lefts = np.unique(np.linspace(0, differing.shape[1] - width, STEPS).astype(int))
    upper, lower = total[tops], total[tops + height]
    sums = lower[:, lefts + width] - lower[:, lefts] - upper[:, lefts + width] + upper[:, lefts]
    row, column = np.unravel_index(np.argmax(sums), sums.shape)
    return int(lefts[column]), int(tops[row])


def views(scene: SceneReport, rows: Sequence[Row]) -> Views:
    """The pictures of a measured scene, chosen after `RULE`.

    Raises OSError or ValueError where one cannot be read.
    """
    shown = [(rows[index], scene.measurements[index]) for index in chosen(rows)]
    linear = centre(combined(scene.reference.pictures[0]), scene.subject.crop)
    truth = _image(display(linear))
    heats = [_picture(measurement.judgement.heat, truth.size) for _, measurement in shown]
    width, height = max(1, truth.width // SHARE), max(1, truth.height // SHARE)
    left, top = rectangle([_errors(heat) for heat in heats] or [np.zeros(truth.size[::-1])], width, height)
    box = (left, top, left + width, top + height)
    samples = f"{scene.reference.samples:,} samples" if scene.reference.samples else ""
    found = [View("Reference", samples, truth, truth.crop(box), None)]
    for (row, measurement), heat in zip(shown, heats, strict=True):
        found.append(_view(row, measurement, heat, box, truth.size))
    return Views(tuple(found), box)


def _view(
    row: Row, measurement: Measurement, heat: Image.Image, box: tuple[int, int, int, int], size: tuple[int, int]
) -> View:
    """A point's pictures."""
    whole = _picture(measurement.judgement.picture, size)
    return View(row.title, f"{seconds(row.warm_s)} s, FLIP {number(row.flip)}", whole, whole.crop(box), heat.crop(box))


def _picture(path: Path, size: tuple[int, int]) -> Image.Image:
    """A PNG of the judged rectangle. Raises OSError where it cannot be read, ValueError where it has another size."""
    with Image.open(path) as image:
        if image.size != size:
            raise ValueError(f"{path.name} is {image.width}×{image.height}, the reference {size[0]}×{size[1]}")
        return image.convert("RGB")


def _image(shown: Float32Array) -> Image.Image:
    """An sRGB picture (H, W, 3) 0…1 as 8-bit image."""
    return Image.fromarray(np.rint(255.0 * shown).astype(np.uint8))


def _errors(heat: Image.Image) -> Float64Array:
    """The error (H, W), 0…1 and rising with FLIP, that the brightness of its colours stands for."""
    return np.asarray(heat.convert("L"), np.float64) / 255.0


def jpeg(image: Image.Image, quality: int) -> bytes:
    """A picture as JPEG, at most `WIDEST` pixels wide."""
    small = image.copy()
    small.thumbnail((WIDEST, WIDEST))
    data = io.BytesIO()
    small.save(data, "JPEG", quality=quality, optimize=True)
    return data.getvalue()


def caption(text: str) -> list[str]:
    """A text as lines that fit into a column."""
    return textwrap.wrap(text, LETTERS)


def sheet(scene: Views) -> bytes:
    """All views as one JPEG: whole pictures with the rectangle drawn in, below them the rectangle and its errors."""
    width, height = scene.views[0].whole.size
    tile = (COLUMN, max(1, round(COLUMN * height / width)))
    captions = [[*caption(view.name), *caption(view.note)] for view in scene.views]
    top = LINE * max(len(lines) for lines in captions)
    whole = Image.new("RGB", ((COLUMN + GAP) * len(scene.views) - GAP, top + 3 * tile[1]), "white")
    draw = ImageDraw.Draw(whole)
    for column, view in enumerate(scene.views):
        left = column * (COLUMN + GAP)
        for line, words in enumerate(captions[column]):
            draw.text((left, LINE * line), words, fill="black", font_size=FONT)
        outlined = view.whole.copy()
        ImageDraw.Draw(outlined).rectangle(scene.box, outline="#FFD400", width=max(2, width // COLUMN))
        images = (outlined, view.crop, view.crop_heat)
        for line, image in enumerate(image for image in images if image is not None):
            whole.paste(image.resize(tile, Image.Resampling.LANCZOS), (left, top + line * tile[1]))
    data = io.BytesIO()
    whole.save(data, "JPEG", quality=QUALITY, optimize=True)
    return data.getvalue()
