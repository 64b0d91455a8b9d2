# SPDX-License-Identifier: GPL-3.0-or-later
"""Error against warm time, log–log, as SVG for the page and as PNG for places that take no SVG.

Ours are filled marks on solid lines, the other engines hollow triangles on dashed lines. Most colours are those of
Okabe and Ito ("Color Universal Design", 2008), which colour-blind people tell apart; shapes differ as well.
"""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from PIL import Image

from tooling.report.labels import Label, place
from tooling.report.panels import Line, Panel, label

OUR_LOOKS = (
    ("#0072B2", "o"),
    ("#E69F00", "D"),
    ("#009E73", "s"),
    ("#56B4E9", "P"),
    ("#000000", "X"),
    ("#CC79A7", "*"),
    ("#8C6D00", "p"),
)
PEER_LOOKS = (("#D55E00", "^"), ("#7B2CBF", "v"), ("#B0002A", "<"), ("#6B7280", ">"))
"""Shapes and hues that no series of ours has."""
COPY_COLOR = "#B5B5B5"
FRONT_COLOR = "#D5D5D5"
FRONT_POINTS = 4.0
NOISE_COLOR = "#F1E4B8"
PANEL_INCHES = (6.6, 4.8)
DOTS_PER_INCH = 100
TEXT_POINTS = 10.0
TEXT_DARKNESS = 0.7
"""Labels are this much darker than their marks, as letters are thin."""
COLORS = 64
"""Of a PNG: plots have few, and files stay small."""
MARGIN = 1.25
"""Room at the sides of the axes, as a factor."""


def svg(panel: Panel) -> str:
    """One panel as an SVG document; texts stay texts."""
    with _figure([panel], "") as figure:
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
        return text.getvalue()


def png(panels: Sequence[Panel], title: str) -> bytes:
    """Panels side by side below a title, as PNG with few colours."""
    with _figure(panels, title) as figure:
        raw, small = io.BytesIO(), io.BytesIO()
        figure.savefig(raw, format="png", dpi=DOTS_PER_INCH)
        Image.open(raw).convert("RGB").quantize(COLORS, dither=Image.Dither.NONE).save(small, "PNG", optimize=True)
        return small.getvalue()


@contextmanager
def _figure(panels: Sequence[Panel], title: str) -> Iterator[Any]:
    """A matplotlib figure with panels in a row and a legend below; closed afterwards."""
    import matplotlib as mpl  # here, so that the rest can be used where it is not installed

    mpl.use("Agg")
    from matplotlib import pyplot

    own: dict[Any, Any] = {
        "svg.fonttype": "none",
        "svg.hashsalt": "deep_gbuffer",
        "font.size": TEXT_POINTS,
        "text.parse_math": False,
    }
    with mpl.rc_context(own):
        width, height = PANEL_INCHES
        size = (width * len(panels), height)
        figure, axes = pyplot.subplots(1, len(panels), figsize=size, squeeze=False, layout="constrained")
        try:
            labels = [_draw(space, panel) for space, panel in zip(axes[0], panels, strict=True)]
            figure.legend(handles=_legend(panels), loc="outside lower center", ncols=2 * len(panels), frameon=False)
            if title:
                figure.suptitle(title, fontsize=TEXT_POINTS + 3)
            figure.canvas.draw()  # settles the layout, which texts are placed in
            figure.set_layout_engine("none")
            for space, panel, texts in zip(axes[0], panels, labels, strict=True):
                place(space, texts, _obstacles(panel), TEXT_POINTS)
            yield figure
        finally:
            pyplot.close(figure)


def _draw(axes: Any, panel: Panel) -> list[Label]:
    """One panel with everything but its labels, which are returned."""
    _set_axes(axes, panel)
    _draw_noise(axes, panel)
    _draw_front(axes, panel)
    looks = {False: _endless(OUR_LOOKS), True: _endless(PEER_LOOKS)}
    return [text for line in panel.lines for text in _draw_line(axes, line, *next(looks[line.is_peer]))]


def _legend(panels: Sequence[Panel]) -> list[Any]:
    """What marks and lines mean, where they are in any of the panels."""
    from matplotlib.lines import Line2D

    dots = [(line, dot) for panel in panels for line in panel.lines for dot in line.dots]
    black = {"color": "#333333", "markersize": 8, "markeredgewidth": 1.5}
    entries = [Line2D([], [], marker="o", label="Deep G-Buffer", **black)]
    if any(line.is_peer for line, _ in dots):
        entries.append(
            Line2D([], [], marker="^", linestyle="--", markerfacecolor="white", label="other engines", **black)
        )
    if any(dot.is_copy for _, dot in dots):
        words = "same picture as another"
        entries.append(Line2D([], [], marker="o", linestyle="", color=COPY_COLOR, markersize=4, label=words))
    return [*entries, Line2D([], [], color=FRONT_COLOR, linewidth=FRONT_POINTS, label="Pareto front")]


