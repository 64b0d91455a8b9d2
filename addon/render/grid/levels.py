# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the levels of the radiance grid are and how large their cells. Pure: no OpenGL, no Blender."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log2

import numpy as np

from ...scene.arrays import Float64Array

MOST_LEVELS = 6
"""Each has cells twice as large as the one before."""

_MOST_CELLS = 160
"""Cells along each side of a level that covers the scene at most."""

_FEWEST_CELLS = 3**3
"""Of a level that covers the scene, however large they are."""

_SPREAD = 1.25
"""Sides of other levels over that of what is seen, which is within the finest."""

_FACES_PER_AREA = 2.2
"""Faces per square of a cell's side of surface, as Cornell and Sponza have them: both sides, and cells only touched."""

_FARTHEST = 1e9
"""Cells from the world's origin: beyond, float64 tells positions inside a cell apart no better than float32."""

_STEP = (0.8191725133961645, 0.6710436067037893, 0.5497004779019703)
"""Of Roberts' R3 sequence (2018, "The Unreasonable Effectiveness of Quasirandom Sequences")."""

_SNAP = 8
"""A level that does not cover the scene moves by so many of its cells at a time."""

_STEPS_PER_OCTAVE = 16
COARSER = 2.0 ** (1.0 / _STEPS_PER_OCTAVE)
"""Cell sizes are rounded so, lest every movement of the camera be another grid. From one to the next light changes by
less than ½ %: an octave, from 64 to 128 cells, changes Cornell's by 1.7 % and Sponza's by 2 %."""

BYTES_PER_CELL = 4
"""Of the table of cells; what is in them comes on top: `textures.bytes_per_face`."""


@dataclass(frozen=True)
class GridLevel:
    """A box of cubic cells aligned with the world's axes.

    `lowest` (3,): its lowest cell, counted in cells from the lattice's origin, which is `shift` (3,) cells from the
    world's. `size` (3,): cells along each side. `cell` (m): a cell's side.
    """

    lowest: tuple[int, int, int]
    size: tuple[int, int, int]
    cell: float
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def origin(self) -> Float64Array:
        """(3,) its lowest corner, world space."""
        return (np.array(self.lowest, np.float64) + self.shift) * self.cell

    @property
    def bounds(self) -> Float64Array:
        """(2, 3) its lowest and highest corner, world space."""
        return np.stack([self.origin, self.origin + np.array(self.size) * self.cell])

    @property
    def count(self) -> int:
        """Number of cells."""
        return self.size[0] * self.size[1] * self.size[2]


def cell_size(seen: Float64Array, cells: int) -> float:
    """Side (m) of the finest cells, so that about `cells` of them are along the longest side of what is `seen` (2, 3).

    Rounded up to steps of `COARSER`.
    """
    side = float((seen[1] - seen[0]).max())
    if not (side > 0.0 and np.isfinite(side)):
        return 1.0
    return 2.0 ** (ceil(_STEPS_PER_OCTAVE * log2(side / cells)) / _STEPS_PER_OCTAVE)


def expected_faces(levels: Sequence[GridLevel], boxes: Float64Array, areas: Float64Array) -> float:
    """About how many faces levels have: `areas` (N,) m² of surface, each spread over a box of `boxes` (N, 2, 3)."""
    total = 0.0
    for level in levels:
        low, high = boxes[:, 0] - 0.5 * level.cell, boxes[:, 1] + 0.5 * level.cell
        within = np.minimum(high, level.bounds[1]) - np.maximum(low, level.bounds[0])
        shares = np.clip(within / np.maximum(high - low, level.cell), 0.0, 1.0).prod(axis=1)
        total += _FACES_PER_AREA * float((areas * shares).sum()) / level.cell**2
    return total


def lattice_shift(index: int) -> tuple[float, float, float]:
    """Shift (cells, 0…1) of one of many lattices against the world's origin, evenly spread whatever their number.

    None is 0: things are modelled at round numbers, and a surface on the border of two cells would be in either of them
    by rounding.
    """
    x, y, z = (float(np.modf((index + 1) * step)[0]) for step in _STEP)
    return x, y, z


def grid_levels(
    bounds: Float64Array, center: Float64Array, cell: float, cells: int, memory: int, lattice: int = 0
) -> tuple[GridLevel, ...]:
    """Levels from the finest to one that covers the scene's `bounds` (2, 3), as far as `MOST_LEVELS` go; at least two.

    `center` (3,) of what is seen, along which there are about `cells` of the finest, `cell` m large: levels that cannot
    cover the scene are about it. `memory`: bytes that the tables of all levels' cells may take; where that is too
    little, cells are larger. `lattice`: number of one of many that are equally good.
    """
    span = min(max(int(_SPREAD * cells), 2 * _SNAP), _MOST_CELLS)
    while True:
        levels = _levels(bounds, center, cell, span, lattice_shift(lattice))
        counts = [level.count for level in levels]
        if BYTES_PER_CELL * sum(counts) <= memory or max(counts) <= _FEWEST_CELLS:
            return levels
        cell *= COARSER


def _levels(
    bounds: Float64Array, center: Float64Array, cell: float, span: int, shift: tuple[float, float, float]
) -> tuple[GridLevel, ...]:
    levels: list[GridLevel] = []
    for index in range(MOST_LEVELS):
        level, covers = _level(bounds, center, cell * 2.0**index, span, shift)
        levels.append(level)
        if covers and index > 0:
            break
    return tuple(levels)


def _level(
    bounds: Float64Array, center: Float64Array, cell: float, span: int, shift: tuple[float, float, float]
) -> tuple[GridLevel, bool]:
    """A level, and whether it covers the scene: with a cell to spare on each side, for surfaces on a cell's side."""
    ends = np.clip(np.concatenate([bounds, [center]]) / cell - shift, -_FARTHEST, _FARTHEST)
    low, high, middle = np.floor(np.nan_to_num(ends)).astype(np.int64)
    low, high, near = low - 1, high + 2, _SNAP * (middle // _SNAP) + _SNAP // 2
    covered = bool((high - low <= _MOST_CELLS).all())
    if not covered:
        low, high = np.maximum(low, near - span // 2), np.minimum(high, near + span // 2)
    size = np.maximum(high - low, 1)
    lowest = (int(low[0]), int(low[1]), int(low[2]))
    return GridLevel(lowest, (int(size[0]), int(size[1]), int(size[2])), cell, shift), covered
