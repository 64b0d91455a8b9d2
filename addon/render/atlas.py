# SPDX-License-Identifier: GPL-3.0-or-later
"""Square places of power-of-two size on square pages: where shadow maps lie."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Slot:
    """A square of `size` texels a side whose lower left texel is (x, y) of a page."""

    page: int
    x: int
    y: int
    size: int

    @property
    def quarters(self) -> "tuple[Slot, Slot, Slot, Slot]":
        """The four squares that it is made of."""
        half = self.size // 2
        return (
            Slot(self.page, self.x, self.y, half),
            Slot(self.page, self.x + half, self.y, half),
            Slot(self.page, self.x, self.y + half, half),
            Slot(self.page, self.x + half, self.y + half, half),
        )


@dataclass
class AtlasLayout:
    """Which squares of `pages` pages, `page_size` texels a side, are free: a buddy system in two dimensions."""

    page_size: int
    pages: int
    _free: dict[int, set[Slot]] = field(default_factory=dict[int, set[Slot]])
    _parents: dict[Slot, Slot] = field(default_factory=dict[Slot, Slot])

    def __post_init__(self) -> None:
        self._free[self.page_size] = {Slot(page, 0, 0, self.page_size) for page in range(self.pages)}

    def allocate(self, size: int) -> Slot | None:
        """A free square of a power-of-two size, or None where there is none."""
        free = self._free.setdefault(size, set())
        if free:
            slot = min(free, key=lambda slot: (slot.page, slot.y, slot.x))
            free.remove(slot)
            return slot
        if size >= self.page_size:
            return None
        larger = self.allocate(2 * size)
        if larger is None:
            return None
        first, *others = larger.quarters
        self._parents |= dict.fromkeys(larger.quarters, larger)
        free.update(others)
        return first

    def release(self, slot: Slot) -> None:
        """Give a square back; four free quarters become one again."""
        free = self._free[slot.size]
        free.add(slot)
        parent = self._parents.get(slot)
        if parent is not None and all(quarter in free for quarter in parent.quarters):
            for quarter in parent.quarters:
                free.remove(quarter)
                del self._parents[quarter]
            self.release(parent)
