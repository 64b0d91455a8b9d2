# SPDX-License-Identifier: GPL-3.0-or-later
"""What the store of shadow maps keeps, gives up, and how much memory it takes."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from addon.render import RenderError, gl_thread
from addon.render.shadow_store import TEXEL_BYTES, ShadowStore

PAGE = 128
PAGE_BYTES = TEXEL_BYTES * PAGE**2


class Store:
    """A `ShadowStore` of pages of 128 texels a side, used on the GL thread."""

    def __init__(self):
        self._store = self.on_thread(ShadowStore)

    @staticmethod
    def on_thread(job):
        """The result of a job that is given the device."""
        return gl_thread().submit(job).result()

    def begin(self, pages, *, comes_round=True, page=PAGE, spare=0):
        """A new view, whose memory suffices for as many pages and some bytes more."""
        memory = TEXEL_BYTES * page**2 * pages + spare
        self.on_thread(lambda _: self._store.begin_view(page, memory, comes_round=comes_round))

    def place(self, wanted):
        """Slots by key, and the keys that must be drawn."""
        return self.on_thread(lambda _: self._store.place(wanted))

    def drawn(self, wanted):
        """The keys that must be drawn; fails where slots overlap or have the wrong size."""
        slots, fresh = self.place(wanted)
        assert {key: slot.size for key, slot in slots.items()} == wanted
        covered = set()
        for slot in slots.values():
            steps = range(0, slot.size, 8)
            cells = {(slot.page, slot.x + x, slot.y + y) for x in steps for y in steps}
            assert not cells & covered
            assert slot.page < self.pages
            covered |= cells
        return fresh

    @property
    def pages(self):
        """How many there are."""
        texture = self._store.texture
        return texture.layers if texture is not None else 0

    @property
    def counts(self):
        """(drawn, kept) since the view began."""
        return self._store.drawn, self._store.kept

    @property
    def bytes(self):
        """Bytes of video memory."""
        return self._store.bytes()

    def __getattr__(self, name):
        """Anything else, on the thread."""
        return lambda *arguments: self.on_thread(lambda _: getattr(self._store, name)(*arguments))


@pytest.fixture
def store():
    """A store of its own."""
    store = Store()
    yield store
    store.release()


def maps(names, size=32):
    """Wanted maps of one size, one per letter."""
    return dict.fromkeys(names, size)


def test_nothing_costs_nothing(store):
    store.begin(4)
    assert store.place({}) == ({}, set())
    assert (store.pages, store.bytes, store.counts) == (0, 0, (0, 0))


def test_what_was_drawn_is_kept_from_sample_to_sample_and_view_to_view(store):
    store.begin(4)
    assert store.drawn(maps("abc")) == {"a", "b", "c"}
    assert store.drawn(maps("abd")) == {"d"}
    assert store.counts == (4, 2)
    store.begin(4)
    assert store.counts == (0, 0)
    assert store.drawn(maps("abcd")) == set()
    assert store.counts == (0, 4)


def test_pages_are_made_as_needed_and_never_more_than_memory_has(store):
    store.begin(3, spare=PAGE_BYTES // 2)
    store.drawn(maps("a"))
    assert 1 <= store.pages <= 2
    for sample in range(6):
        store.drawn({f"{sample} {index}": PAGE for index in range(3)})
        assert store.pages <= 3
    assert store.pages == 3
    assert store.bytes <= 3 * PAGE_BYTES + PAGE_BYTES // 2  # with hardware depth of one page


@pytest.mark.parametrize("comes_round", [True, False])
def test_what_does_not_fit_at_all_is_refused_with_advice(store, comes_round):
    store.begin(1, comes_round=comes_round)
    store.drawn(maps("abcdefghijklmnop"))
    with pytest.raises(RenderError, match="Shadow Memory"):
        store.place(maps("abcdefghijklmnopq"))
    assert store.drawn(maps("xy", 64)) == {"x", "y"}, "it is of use as before"


def test_a_little_memory_is_one_page(store):
    store.begin(0)
    assert store.drawn({"a": PAGE}) == {"a"}
    assert store.pages == 1


def test_maps_of_lost_views_make_room_before_those_of_the_last(store):
    store.begin(1)
    store.drawn(maps("abcdefgh"))
    store.begin(1)
    store.drawn(maps("ijklmnop"))
    store.begin(1)
    store.drawn(maps("qr"))
    assert store.drawn(maps("ijklmnopqr")) == set(), "those that went were of the first view"
    assert len(store.drawn(maps("abcdefghqr"))) == 2


def test_a_view_whose_samples_come_round_keeps_its_first_ones(store):
    """Of samples that do not all fit, the same come again in every view: as many as fit stay."""
    samples = [maps([f"{sample} {index}" for index in range(4)]) for sample in range(6)]
    totals = []
    for _ in range(4):
        store.begin(1)
        totals.append(sum(len(store.drawn(sample)) for sample in samples))
    assert totals[0] == 24
    assert max(totals[1:]) < 24
    assert totals[1] == totals[2] == totals[3]


def test_a_final_picture_begins_without_maps(store):
    store.begin(4)
    store.drawn(maps("abc"))
    store.begin(4, comes_round=False)
    assert store.pages == 0
    assert store.drawn(maps("abc")) == {"a", "b", "c"}
    assert store.drawn(maps("abc")) == set()


def test_a_final_picture_reuses_room_instead_of_growing(store):
    store.begin(8, comes_round=False)
    for sample in range(20):
        store.drawn({f"{sample} {index}": 64 for index in range(4)})
    assert store.pages <= 2


def test_another_page_size_or_less_memory_frees_what_there_is(store):
    store.begin(4)
    store.drawn({str(index): PAGE for index in range(4)})
    assert store.pages == 4
    store.begin(2)
    assert (store.pages, store.bytes) == (0, 0)
    assert store.drawn({"0": PAGE}) == {"0"}
    store.begin(2, page=64)
    assert (store.pages, store.bytes) == (0, 0)
    assert store.drawn({"0": 64}) == {"0"}


def test_more_memory_keeps_what_there_is(store):
    store.begin(2)
    store.drawn(maps("ab", PAGE))
    store.begin(4)
    assert store.drawn(maps("ab", PAGE)) == set()


def test_small_maps_that_stay_do_not_keep_large_ones_out(store):
    """Their area suffices, but those that are kept lie on every page: then all are drawn anew."""
    store.begin(2)
    while store.pages < 2:
        store.drawn(maps("abcdefgh", 64))
    slots, _ = store.place(maps("abcdefgh", 64))
    first, second = (next(key for key, slot in slots.items() if slot.page == page) for page in range(2))
    wanted = {**maps([first, second], 64), "large": PAGE}
    assert store.drawn(wanted) == set(wanted)


def test_what_was_not_drawn_after_all_is_not_there(store):
    store.begin(2)
    store.drawn(maps("a"))
    store.drawn(maps("abc"))
    store.forget({"b", "c"})
    assert store.drawn(maps("abc")) == {"b", "c"}


@pytest.mark.parametrize("comes_round", [True, False])
def test_release_frees_everything_and_can_begin_again(store, comes_round):
    store.begin(4, comes_round=comes_round)
    store.drawn(maps("abc"))
    store.release()
    assert (store.pages, store.bytes) == (0, 0)
    store.begin(4)
    assert store.drawn(maps("abc")) == {"a", "b", "c"}


SAMPLE = st.dictionaries(st.integers(0, 20), st.sampled_from([32, 64, 128]), max_size=8)


@given(
    st.integers(1, 3), st.lists(st.tuples(st.booleans(), st.booleans(), st.sets(st.integers(0, 7)), SAMPLE), max_size=8)
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
def test_whatever_fits_by_area_is_placed(store, pages, steps):
    """Some of the sample before and some other maps, whatever came before; keys have the size, as real keys do."""
    store.release()
    store.begin(pages)
    previous = []
    for new_view, comes_round, kept, sample in steps:
        if new_view:
            store.begin(pages, comes_round=comes_round)
        wanted = {(key, size): size for key, size in sample.items()}
        wanted |= {key: key[1] for at, key in enumerate(previous) if at in kept}
        if sum(size * size for size in wanted.values()) <= pages * PAGE**2:
            store.drawn(wanted)
            assert store.drawn(wanted) == set()
            previous = list(wanted)
        assert store.pages <= pages
