# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import replace
from itertools import product, zip_longest
from math import inf, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.render.grid.changes import (
    NOTHING_CHANGED,
    Surfaces,
    changed_boxes,
    kept_cells,
    kept_marks,
    sources,
    world_box,
)
from addon.render.grid.faces import ORIENTATIONS, number_faces
from addon.render.grid.levels import GridLevel

pytestmark = pytest.mark.filterwarnings("error")

FEW = settings(max_examples=50)
SEEDS = st.integers(0, 2**32 - 1)
COUNTS = st.integers(0, 6)
SHIFT = (0.25, 0.4, 0.7)

ROUNDING = 0.01
"""Cells by which surfaces may be elsewhere for the GPU's float32."""


def any_surfaces(generator, count, appearance="white"):
    """So many instances anywhere."""
    low = generator.normal(size=(count, 3))
    boxes = np.stack([low, low + generator.random((count, 3))], axis=1)
    ids = generator.permutation(1000)[:count] - 500
    return Surfaces(appearance, ids, generator.normal(size=(count, 4, 4)), boxes)


def rows(surfaces, chosen):
    """Some of the instances, in this order."""
    return replace(surfaces, ids=surfaces.ids[chosen], matrices=surfaces.matrices[chosen], boxes=surfaces.boxes[chosen])


def together(*parts):
    """Instances of one draw from several."""
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in ("ids", "matrices", "boxes")}
    return replace(parts[0], **joined)


def different(*boxes):
    """Boxes (N, 2, 3) as a set; NaN is NaN."""
    return {tuple(map(repr, box.ravel().tolist())) for box in np.concatenate(boxes)}


def assert_changed(before, after, *boxes):
    """That these boxes are what changed, whichever of the two is first."""
    for found in (changed_boxes(before, after), changed_boxes(after, before)):
        assert different(found) == different(NOTHING_CHANGED, *boxes)


def test_of_many_changes_the_box_around_them_is_told():
    draw = any_surfaces(np.random.default_rng(1), 300)
    found = changed_boxes({}, {"draw": draw})
    np.testing.assert_array_equal(found, [[draw.boxes[:, 0].min(axis=0), draw.boxes[:, 1].max(axis=0)]])


@FEW
@given(COUNTS, COUNTS, COUNTS, COUNTS, SEEDS)
def test_the_changed_boxes_are_those_of_what_moved_came_or_went(resting, moving, coming, going, seed):
    """Of several instances, in any order; what moved is there where it was and where it is."""
    generator = np.random.default_rng(seed)
    every = any_surfaces(generator, resting + moving + coming + going)
    rest, moved, came, went = (
        rows(every, part) for part in np.split(np.arange(len(every.ids)), np.cumsum([resting, moving, coming]))
    )
    there = any_surfaces(generator, moving)
    entry = generator.integers(0, 3, moving), generator.integers(0, 4, moving)
    matrices = moved.matrices.copy()
    matrices[np.arange(moving), *entry] += 1e-9  # the least that moves it
    there = replace(there, ids=moved.ids, matrices=matrices)
    before, after = together(rest, moved, went), together(rest, there, came)
    before, after = (rows(item, generator.permutation(len(item.ids))) for item in (before, after))
    other = any_surfaces(generator, 3)
    assert_changed(
        {"draw": before, "other": other},
        {"other": other, "draw": after},
        *(b.boxes for b in (moved, there, came, went)),
    )


@FEW
@given(COUNTS, COUNTS, SEEDS)
def test_what_looks_otherwise_or_is_another_draw_changed_wherever_it_is(count, others, seed):
    generator = np.random.default_rng(seed)
    draw, rest = any_surfaces(generator, count), any_surfaces(generator, others)
    red = replace(draw, appearance="red")
    assert_changed({"draw": draw, "rest": rest}, {"draw": red, "rest": rest}, draw.boxes)
    assert_changed({"draw": draw, "rest": rest}, {"rest": rest}, draw.boxes)
    assert_changed({"draw": draw}, {"other": rest}, draw.boxes, rest.boxes)
    grown = replace(red, boxes=np.add(draw.boxes, [[-1.0], [1.0]]))
    assert_changed({"draw": draw}, {"draw": grown}, draw.boxes, grown.boxes)
    assert_changed({"draw": draw, "rest": rest}, {"rest": rest, "draw": replace(draw)})
    assert_changed({}, {})


