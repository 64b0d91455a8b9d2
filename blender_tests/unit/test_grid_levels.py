# SPDX-License-Identifier: GPL-3.0-or-later
from itertools import pairwise
from math import inf, log2, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.render.grid.levels import (
    BYTES_PER_CELL,
    COARSER,
    MOST_LEVELS,
    GridLevel,
    cell_size,
    expected_faces,
    grid_levels,
    lattice_shift,
)

pytestmark = pytest.mark.filterwarnings("error")

AMPLE = 512 << 20
MOST_CELLS = 160
"""Along a side: ten bits of a face's place hold them, and six levels of so many are less than `AMPLE`."""

BLOCK = 8
"""Cells that a level that does not cover the scene moves by."""

ROUNDING = 1e-6
"""Cells: positions of up to 1e9 of them are exact to 2⁻²³."""

FEW = settings(max_examples=50)
SEEDS = st.integers(0, 2**32 - 1)
CELLS = st.integers(8, 512)
ANYWHERE = st.one_of(
    st.floats(-1e30, 1e30), st.floats(-10.0, 10.0), st.sampled_from([nan, inf, -inf, 1e30, -1e30, 1e-45, -0.0])
)
CORNERS = st.tuples(ANYWHERE, ANYWHERE, ANYWHERE)


def any_view(generator):
    """A scene's box, a place in it, and cells for what is seen there: from a room to a city with a cup."""
    size = 10.0 ** generator.uniform(-1.0, 2.0) * 10.0 ** generator.uniform(-1.0, 0.0, 3)
    low = generator.normal(size=3) * 10.0 ** generator.uniform(-2.0, 3.0)
    bounds = np.stack([low, low + size])
    center = low + generator.random(3) * size
    return bounds, center, size.max() * 10.0 ** generator.uniform(-4.0, 0.5)


def along(box, level):
    """Corners (2, 3) or a place (3,) in cells of a level's lattice."""
    return box / level.cell - np.array(level.shift)


def covers(level, bounds):
    """Whether a level holds a box with a cell to spare on each side."""
    low, high = along(bounds, level)
    spare = np.concatenate([low - level.lowest, np.add(level.lowest, level.size) - high])
    return bool((spare >= 1.0 - ROUNDING).all())


def test_a_level_is_the_box_that_its_cells_fill():
    level = GridLevel((1, -2, 3), (4, 5, 6), 0.5, (0.25, 0.5, 0.75))
    assert level.origin.tolist() == [0.625, -0.75, 1.875]
    assert level.bounds.tolist() == [[0.625, -0.75, 1.875], [2.625, 1.75, 4.875]]
    assert level.count == 120


@FEW
@given(st.floats(1e-30, 1e30), CELLS, st.integers(0, 2), st.floats(0.0, 1.0))
def test_as_many_cells_are_along_the_longest_side_in_sixteenths_of_octaves(side, cells, axis, share):
    seen = np.zeros((2, 3))
    seen[0] = -0.25 * share * side
    seen[1] = 0.75 * share * side
    seen[:, axis] = 0.0, side
    cell = cell_size(seen, cells)
    assert side / cells * (1.0 - 1e-12) <= cell <= side / cells * COARSER * (1.0 + 1e-12)
    assert 16.0 * log2(cell) == pytest.approx(round(16.0 * log2(cell)), abs=1e-9)


@pytest.mark.parametrize("high", [0.0, -1.0, nan, inf])
def test_what_has_no_size_has_cells_of_a_metre(high):
    assert cell_size(np.array([[0.0, 0.0, 0.0], [high] * 3]), 64) == 1.0


def test_lattices_are_far_from_one_another_however_many_there_are():
    """Half as far at least as the points of a cubic lattice of as many; none is the world's."""
    shifts = np.array([lattice_shift(index) for index in range(512)])
    assert shifts.min() > 0.0
    assert shifts.max() < 1.0
    for count in range(2, 513):
        apart = shifts[: count - 1] - shifts[count - 1]
        nearest = np.linalg.norm(apart - np.rint(apart), axis=1).min()
        assert nearest >= 0.5 * count ** (-1.0 / 3.0)


