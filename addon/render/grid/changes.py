# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a radiance grid stays as it was when the scene changes or the levels move. Pure: no OpenGL, no Blender."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass

import numpy as np

from ...scene.arrays import BoolArray, Float64Array, Int64Array, UInt8Array, UInt32Array
from .faces import ORIENTATIONS, Faces
from .levels import GridLevel

_ROUNDING = 0.01
"""Cells by which changed surfaces may be elsewhere for the GPU's float32."""

_MOST_BOXES = 256
"""Of more changes, what lies between them counts as changed, too."""

NOTHING_CHANGED = np.zeros((0, 2, 3))

_FARTHEST = 2.0**40
"""Cells from the world's origin that are told apart."""


@dataclass(frozen=True)
class Surfaces:
    """What a grid holds of one draw.

    `appearance`: equal to that of the same draw in another scene where its instances differ in nothing but where they
    are. `ids` (N,), `matrices` (N, 4, 4), `boxes` (N, 2, 3) in world space: its instances.
    """

    appearance: Hashable
    ids: Int64Array
    matrices: Float64Array
    boxes: Float64Array


def changed_boxes(before: Mapping[Hashable, Surfaces], after: Mapping[Hashable, Surfaces]) -> Float64Array:
    """(K, 2, 3) boxes in world space around all instances that came, went or look otherwise than before."""
    boxes: list[Float64Array] = []
    for key in before.keys() | after.keys():
        old, new = before.get(key), after.get(key)
        if old is None or new is None or old.appearance != new.appearance:
            boxes += [surfaces.boxes for surfaces in (old, new) if surfaces is not None]
        else:
            kept = _at_rest(old, new), _at_rest(new, old)
            boxes += [surfaces.boxes[~rests] for surfaces, rests in zip((old, new), kept, strict=True)]
    changed = np.concatenate([NOTHING_CHANGED, *boxes])
    return changed if len(changed) <= _MOST_BOXES else box_around(changed)[None]


def box_around(boxes: Float64Array) -> Float64Array:
    """(2, 3) the box around boxes (K, 2, 3), at least one."""
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def _at_rest(surfaces: Surfaces, other: Surfaces) -> BoolArray:
    """(N,) whether an instance is in `other`, too, at the same place."""
    order = np.argsort(other.ids, kind="stable")
    places = np.minimum(np.searchsorted(other.ids, surfaces.ids, sorter=order), max(len(order) - 1, 0))
    if not len(order):
        return np.zeros(len(surfaces.ids), np.bool_)
    rows = order[places]
    return (other.ids[rows] == surfaces.ids) & (other.matrices[rows] == surfaces.matrices).all(axis=(1, 2))


def kept_cells(level: GridLevel, before: GridLevel | None, changed: Float64Array) -> BoolArray:
    """(D, H, W) which cells of a level hold what they held `before`; all that `changed` is in boxes (K, 2, 3), world
    space."""
    kept = np.zeros(level.size[::-1], np.bool_)
    if before is None or (level.cell, level.shift) != (before.cell, before.shift):
        return kept
    start = np.array(before.lowest, np.int64) - level.lowest
    kept[_cells(start, start + before.size, level)] = True
    for box in changed:
        ends = box / level.cell - level.shift + np.array([[-_ROUNDING], [_ROUNDING]])
        ends = np.where(np.isnan(ends), [[-_FARTHEST], [_FARTHEST]], ends)  # what is nobody knows where may be anywhere
        cells = np.floor(np.clip(ends, -_FARTHEST, _FARTHEST)).astype(np.int64) - level.lowest
        kept[_cells(cells[0], cells[1] + 1, level)] = False
    return kept


def _cells(low: Int64Array, high: Int64Array, level: GridLevel) -> tuple[slice, slice, slice]:
    """Index of the cells of a level from `low` (3,) to below `high` (3,)."""
    x, y, z = (slice(*np.clip((low[axis], high[axis]), 0, level.size[axis]).tolist()) for axis in range(3))
    return z, y, x


def world_box(cells: BoolArray, level: GridLevel) -> Float64Array | None:
    """(2, 3) box in world space around chosen cells (D, H, W) of a level; None where none is."""
    if not cells.any():
        return None
    along = [np.flatnonzero(cells.any(axis=others)) for others in ((0, 1), (0, 2), (1, 2))]
    low, high = (np.array([found[end] for found in along]) for end in (0, -1))
    return np.stack([level.origin + low * level.cell, level.origin + (high + 1) * level.cell])


def kept_marks(faces: Faces, before: GridLevel, number: int, level: GridLevel, kept: BoolArray) -> UInt8Array:
    """(6 · cells,) 1 where kept cells (D, H, W) of a level have a face: those of the level's earlier `faces`.

    `before`: where the level was; `number`: which it was of these faces'.
    """
    first, end = faces.first[number : number + 2]
    cells = faces.cells[first:end] + (np.array(before.lowest) - level.lowest)
    orientations = faces.places[first:end, 1] & 7
    marks = np.zeros((*kept.shape, ORIENTATIONS), np.uint8)
    within = ((cells >= 0) & (cells < level.size)).all(axis=1)
    x, y, z = cells[within].T
    marks[z, y, x, orientations[within]] = 1
    return (marks * kept[..., None]).reshape(-1)


def sources(
    faces: Faces, kept: tuple[BoolArray, ...], before: Faces, before_kept: tuple[BoolArray, ...]
) -> UInt32Array:
    """(N,) of each face the number it had `before` plus 1, 0 where its cell is not kept.

    `kept`, `before_kept`: the same cells, as these faces' levels and as the levels before count them. Both have their
    faces in one order: by level, cell and orientation.
    """
    result = np.zeros(faces.count, np.uint32)
    result[_within(faces, kept)] = np.flatnonzero(_within(before, before_kept)) + 1
    return result


def _within(faces: Faces, cells: tuple[BoolArray, ...]) -> BoolArray:
    """(N,) which faces are in chosen cells of their levels."""
    parts = [np.zeros(0, np.bool_)]
    for number, chosen in enumerate(cells):
        x, y, z = faces.cells[faces.first[number] : faces.first[number + 1]].T
        parts.append(chosen[z, y, x])
    return np.concatenate(parts)
