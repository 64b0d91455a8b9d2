# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the levels of the radiance grid are and how large their cells. Pure: no OpenGL, no Blender."""

from dataclasses import dataclass
from math import ceil, log2

import numpy as np

from ...scene.arrays import Float64Array

MOST_LEVELS = 6
"""Each has cells twice as large as the one before."""

_MOST_CELLS = 160
"""Cells along each side of a level at most."""

_SNAP = 8
"""A level that does not cover the scene moves by so many of its cells at a time."""

_STEPS_PER_OCTAVE = 4
"""Cell sizes are rounded so, lest every movement of the camera be another grid."""

BYTES_PER_CELL = 4
"""Of the table of cells; what is in them comes on top: `faces.BYTES_PER_FACE`."""


@dataclass(frozen=True)
class GridLevel:
    """A box of cubic cells aligned with the world's axes.

    `lowest` (3,) int64: its lowest cell, counted in cells from the world's origin. `size` (3,): cells along each side.
    `cell` (m): a cell's side.
    """

    lowest: tuple[int, int, int]
    size: tuple[int, int, int]
    cell: float

    @property
    def origin(self) -> Float64Array:
        """(3,) its lowest corner, world space."""
        return np.array(self.lowest, np.float64) * self.cell

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

    Rounded to quarters of octaves.
    """
    side = float((seen[1] - seen[0]).max())
    if not (side > 0.0 and np.isfinite(side)):
        return 1.0
    return 2.0 ** (ceil(_STEPS_PER_OCTAVE * log2(side / cells)) / _STEPS_PER_OCTAVE)


def grid_levels(bounds: Float64Array, center: Float64Array, cell: float, memory: int) -> tuple[GridLevel, ...]:
    """Levels from the finest to one that covers the scene's `bounds` (2, 3), as far as `MOST_LEVELS` go; at least two.

    A level that cannot cover the scene is about `center` (3,). `cell` (m) of the finest. `memory`: bytes that the
    tables of all levels' cells may take; where that is too little, cells are larger.
    """
    while True:
        levels = _levels(bounds, center, cell)
        if BYTES_PER_CELL * sum(level.count for level in levels) <= memory or levels[0].count <= 8:
            return levels
        cell *= 2.0 ** (1.0 / _STEPS_PER_OCTAVE)


def _levels(bounds: Float64Array, center: Float64Array, cell: float) -> tuple[GridLevel, ...]:
    levels: list[GridLevel] = []
    for index in range(MOST_LEVELS):
        level, covers = _level(bounds, center, cell * 2.0**index)
        levels.append(level)
        if covers and index > 0:
            break
    return tuple(levels)


def _level(bounds: Float64Array, center: Float64Array, cell: float) -> tuple[GridLevel, bool]:
    """A level, and whether it covers the scene: with a cell to spare on each side, for surfaces on a cell's side."""
    low = np.floor(bounds[0] / cell).astype(np.int64) - 1
    high = np.floor(bounds[1] / cell).astype(np.int64) + 2
    near = _SNAP * np.floor(center / (_SNAP * cell) + 0.5).astype(np.int64)
    covered = high - low <= _MOST_CELLS
    low = np.where(covered, low, np.maximum(low, near - _MOST_CELLS // 2))
    high = np.where(covered, high, np.minimum(high, near + _MOST_CELLS // 2))
    size = np.maximum(high - low, 1)
    lowest = (int(low[0]), int(low[1]), int(low[2]))
    return GridLevel(lowest, (int(size[0]), int(size[1]), int(size[2])), cell), bool(covered.all())