@FEW
@given(SEEDS, CELLS, st.integers(0, 100))
def test_every_level_ends_with_the_scene_or_where_it_is_as_large_as_it_may_be_about_the_centre(seed, cells, lattice):
    generator = np.random.default_rng(seed)
    bounds, center, cell = any_view(generator)
    levels = grid_levels(bounds, center, cell, cells, AMPLE, lattice)
    half = min(max(int(1.25 * cells), 2 * BLOCK), MOST_CELLS) // 2
    assert [level.cell for level in levels] == [cell * 2.0**index for index in range(len(levels))]
    assert {level.shift for level in levels} == {lattice_shift(lattice)}
    for level in levels:
        low, high, middle = *along(bounds, level), along(center, level)
        lowest, highest = np.array(level.lowest), np.add(level.lowest, level.size)
        whole = covers(level, bounds)
        assert whole == bool((np.floor(high) - np.floor(low) + 3 <= MOST_CELLS).all())
        for spare, reach in ((low - lowest, middle - lowest), (highest - high, highest - middle)):
            with_scene = (spare >= 1.0 - ROUNDING) & (spare <= 2.0 + ROUNDING)
            about = (reach >= half - BLOCK / 2 - ROUNDING) & (reach <= half + BLOCK / 2 + ROUNDING)
            assert (with_scene | (about & (spare <= 2.0 + ROUNDING))).all()
            assert with_scene.all() or not whole


@FEW
@given(SEEDS, CELLS)
def test_there_are_levels_until_one_covers_the_scene(seed, cells):
    bounds, center, cell = any_view(np.random.default_rng(seed))
    levels = grid_levels(bounds, center, cell, cells, AMPLE)
    assert 2 <= len(levels) <= MOST_LEVELS
    assert covers(levels[-1], bounds) or len(levels) == MOST_LEVELS
    assert not any(covers(level, bounds) for level in levels[1:-1])


@FEW
@given(SEEDS, st.integers(48, 128))
def test_what_is_seen_is_within_the_finest_level(seed, cells):
    generator = np.random.default_rng(seed)
    bounds = np.array([[-1e4] * 3, [1e4] * 3])
    low = generator.uniform(-9e3, 8e3, 3)
    seen = np.stack([low, low + generator.uniform(0.0, 10.0 ** generator.uniform(-1.0, 3.0), 3)])
    finest = grid_levels(bounds, seen.mean(axis=0), cell_size(seen, cells), cells, AMPLE)[0]
    assert (finest.bounds[0] <= seen[0]).all()
    assert (finest.bounds[1] >= seen[1]).all()


@FEW
@given(SEEDS, CELLS, st.integers(8, 28))
def test_cells_are_no_larger_than_the_memory_asks_for(seed, cells, power):
    bounds, center, cell = any_view(np.random.default_rng(seed))
    memory = 1 << power

    def needed(at):
        return BYTES_PER_CELL * sum(level.count for level in grid_levels(bounds, center, at, cells, AMPLE))

    levels = grid_levels(bounds, center, cell, cells, memory)
    assert BYTES_PER_CELL * sum(level.count for level in levels) <= memory
    steps = round(log2(levels[0].cell / cell) / log2(COARSER))
    tried = [cell]
    for _ in range(steps):
        tried.append(tried[-1] * COARSER)
    assert levels[0].cell == tried[-1]
    assert steps == 0 or needed(tried[-2]) > memory


@pytest.mark.parametrize("center", [(0.0, 0.0, 0.0), (100.0, 100.0, 100.0), (nan, nan, nan)])
@pytest.mark.parametrize("memory", [0, 100, 500, 1 << 20])
def test_too_little_memory_and_a_centre_off_the_scene_end_with_few_cells(center, memory):
    """3 along each side are the fewest that a scene in one cell is covered by, with one to spare on each side."""
    levels = grid_levels(np.array([[-1.0] * 3, [1.0] * 3]), np.array(center), 0.01, 96, memory)
    assert BYTES_PER_CELL * sum(level.count for level in levels) <= max(memory, 2 * BYTES_PER_CELL * 3**3)


