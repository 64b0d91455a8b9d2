# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.render.atlas import AtlasLayout, Slot

PAGE = 64

STEPS = st.lists(st.tuples(st.booleans(), st.integers(0, 6), st.integers(0, 2**16)), max_size=120)
"""Allocate a square of 2ⁿ texels, or release the one that a number picks."""


def painted(slots, pages):
    """(pages, PAGE, PAGE) how many slots cover each texel; fails where one reaches out of its page."""
    covered = np.zeros((pages, PAGE, PAGE), np.int64)
    for slot in slots:
        assert 0 <= slot.page < pages
        assert 0 <= slot.x <= PAGE - slot.size
        assert 0 <= slot.y <= PAGE - slot.size
        covered[slot.page, slot.y : slot.y + slot.size, slot.x : slot.x + slot.size] += 1
    return covered


def used(layout, steps):
    """The slots that are held after some steps, none of which ever overlaps another."""
    held = []
    for releases, power, pick in steps:
        if releases and held:
            layout.release(held.pop(pick % len(held)))
            continue
        slot = layout.allocate(2**power)
        if slot is None:
            continue
        assert slot.size == 2**power
        held.append(slot)
        assert painted(held, layout.pages).max() == 1
    return held


@given(st.integers(1, 3), STEPS)
def test_squares_lie_within_pages_and_never_overlap(pages, steps):
    held = used(AtlasLayout(PAGE, pages), steps)
    covered = painted(held, pages)
    assert covered.max(initial=0) <= 1
    assert covered.sum() == sum(slot.size**2 for slot in held)


@given(st.integers(1, 3), STEPS, st.randoms(use_true_random=False))
def test_all_is_free_again_when_everything_was_released(pages, steps, order):
    layout = AtlasLayout(PAGE, pages)
    held = used(layout, steps)
    order.shuffle(held)
    for slot in held:
        layout.release(slot)
    whole = [layout.allocate(PAGE) for _ in range(pages)]
    assert None not in whole
    assert (painted(whole, pages) == 1).all()
    assert layout.allocate(1) is None


@given(st.lists(st.integers(0, 6), max_size=200), st.integers(0, 3))
def test_squares_that_fit_by_area_fit_from_the_largest_on(powers, pages):
    """Powers of two tile: the promise that lets maps be placed wherever their texels suffice."""
    layout = AtlasLayout(PAGE, pages)
    free = pages * PAGE**2
    for power in sorted(powers, reverse=True):
        slot = layout.allocate(2**power)
        assert (slot is not None) == (4**power <= free)
        free -= 4**power if slot else 0


@given(STEPS, st.integers(0, 6))
def test_nothing_is_refused_where_an_aligned_square_is_free(steps, power):
    layout = AtlasLayout(PAGE, 1)
    held = used(layout, steps)
    size = 2**power
    blocks = painted(held, 1).reshape(PAGE // size, size, PAGE // size, size).sum(axis=(1, 3))
    assert (layout.allocate(size) is not None) == bool((blocks == 0).any())


def test_small_squares_leave_large_ones_whole():
    """The second page is not broken up as long as there are small places on the first."""
    layout = AtlasLayout(PAGE, 2)
    slots = [layout.allocate(PAGE // 4) for _ in range(16)]
    assert {slot.page for slot in slots} == {0}
    assert layout.allocate(PAGE) == Slot(1, 0, 0, PAGE)


@pytest.mark.parametrize("pages", [0, 1, 5])
def test_what_is_larger_than_a_page_is_refused(pages):
    layout = AtlasLayout(PAGE, pages)
    assert layout.allocate(2 * PAGE) is None
    assert [layout.allocate(PAGE) is not None for _ in range(pages + 1)] == [True] * pages + [False]
