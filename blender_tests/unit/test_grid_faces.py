# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.render.grid import faces as grid_faces
from addon.render.grid.faces import FACES_PER_ROW, MOST_FACES, ORIENTATIONS, number_faces
from addon.render.grid.levels import GridLevel

pytestmark = pytest.mark.filterwarnings("error")

SIZES = st.lists(st.tuples(*[st.integers(1, 5)] * 3), min_size=1, max_size=4)
SHARES = st.sampled_from([0.0, 0.05, 0.5, 1.0])
FEW = settings(max_examples=50)
SEEDS = st.integers(0, 2**32 - 1)


def levels_of(sizes):
    """Levels of so many cells along each side."""
    return tuple(GridLevel((-1, 2, 0), size, 2.0**index) for index, size in enumerate(sizes))


def any_marks(generator, levels, share, *, paired=True):
    """Which faces there are, at random: 0, or another number."""
    marks = []
    for level in levels:
        there = generator.random((level.count, ORIENTATIONS // 2 if paired else ORIENTATIONS)) < share
        there = np.repeat(there, 2, axis=1) if paired else there
        marks.append((there * generator.integers(1, 256, there.shape)).astype(np.uint8).ravel())
    return tuple(marks)


def in_order(levels, marks):
    """Level, x, y, z, orientation of every face, one after another."""
    found = []
    for index, (level, mark) in enumerate(zip(levels, marks, strict=True)):
        there = mark.reshape(*level.size[::-1], ORIENTATIONS)
        found += [(index, x, y, z, orientation) for z, y, x, orientation in np.argwhere(there).tolist()]
    return found


@FEW
@given(SIZES, SHARES, st.booleans(), SEEDS)
def test_faces_are_numbered_by_level_cell_and_orientation(sizes, share, paired, seed):
    levels = levels_of(sizes)
    marks = any_marks(np.random.default_rng(seed), levels, share, paired=paired)
    faces, expected = number_faces(levels, marks), in_order(levels, marks)
    assert faces.count == len(expected)
    assert faces.places.shape == (len(expected), 2)
    assert faces.places.dtype == faces.table.dtype == np.uint32
    assert faces.cells.tolist() == [[x, y, z] for _, x, y, z, _ in expected]
    assert faces.places[:, 0].tolist() == [x + (y << 10) + (z << 20) for _, x, y, z, _ in expected]
    assert faces.places[:, 1].tolist() == [orientation + 8 * level for level, *_, orientation in expected]
    counts = [sum(face[0] < level for face in expected) for level in range(len(levels) + 1)]
    assert list(faces.first) == counts


@FEW
@given(SIZES, SHARES, st.booleans(), SEEDS)
def test_the_table_leads_to_every_face_and_to_nothing_else(sizes, share, paired, seed):
    levels = levels_of(sizes)
    marks = any_marks(np.random.default_rng(seed), levels, share, paired=paired)
    faces, left = number_faces(levels, marks), in_order(levels, marks)
    assert faces.table.shape == (sum(z for _, _, z in sizes), max(y for _, y, _ in sizes), max(x for x, _, _ in sizes))
    bottoms = np.cumsum([0] + [z for _, _, z in sizes])
    total = len(left)
    for layer, y, x in np.argwhere(faces.table).tolist():
        entry = int(faces.table[layer, y, x])
        level = int(np.searchsorted(bottoms, layer, side="right")) - 1
        for orientation in range(ORIENTATIONS):
            if entry >> orientation & 1:
                number = (entry >> 6) + (entry & (1 << orientation) - 1).bit_count()  # as table.glsl does
                assert number == total - len(left)
                assert left.pop(0) == (level, x, y, layer - bottoms[level], orientation)
    assert not left


@FEW
@given(SIZES, SHARES, SEEDS)
def test_the_other_side_of_a_face_is_its_neighbour(sizes, share, seed):
    levels = levels_of(sizes)
    faces = number_faces(levels, any_marks(np.random.default_rng(seed), levels, share))
    opposite = faces.places[np.arange(faces.count) ^ 1]
    assert np.array_equal(opposite[:, 0], faces.places[:, 0])
    assert np.array_equal(opposite[:, 1], faces.places[:, 1] ^ 1)


@pytest.mark.parametrize("size", [(1024, 1, 1), (1, 1024, 1), (1, 1, 1024), (160, 2, 160)])
def test_the_farthest_cell_has_a_place(size):
    (level,) = levels_of([size])
    marks = np.zeros((level.count, ORIENTATIONS), np.uint8)
    marks[-1, 4:] = 1
    faces = number_faces((level,), (marks.ravel(),))
    assert faces.cells.tolist() == [[side - 1 for side in size]] * 2
    assert faces.places[:, 1].tolist() == [4, 5]
    assert faces.table[size[2] - 1, size[1] - 1, size[0] - 1] == 0b110000


@pytest.mark.parametrize(("cells", "rows"), [(0, 1), (1, 1), (512, 1), (513, 2), (1024, 2)])
def test_rows_hold_all_faces(cells, rows):
    assert FACES_PER_ROW == 1024
    (level,) = levels_of([(1024, 1, 1)])
    marks = np.zeros((level.count, ORIENTATIONS), np.uint8)
    marks[:cells, 2:4] = 1
    faces = number_faces((level,), (marks.ravel(),))
    assert (faces.count, faces.rows) == (2 * cells, rows)


def test_more_faces_than_the_table_can_number_are_refused(monkeypatch):
    assert np.iinfo(np.uint32).max == (MOST_FACES - 1 << 6 | 63)
    levels = levels_of([(2, 2, 2), (1, 1, 1)])
    marks = tuple(np.ones(ORIENTATIONS * level.count, np.uint8) for level in levels)
    monkeypatch.setattr(grid_faces, "MOST_FACES", 54)
    assert number_faces(levels, marks).count == 54
    monkeypatch.setattr(grid_faces, "MOST_FACES", 53)
    with pytest.raises(ValueError, match="more than 53 faces"):
        number_faces(levels, marks)
