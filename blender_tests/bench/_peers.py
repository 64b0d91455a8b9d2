# SPDX-License-Identifier: GPL-3.0-or-later
"""The other engines' FLIP as it was measured before the report existed, and whether the report finds it again."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from tooling.report.tables import Row, named

LIMIT = 0.01
"""How far FLIP of Cycles may be from what is known."""

NAMES = (
    (r"Cycles (\d+) spp \+ fast denoiser", "Cycles, denoised: {} spp"),
    (r"Cycles (\d+) spp, none", "Cycles: {} spp"),
    (r"EEVEE (\d+) samples?, ray tracing", "EEVEE: {} spp"),
    (r"Workbench()", "Workbench"),
)
"""What rows of the known table are called, and the report's points."""

Known = Mapping[str, Mapping[str, float]]
"""FLIP by scene, then by the report's name of the point."""


@dataclass(frozen=True)
class Pair:
    """FLIP of a point that was known and is measured now; None: it was not measured."""

    scene: str
    point: str
    known: float
    measured: float | None

    @property
    def is_cycles(self) -> bool:
        """Whether it has to be the same to within `LIMIT`."""
        return self.point.startswith("Cycles")


def known(text: str) -> dict[str, dict[str, float]]:
    """The known table, from the Markdown of the shared scenes' README: rows are points, columns scenes.

    Raises ValueError where there is none.
    """
    lines = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in text.splitlines() if "|" in line]
    rows = {point: cells[1:] for cells in lines if (point := _point(cells[0]))}
    header = next((cells for cells in lines if not cells[0] and len(cells) > 1), None)
    if not rows or header is None:
        raise ValueError("there is no table of other engines' FLIP")
    return {
        scene: {point: _flip(cells[column]) for point, cells in rows.items()} for column, scene in enumerate(header[1:])
    }


def _point(name: str) -> str:
    """The report's name of a row of the known table; "" for other rows."""
    matches = ((re.fullmatch(pattern, name), point) for pattern, point in NAMES)
    return next((point.format(match[1]) for match, point in matches if match), "")


def _flip(cell: str) -> float:
    """The last number of a cell like `2.0 s (cold 22.8), .580`. Raises ValueError where there is none."""
    match = re.search(r"(\d*\.\d+)$", cell)
    if match is None:
        raise ValueError(f"{cell!r} does not end with FLIP")
    return float(match[1])


def compare(expected: Known, scenes: Sequence[Sequence[Row]]) -> list[Pair]:
    """Every known figure of the scenes that were measured, beside the measured one."""
    pairs: list[Pair] = []
    for rows in scenes:
        measured = {named(row.series, row.label): row.flip for row in rows}
        scene = rows[0].scene if rows else ""
        pairs += [Pair(scene, point, flip, measured.get(point)) for point, flip in expected.get(scene, {}).items()]
    return pairs


def failures(pairs: Sequence[Pair]) -> list[str]:
    """What is not as it was, in sentences: Cycles' FLIP, and which of two points has the lower one."""
    found = [f"{pair.scene}: {pair.point} was not measured." for pair in pairs if pair.measured is None]
    found += [
        f"{pair.scene}: {pair.point} has FLIP {pair.measured:.4f}, and had {pair.known:.3f}."
        for pair in pairs
        if pair.is_cycles and pair.measured is not None and not abs(pair.measured - pair.known) <= LIMIT
    ]
    return found + [
        f"{first.scene}: {first.point} and {second.point} have changed places."
        for first, second in combinations(pairs, 2)
        if first.scene == second.scene and _changed_places(first, second)
    ]


def _changed_places(first: Pair, second: Pair) -> bool:
    """Whether another of the two has the lower FLIP now; never where one was not measured or they were equal."""
    if first.measured is None or second.measured is None or first.known == second.known:
        return False
    return (first.known < second.known) != (first.measured < second.measured)