@FEW
@given(SEEDS, st.integers(8, 200), st.floats(0.0, 100.0))
def test_levels_of_a_moved_camera_are_of_the_same_lattice_and_move_by_whole_blocks(seed, cells, far):
    generator = np.random.default_rng(seed)
    bounds, cell = np.array([[-1e6] * 3, [1e6] * 3]), 0.1
    center = generator.uniform(-1e3, 1e3, 3)
    moved = center + generator.uniform(-far, far, 3)
    pairs = list(zip(*(grid_levels(bounds, at, cell, cells, AMPLE, 3) for at in (center, moved)), strict=True))
    assert len(pairs) == MOST_LEVELS
    for before, after in pairs:
        assert (after.cell, after.shift, after.size) == (before.cell, before.shift, before.size)
        steps = np.subtract(after.lowest, before.lowest)
        assert (steps % BLOCK == 0).all()
        assert (np.abs(steps - (moved - center) / before.cell) < BLOCK).all()


@FEW
@given(CORNERS, CORNERS, CORNERS, st.floats(1e-6, 1e6), CELLS)
def test_nothing_overflows(first, second, center, cell, cells):
    bounds = np.sort([first, second], axis=0)
    levels = grid_levels(bounds, np.array(center), cell, cells, AMPLE)
    assert 2 <= len(levels) <= MOST_LEVELS
    for below, above in pairwise(levels):
        assert above.cell == 2.0 * below.cell
    for level in levels:
        assert np.isfinite(level.bounds).all()
        assert all(1 <= size <= MOST_CELLS for size in level.size)
        assert all(isinstance(number, int) for number in (*level.lowest, *level.size))


@pytest.mark.parametrize("far", [1e12, 1e30])
def test_little_memory_and_an_endless_scene_have_large_cells(far):
    levels = grid_levels(np.array([[-far] * 3, [far] * 3]), np.zeros(3), 0.01, 512, 1 << 20)
    assert BYTES_PER_CELL * sum(level.count for level in levels) <= 1 << 20
    assert np.isfinite([level.bounds for level in levels]).all()


LEVEL = GridLevel((0, 0, 0), (16, 16, 16), 0.5)
"""8 m along each side."""


def square(low, high, z):
    """The box around a square of constant z."""
    return np.array([[[low, low, z], [high, high, z]]])


def faces_of(box, levels=(LEVEL,), area=16.0):
    """What is expected of one box."""
    return expected_faces(levels, box, np.array([area]))


def test_faces_are_expected_by_the_squares_of_cells_that_surface_has():
    inside = faces_of(square(2.0, 6.0, 3.0))
    assert inside >= 2.0 * 16.0 / 0.5**2  # both sides of each
    assert faces_of(square(2.0, 6.0, 3.0), area=48.0) == pytest.approx(3.0 * inside)
    assert faces_of(square(2.0, 6.0, 3.0), (GridLevel((-1, -1, -1), (40, 40, 40), 0.25),)) == pytest.approx(4 * inside)
    assert faces_of(square(2.0, 6.0, 3.0), (LEVEL, LEVEL)) == pytest.approx(2.0 * inside)
    both = expected_faces((LEVEL,), np.concatenate([square(2.0, 6.0, 3.0)] * 2), np.array([16.0, 4.0]))
    assert both == pytest.approx(1.25 * inside)
    assert expected_faces((LEVEL,), np.zeros((0, 2, 3)), np.zeros(0)) == 0.0


def test_only_the_share_of_surface_that_a_level_holds_counts():
    inside = faces_of(square(2.0, 6.0, 3.0))
    assert faces_of(square(-2.0, 2.0, 3.0)) == pytest.approx(0.25 * inside)
    assert faces_of(square(2.0, 6.0, 8.0)) == pytest.approx(0.5 * inside)  # half of the cells that it is in
    assert faces_of(square(2.0, 6.0, 8.25)) == 0.0
    assert faces_of(square(-6.0, -2.0, 3.0)) == 0.0


@FEW
@given(SEEDS, st.lists(st.sampled_from([0.0, 1e-30, 1.0, 8.0, 1e9, 1e17, 1e30]), min_size=6, max_size=6))
def test_wherever_surface_is_it_has_from_none_to_all_of_its_faces(seed, places):
    generator = np.random.default_rng(seed)
    boxes = np.sort(generator.choice([-1.0, 1.0], 6) * places).reshape(1, 2, 3)
    found = faces_of(np.sort(boxes, axis=1))
    assert 0.0 <= found <= faces_of(square(2.0, 6.0, 3.0)) * (1.0 + 1e-12)
