# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts beside the marks of a plot, placed so that they cover neither each other nor the marks."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np

DISTANCES = (7.0, 16.0, 28.0, 42.0)
"""From a mark to its text, in points; the nearest that is free is taken."""
LEADER = 12.0
"""From this distance on a thin line joins mark and text."""
DIRECTIONS = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))
SIDES = {1: "left", 0: "center", -1: "right"}
ENDS = {1: "bottom", 0: "center", -1: "top"}
MARK = 5.0
"""Half the extent of a mark, in points."""

Box = tuple[float, float, float, float]
"""Left, bottom, right, top in pixels."""


@dataclass(frozen=True)
class Label:
    """A text for the mark at (x, y) in data coordinates; its colour is RGB, 0…1."""

    x: float
    y: float
    text: str
    color: tuple[float, ...]


@dataclass(frozen=True)
class Place:
    """Where a text stands beside its mark: so many points away in a direction (right, up: −1, 0 or 1)."""

    distance: float
    direction: tuple[int, int]

    @property
    def offset(self) -> tuple[float, float]:
        """From the mark to the nearest corner or edge of the text, in points right and up."""
        slant = 0.75 if all(self.direction) else 1.0
        return self.direction[0] * self.distance * slant, self.direction[1] * self.distance * slant

    def box(self, mark: Any, width: float, height: float, pixels: float) -> Box:
        """The box of a text of this width and height beside `mark`, in pixels, of which a point has so many."""
        left = mark[0] + self.offset[0] * pixels + 0.5 * (self.direction[0] - 1) * width
        bottom = mark[1] + self.offset[1] * pixels + 0.5 * (self.direction[1] - 1) * height
        return left, bottom, left + width, bottom + height


def overlap(box: Box, others: Sequence[Box]) -> float:
    """Area that a box shares with others, summed over those."""
    left, bottom, right, top = np.asarray(others, np.float64).reshape(-1, 4).T
    width = np.minimum(box[2], right) - np.maximum(box[0], left)
    height = np.minimum(box[3], top) - np.maximum(box[1], bottom)
    return float(np.sum(np.maximum(0.0, width) * np.maximum(0.0, height)))


def outside(box: Box, frame: Box) -> float:
    """Area of a box that lies outside a frame."""
    return (box[2] - box[0]) * (box[3] - box[1]) - overlap(box, [frame])


def place(axes: Any, labels: Sequence[Label], lines: Sequence[Sequence[tuple[float, float]]], size: float) -> None:
    """Write the labels into matplotlib's `axes` at `size` points; the first ones get the best places.

    `lines`: corners, in data coordinates, of lines to keep clear of. The axes' limits, scales and place must be final.
    """
    figure = axes.figure
    renderer = figure.canvas.get_renderer()
    pixels = figure.dpi / 72.0
    edges = axes.get_window_extent(renderer)
    frame: Box = (edges.x0, edges.y0, edges.x1, edges.y1)
    taken = [_around(axes.transData.transform((each.x, each.y)), MARK * pixels) for each in labels]
    for line in lines:
        taken += _along([axes.transData.transform(corner) for corner in line], pixels)
    for each in labels:
        extent = axes.text(0.0, 0.0, each.text, transform=axes.transAxes, fontsize=size)
        bounds = extent.get_window_extent(renderer)
        extent.remove()
        mark = axes.transData.transform((each.x, each.y))
        places = [Place(far, direction) for far, direction in product(DISTANCES, DIRECTIONS)]
        boxes = [where.box(mark, bounds.width, bounds.height, pixels) for where in places]
        blocked = [overlap(box, taken) + 4.0 * outside(box, frame) for box in boxes]
        best = min(range(len(places)), key=lambda index: (round(blocked[index]), index))
        taken.append(boxes[best])
        _write(axes, each, places[best], size)


def _around(centre: Any, reach: float) -> Box:
    """The box that reaches so far from a place."""
    return centre[0] - reach, centre[1] - reach, centre[0] + reach, centre[1] + reach


def _along(corners: Sequence[Any], reach: float) -> list[Box]:
    """Boxes along a line through these places."""
    boxes: list[Box] = []
    for start, end in pairwise(corners):
        steps = int(max(abs(end - start)) / (2.0 * reach)) + 1
        boxes += [_around(start + (end - start) * step / steps, reach) for step in range(steps)]
    return boxes


def _write(axes: Any, label: Label, where: Place, size: float) -> None:
    """Write one label."""
    axes.annotate(
        label.text,
        (label.x, label.y),
        xytext=where.offset,
        textcoords="offset points",
        ha=SIDES[where.direction[0]],
        va=ENDS[where.direction[1]],
        color=label.color,
        fontsize=size,
        arrowprops={"arrowstyle": "-", "color": "#999999", "linewidth": 0.6} if where.distance > LEADER else None,
    )