def test_another_instance_in_the_same_place_is_a_change():
    draw = any_surfaces(np.random.default_rng(1), 2)
    other = replace(draw, ids=np.array([draw.ids[0], 999]), boxes=draw.boxes + 7.0)
    assert_changed({"draw": draw}, {"draw": other}, draw.boxes[1:], other.boxes[1:])


def test_what_is_nowhere_never_rests():
    one = any_surfaces(np.random.default_rng(1), 1)
    matrices = np.full((1, 4, 4), nan)
    broken = replace(one, matrices=matrices)
    assert_changed({"draw": broken}, {"draw": broken}, one.boxes)
    lost = replace(broken, boxes=np.full((1, 2, 3), nan))
    assert_changed({"draw": lost}, {"draw": lost}, lost.boxes)


def any_level(generator, **arguments):
    """A few cells near the lattice's origin."""
    lowest, size = generator.integers(-3, 2, 3).tolist(), generator.integers(2, 6, 3).tolist()
    return GridLevel(**{"lowest": tuple(lowest), "size": tuple(size), "cell": 0.3, "shift": SHIFT} | arguments)


def any_change(generator):
    """A box somewhere near, as often as not on the border of a cell; or everywhere."""
    kind = generator.integers(1, 6)
    if kind == 1:
        return np.array([[-inf] * 3, [inf] * 3])
    low = generator.uniform(-3.0, 3.0, 3)
    ends = np.stack([low, low + generator.uniform(0.0, 3.0, 3)])
    ends = np.rint(ends) if kind == 2 else ends
    return (ends + SHIFT) * 0.3


def any_changes(generator):
    """Up to three boxes (K, 2, 3)."""
    return np.array([any_change(generator) for _ in range(generator.integers(0, 4))]).reshape(-1, 2, 3)


def cells_of(level):
    """Index (z, y, x) of every cell by its place in the lattice."""
    return {
        tuple(np.add(level.lowest, (x, y, z)).tolist()): (z, y, x)
        for z, y, x in product(*(range(side) for side in level.size[::-1]))
    }


def kept_places(level, kept):
    """Which cells of the lattice are kept."""
    return {place for place, index in cells_of(level).items() if kept[index]}


@FEW
@given(SEEDS)
def test_cells_are_kept_that_both_levels_have_and_nothing_changed_in(seed):
    generator = np.random.default_rng(seed)
    level, before, changed = any_level(generator), any_level(generator), any_changes(generator)
    kept = kept_cells(level, before, changed)
    assert kept.shape == level.size[::-1]
    assert kept.dtype == np.bool_
    shared = cells_of(level).keys() & cells_of(before).keys()
    for place, index in cells_of(level).items():
        apart = inf  # cells from what changed, along the axis where it is farthest
        for box in changed:
            ends = box / level.cell - SHIFT
            apart = min(apart, np.maximum(ends[0] - np.add(place, 1), place - ends[1]).max())
        if apart > 1.001 * ROUNDING or apart < 0.999 * ROUNDING:
            assert kept[index] == (place in shared and apart > ROUNDING)


@FEW
@given(SEEDS)
def test_the_cells_that_one_keeps_of_the_other_are_those_that_it_keeps_of_this(seed):
    generator = np.random.default_rng(seed)
    first, second, changed = any_level(generator), any_level(generator), any_changes(generator)
    here = kept_places(first, kept_cells(first, second, changed))
    assert here == kept_places(second, kept_cells(second, first, changed))
    assert kept_cells(first, first, NOTHING_CHANGED).all()


@pytest.mark.parametrize("before", [None, {"cell": 0.30000001}, {"shift": (0.25, 0.4, 0.71)}])
def test_nothing_is_kept_of_another_lattice(before):
    level = GridLevel((0, 0, 0), (3, 4, 5), 0.3, SHIFT)
    before = None if before is None else replace(level, **before)
    assert not kept_cells(level, before, NOTHING_CHANGED).any()
    assert before is None or not kept_cells(before, level, NOTHING_CHANGED).any()


@pytest.mark.parametrize("ends", [(-1e30, 1e30), (-inf, inf), (nan, nan), (nan, 1e30), (-1e30, nan)])
def test_nothing_is_kept_where_changes_are_everywhere_or_nobody_knows(ends):
    level = GridLevel((5, 5, 5), (3, 4, 5), 0.3, SHIFT)
    assert not kept_cells(level, level, np.array([[[ends[0]] * 3, [ends[1]] * 3]])).any()