def _obstacles(panel: Panel) -> list[list[tuple[float, float]]]:
    """Lines that labels keep clear of: those that connect dots, and spreads of times."""
    connected = [_path(line) for line in panel.lines if line.is_sweep]
    dots = [dot for line in panel.lines for dot in line.dots if not dot.is_copy]
    return connected + [[(dot.least, dot.error), (dot.greatest, dot.error)] for dot in dots]


def _path(line: Line) -> list[tuple[float, float]]:
    """The places that a connected line goes through."""
    return [(dot.seconds, dot.error) for dot in line.dots if not dot.is_copy]


def _endless(looks: Sequence[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """The looks, again and again."""
    while True:
        yield from looks


def _set_axes(axes: Any, panel: Panel) -> None:
    """Scales, limits, ticks and names of the axes."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    dots = [dot for line in panel.lines for dot in line.dots]
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(min((dot.least for dot in dots), default=0.1) / MARGIN, _greatest(dots) * MARGIN * MARGIN)
    axes.set_ylim(panel.lowest, max((dot.error for dot in dots), default=1.0) * 1.5 * MARGIN)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=30))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("warm seconds per frame")
    axes.set_ylabel(f"{panel.metric.name} (lower is better)")
    axes.grid(alpha=0.25)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _greatest(dots: Sequence[Any]) -> float:
    """The longest time of any dot."""
    return max((dot.greatest for dot in dots), default=1.0)


def _draw_noise(axes: Any, panel: Panel) -> None:
    """The reference's own error as a band, or as words where it is below the axis."""
    if panel.noise is None:
        return
    words = f"the reference's own noise: {panel.noise:.2g}"
    if panel.noise > panel.lowest:
        axes.axhspan(panel.lowest, panel.noise, color=NOISE_COLOR, linewidth=0, zorder=0)
    else:
        words += ", below this plot"
    axes.text(0.99, 0.015, words, transform=axes.transAxes, ha="right", va="bottom", color="#6B5900")


def _draw_front(axes: Any, panel: Panel) -> None:
    """The Pareto front as stairs: the lowest error that can be had within a time."""
    if not panel.front:
        return
    seconds, errors = (list(values) for values in zip(*panel.front, strict=True))
    top, right = axes.get_ylim()[1], axes.get_xlim()[1]
    axes.plot(
        [seconds[0], *seconds, right],
        [top, *errors, errors[-1]],
        drawstyle="steps-post",
        color=FRONT_COLOR,
        linewidth=FRONT_POINTS,
        solid_joinstyle="round",
        zorder=1,
    )


def _draw_line(axes: Any, line: Line, color: str, shape: str) -> list[Label]:
    """One series; the labels that its dots need. Copies of other pictures are small, grey and without one."""
    from matplotlib.colors import to_rgb

    shown = [dot for dot in line.dots if not dot.is_copy]
    if line.is_sweep and len(shown) > 1:
        dashes = {"linestyle": (0, (4, 2)) if line.is_peer else "-", "linewidth": 1.4}
        axes.plot(*zip(*_path(line), strict=True), color=color, zorder=2, **dashes)
    for dot in line.dots:
        tint = COPY_COLOR if dot.is_copy else color
        look = {"markersize": 4 if dot.is_copy else 8, "markerfacecolor": "white" if line.is_peer else tint}
        spread = (
            [[max(0.0, dot.seconds - dot.least)], [max(0.0, dot.greatest - dot.seconds)]] if dot.has_spread else None
        )
        axes.errorbar(
            dot.seconds,
            dot.error,
            xerr=spread,
            fmt="o" if dot.is_copy else shape,
            color=tint,
            elinewidth=1,
            capsize=0 if dot.is_copy else 2.5,
            markeredgewidth=1.5,
            zorder=2 if dot.is_copy else 3,
            **look,
        )
    ink = tuple(TEXT_DARKNESS * part for part in to_rgb(color))
    texts = [(dot, f"{label(line, dot)}{' (no error)' if dot.is_zero else ''}") for dot in shown]
    return [Label(dot.seconds, dot.error, text.strip(), ink) for dot, text in texts if text.strip()]
