# SPDX-License-Identifier: GPL-3.0-or-later
"""Error against time of every variant, as one picture."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MARKERS = "oDsP^vX*"
DOTS_PER_INCH = 80
SMALLEST_ERROR = 0.1
"""Percent; the axis is linear below."""


@dataclass(frozen=True)
class Point:
    """One variant in one sequence: `time` relative to one layer, `error` in percent of the covered pixels."""

    layers: int
    variant: str
    clip: str
    time: float
    error: float


def plot(points: Sequence[Point], path: Path, caption: str) -> None:
    """Write the plot as PNG: a panel per number of layers, a colour per variant, a marker per sequence."""
    import matplotlib as mpl  # here, so that the tables are tested where it is not installed

    mpl.use("Agg")
    from matplotlib import pyplot
    from matplotlib.lines import Line2D

    counts = sorted({point.layers for point in points})
    colors = {name: f"C{index}" for index, name in enumerate(dict.fromkeys(point.variant for point in points))}
    markers = dict(zip(dict.fromkeys(point.clip for point in points), MARKERS, strict=False))
    figure, panels = pyplot.subplots(1, len(counts), figsize=(12, 5), sharey=True, squeeze=False)
    for panel, layers in zip(panels[0], counts, strict=True):
        for point in (point for point in points if point.layers == layers):
            look = {"color": colors[point.variant], "marker": markers[point.clip], "alpha": 0.8, "clip_on": False}
            panel.plot(point.time, point.error, linestyle="", markersize=8, **look)
        _label(panel, layers)
    panels[0][0].set_ylabel("layer 1 differs from Two-Pass, % of covered pixels")
    legend = [Line2D([], [], color=color, marker="s", linestyle="", label=name) for name, color in colors.items()]
    legend += [Line2D([], [], color="gray", marker=shape, linestyle="", label=name) for name, shape in markers.items()]
    figure.legend(handles=legend, loc="center right", frameon=False)
    figure.suptitle(caption, fontsize=11)
    figure.tight_layout(rect=(0, 0, 0.84, 1))
    figure.savefig(path, dpi=DOTS_PER_INCH)
    pyplot.close(figure)


def _label(panel: Any, layers: int) -> None:
    """Title and axes of one panel."""
    panel.set_title(f"{layers} layers")
    panel.set_xlabel("time of the geometry stage, one layer = 1")
    panel.set_yscale("symlog", linthresh=SMALLEST_ERROR)
    panel.set_ylim(bottom=0.0, top=100.0)
    panel.set_yticks([0.0, 0.1, 1.0, 10.0, 100.0], labels=["0", "0.1", "1", "10", "100"])
    panel.grid(alpha=0.3)
