# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of a report as people read them: columns of text, the same on the page and in Markdown."""

import math
import re
from collections.abc import Sequence

from tooling.report.tables import Row

UNKNOWN = "–"
ON_FRONT = "★"
POINT = 0
"""The column that says which point it is; all others are figures."""


def number(value: float, digits: int = 3) -> str:
    """A figure with so many significant digits; without an exponent from 0.0001 to 1,000,000."""
    if math.isnan(value):
        return UNKNOWN
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    text = f"{value:.{digits - 1}e}"
    exponent = int(text.partition("e")[2])
    if not -4 <= exponent < 6:
        return text.replace("-", "−").replace("e+0", "e").replace("e−0", "e−")
    return f"{float(text):,.{max(0, digits - 1 - exponent)}f}".replace("-", "−")


def seconds(value: float) -> str:
    """Seconds to a hundredth, or to three digits where they are more than ten."""
    return number(value) if not 0 < value < 10 else f"{value:.2f}" if value >= 0.1 else number(value, 2)


def headings(*, sequence: bool) -> list[str]:
    """The columns' names; flicker only for a sequence of frames."""
    names = ["point", "warm, s", "least–greatest", "cold, s", "FLIP", "RMSE", "relative MSE", "PSNR, dB"]
    return [*names, "bias R, G, B", "fireflies", *(["flicker"] if sequence else [])]


def cells(row: Row, *, sequence: bool) -> list[str]:
    """A row's texts below `headings`. A star is put before points on the Pareto front.

    One warm render has no spread, and says nothing about how repeatable it is.
    """
    bias = ", ".join(signed(value) for value in (row.bias_red, row.bias_green, row.bias_blue))
    return [
        f"{ON_FRONT} {row.title}" if row.pareto else row.title,
        seconds(row.warm_s),
        _spread(row),
        seconds(row.cold_s),
        number(row.flip),
        number(row.rmse),
        number(row.relative_mse),
        number(row.psnr),
        bias,
        number(row.fireflies),
        *([number(row.flicker)] if sequence else []),
    ]


def _spread(row: Row) -> str:
    """Least and greatest warm seconds, `once` where there was one render."""
    if row.warm_renders > 1:
        return f"{seconds(row.warm_least_s)}–{seconds(row.warm_greatest_s)}"
    return "once" if row.warm_renders else UNKNOWN


def signed(value: float) -> str:
    """A signed error to a thousandth, or to three digits where it is more than ten."""
    if not -10 < value < 10:
        return ("+" if value > 0 else "") + number(value)
    return f"{value:+.3f}".replace("-", "−") if abs(value) >= 0.0005 else "0.000"


def markdown_table(header: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """A Markdown table; its texts are escaped, all but the first column is set to the right."""
    lines = [header, ["---", *["--:"] * (len(header) - 1)]]
    lines += [[markdown_text(cell) for cell in line] for line in body]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def markdown_text(text: str) -> str:
    """Any text as Markdown and HTML show it, on one line."""
    return re.sub(r"([\\`*_{}\[\]<>()#|~&])", r"\\\1", " ".join(text.split()))
