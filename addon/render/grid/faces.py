# SPDX-License-Identifier: GPL-3.0-or-later
"""Which cells of the radiance grid hold surfaces, and how these are numbered. Pure: no OpenGL, no Blender.

A cell's surfaces are told apart by the axis that their normals are nearest to: +X, −X, +Y, −Y, +Z, −Z. Each such part
is a *face*, with a plane, a colour and light of its own, so that both sides of a wall inside one cell are two faces.
"""

from dataclasses import dataclass

import numpy as np

from ...scene.arrays import Int64Array, UInt8Array, UInt32Array
from .levels import GridLevel

ORIENTATIONS = 6
FACES_PER_ROW = 1024
"""Faces in a row of the textures that hold them."""

_MASK_BITS = 6
_COORDINATE_BITS = 10
MOST_FACES = 1 << (32 - _MASK_BITS)


@dataclass(frozen=True)
class Faces:
    """The faces of all levels, by level, cell and orientation.

    `table` (D, H, W) uint32: of each cell, x fastest, the levels one above another along z: the number of its first
    face times 64, and a bit for each orientation that it has; 0 where it is empty.
    `places` (N, 2) uint32: of each face the cell's x, y, z within its level, ten bits each; its orientation and, from
    bit 3 on, its level. `first` (levels + 1,): number of each level's first face.
    """

    table: UInt32Array
    places: UInt32Array
    first: tuple[int, ...]

    @property
    def count(self) -> int:
        """Number of faces."""
        return self.first[-1]

    @property
    def cells(self) -> Int64Array:
        """(N, 3) of each face the cell's x, y, z within its level."""
        packed, mask = self.places[:, 0].astype(np.int64), (1 << _COORDINATE_BITS) - 1
        return np.stack([packed & mask, packed >> _COORDINATE_BITS & mask, packed >> 2 * _COORDINATE_BITS], axis=1)

    @property
    def rows(self) -> int:
        """Rows of a texture that holds them, at least one."""
        return max(-(-self.count // FACES_PER_ROW), 1)


def number_faces(levels: tuple[GridLevel, ...], occupied: tuple[UInt8Array, ...]) -> Faces:
    """Number what is there: `occupied` (6 · cells,) per level, cell by cell, is not 0 where there is a face.

    Opposite faces are there together.

    Raises ValueError where there are more than `MOST_FACES`.
    """
    width, height = (max(level.size[axis] for level in levels) for axis in (0, 1))
    table = np.zeros((sum(level.size[2] for level in levels), height, width), np.uint32)
    places: list[UInt32Array] = []
    first, bottom = [0], 0
    for index, (level, mark) in enumerate(zip(levels, occupied, strict=True)):
        found = np.flatnonzero(mark)
        cells, orientations = np.divmod(found, ORIENTATIONS)
        if first[-1] + len(found) > MOST_FACES:
            raise ValueError(f"the radiance grid would have more than {MOST_FACES} faces")
        x, y, z = _coordinates(cells, level)
        if len(found):
            starts = np.flatnonzero(np.diff(cells, prepend=-1))
            masks = np.add.reduceat(1 << orientations, starts)
            entries = (first[-1] + starts) << _MASK_BITS | masks
            table[bottom + z[starts], y[starts], x[starts]] = entries
        packed = x | y << _COORDINATE_BITS | z << 2 * _COORDINATE_BITS
        places.append(np.stack([packed, orientations | index << 3], axis=1).astype(np.uint32))
        first.append(first[-1] + len(found))
        bottom += level.size[2]
    return Faces(table, np.concatenate(places), tuple(first))


def _coordinates(cells: Int64Array, level: GridLevel) -> tuple[Int64Array, Int64Array, Int64Array]:
    rest, x = np.divmod(cells, level.size[0])
    z, y = np.divmod(rest, level.size[1])
    return x, y, z
