# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts beside the marks of a plot, placed so that they cover neither each other nor the marks."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np

DISTANCES = (7.0, 16.0, 28.0, 42.0, 58.0)
"""From a mark to its text, in points; the nearest that is free is taken."""
LEADER = 12.0
"""From this distance on a thin line joins mark and text."""
DIRECTIONS = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))
SIDES = {1: "left", 0: "center", -1: "right"}
ENDS = {1: "bottom", 0: "center", -1: "top"}
MARK = 5.0
"""Half the extent of a mark, in points."""
NEAR = 12.0
"""Within this distance of another mark, in points, a text would seem to be that one's."""
NEARNESS = 1.0
"""Area near another mark counts this much of area that covers something."""

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

    @property
    def has_leader(self) -> bool:
        """Whether a line joins mark and text."""
        return self.distance > LEADER

    def box(self, mark: Any, width: float, height: float, pixels: float) -> Box:
        """The box of a text of this width and height beside `mark`, in pixels, of which a point has so many."""
        left = mark[0] + self.offset[0] * pixels + 0.5 * (self.direction[0] - 1) * width
        bottom = mark[1] + self.offset[1] * pixels + 0.5 * (self.direction[1] - 1) * height
        return left, bottom, left + width, bottom + height


PLACES = [Place(far, direction) for far, direction in product(DISTANCES, DIRECTIONS)]
"""Where a text may stand, the best first."""


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
    """Write the labels into matplotlib's `axes` at `size` points; those with the fewest free places choose first.

    `lines`: corners, in data coordinates, of lines to keep clear of. The axes' limits, scales and place must be final.
    """
    renderer = axes.figure.canvas.get_renderer()
    pixels = axes.figure.dpi / 72.0
    edges = axes.get_window_extent(renderer)
    marks = [axes.transData.transform((each.x, each.y)) for each in labels]
    taken = [_around(mark, MARK * pixels) for mark in marks]
    for line in lines:
        taken += _along([axes.transData.transform(corner) for corner in line], pixels)
    boxes = [
        _boxes(mark, _extent(axes, each.text, size, renderer), pixels) for each, mark in zip(labels, marks, strict=True)
    ]
    frame: Box = (edges.x0, edges.y0, edges.x1, edges.y1)
    costs = [
        _costs(mark, boxes[index], (*marks[:index], *marks[index + 1 :]), taken, frame, pixels)
        for index, mark in enumerate(marks)
    ]
    texts: list[Box] = []
    for index in sorted(range(len(labels)), key=lambda index: sum(round(cost) == 0 for cost in costs[index])):
        total = [cost + overlap(box, texts) for cost, box in zip(costs[index], boxes[index], strict=True)]
        best = min(range(len(PLACES)), key=lambda place: (round(total[place]), place))
        texts.append(boxes[index][best])
        _write(axes, labels[index], PLACES[best], size)


def _costs(
    mark: Any, boxes: Sequence[Box], others: Sequence[Any], taken: Sequence[Box], frame: Box, pixels: float
) -> list[float]:
    """What is bad, in square pixels, about each of a text's boxes in `PLACES`, before there are other texts.

    That is the area that covers what is taken, is near other marks or lies outside the frame, and a leader over others.
    """
    near = [_around(other, NEAR * pixels) for other in others]
    hit = [_around(other, MARK * pixels) for other in others]
    return [
        overlap(box, taken)
        + NEARNESS * overlap(box, near)
        + 4.0 * outside(box, frame)
        + sum(overlap(piece, hit) for piece in _leader(where, mark, pixels))
        for where, box in zip(PLACES, boxes, strict=True)
    ]


def _extent(axes: Any, text: str, size: float, renderer: Any) -> tuple[float, float]:
    """Width and height of a text in pixels."""
    drawn = axes.text(0.0, 0.0, text, transform=axes.transAxes, fontsize=size)
    bounds = drawn.get_window_extent(renderer)
    drawn.remove()
    return bounds.width, bounds.height


def _boxes(mark: Any, extent: tuple[float, float], pixels: float) -> list[Box]:
    """The boxes of a text of this extent in all `PLACES`."""
    return [where.box(mark, *extent, pixels) for where in PLACES]


def _leader(where: Place, mark: Any, pixels: float) -> list[Box]:
    """The line between a mark and its text, as boxes; empty where the text is so near that it has none."""
    return _along([mark, mark + pixels * np.asarray(where.offset)], pixels) if where.has_leader else []


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
        arrowprops={"arrowstyle": "-", "color": "#999999", "linewidth": 0.6} if where.has_leader else None,
    )