@pytest.mark.parametrize("far", [-1e30, -1e10, 1e10, 1e30, inf])
def test_all_is_kept_where_changes_are_far_away(far):
    level = GridLevel((5, 5, 5), (3, 4, 5), 0.3, SHIFT)
    assert kept_cells(level, level, np.full((1, 2, 3), far)).all()


@FEW
@given(st.sampled_from([0.0, 0.05, 1.0]), SEEDS)
def test_the_world_box_is_around_the_chosen_cells(share, seed):
    generator = np.random.default_rng(seed)
    level = any_level(generator)
    cells = generator.random(level.size[::-1]) < share
    chosen = np.array([place for place, index in cells_of(level).items() if cells[index]])
    box = world_box(cells, level)
    if len(chosen) == 0:
        assert box is None
        return
    low = (chosen + SHIFT) * level.cell
    np.testing.assert_allclose(box, np.stack([low.min(axis=0), low.max(axis=0) + level.cell]), rtol=0.0, atol=1e-12)


def any_marks(generator, level, share=0.4):
    """(cells, 6) which faces there are, opposite ones together."""
    return np.repeat(generator.random((level.count, ORIENTATIONS // 2)) < share, 2, axis=1).astype(np.uint8)


def numbers(levels, faces):
    """Number of each face by level, its cell's place in the lattice, and orientation."""
    found = {}
    for number, (cell, orientation) in enumerate(zip(faces.cells, faces.places[:, 1] & 7, strict=True)):
        level = int(faces.places[number, 1] >> 3)
        found[level, *np.add(levels[level].lowest, cell).tolist(), int(orientation)] = number
    return found


def any_levels(generator, count):
    """Levels of cells that are each twice as large."""
    return tuple(any_level(generator, cell=0.3 * 2.0**index) for index in range(count))


def kept_of(levels, others, changed):
    """Per level the cells that are kept of another grid."""
    return tuple(kept_cells(*pair, changed) for pair in zip_longest(levels, others[: len(levels)]))


@FEW
@given(st.integers(1, 3), SEEDS)
def test_marks_of_kept_cells_are_their_earlier_faces(count, seed):
    generator = np.random.default_rng(seed)
    before, after, changed = any_levels(generator, count), any_levels(generator, count), any_change(generator)
    faces = number_faces(before, tuple(any_marks(generator, level).ravel() for level in before))
    earlier = numbers(before, faces)
    for number, (level, kept) in enumerate(zip(after, kept_of(after, before, changed), strict=True)):
        marks = kept_marks(faces, before[number], number, level, kept)
        assert marks.dtype == np.uint8
        assert marks.shape == (ORIENTATIONS * level.count,)
        marks = marks.reshape(*kept.shape, ORIENTATIONS)
        for place, index in cells_of(level).items():
            expected = [kept[index] and (number, *place, axis) in earlier for axis in range(ORIENTATIONS)]
            assert marks[index].tolist() == expected


@FEW
@given(st.integers(1, 3), st.integers(1, 3), SEEDS)
def test_every_kept_face_is_taken_from_the_same_cells_and_no_other_is(count, count_before, seed):
    """What is kept of an earlier grid, of as many levels or not, has the faces that were there; others any."""
    generator = np.random.default_rng(seed)
    before, after, changed = any_levels(generator, count_before), any_levels(generator, count), any_change(generator)
    old = number_faces(before, tuple(any_marks(generator, level).ravel() for level in before))
    kept, before_kept = kept_of(after, before, changed), kept_of(before, after, changed)
    marks = []
    for number, (level, cells) in enumerate(zip(after, kept, strict=True)):
        there = any_marks(generator, level).ravel()
        if number < count_before:
            earlier = kept_marks(old, before[number], number, level, cells)
            there = np.where(np.repeat(cells.ravel(), ORIENTATIONS), earlier, there)
        marks.append(there)
    new = number_faces(after, tuple(marks))
    found = sources(new, kept, old, before_kept)
    assert found.dtype == np.uint32
    assert found.shape == (new.count,)
    earlier = numbers(before, old)
    places = [kept_places(level, cells) for level, cells in zip(after, kept, strict=True)]
    for face, number in numbers(after, new).items():
        level, *place, _ = face
        assert found[number] == (earlier[face] + 1 if tuple(place) in places[level] else 0)
