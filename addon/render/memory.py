# SPDX-License-Identifier: GPL-3.0-or-later
"""What was worked out before. Pure: no OpenGL, no Blender."""

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

T = TypeVar("T")


class Memory:
    """Results that depend on immutable objects alone, for as long as they are asked for. Only speed depends on it."""

    def __init__(self) -> None:
        self._held: dict[tuple[Hashable, ...], tuple[tuple[object, ...], Any]] = {}
        self._used: set[tuple[Hashable, ...]] = set()
        self._is_new = False

    @property
    def count(self) -> int:
        """How many results are held."""
        return len(self._held)

    def recall(self, what: Hashable, of: tuple[object, ...], make: Callable[[], T]) -> T:
        """What `make` returns, from before where that was asked `of` the very same objects, which are held as long."""
        key = (what, *map(id, of))
        self._used.add(key)
        if key not in self._held:
            self._held[key] = of, make()
            self._is_new = True
        return self._held[key][1]

    def forget_unused(self) -> None:
        """Let go of what was not asked for since the last call, if anything new was."""
        if self._is_new:
            self._held = {key: held for key, held in self._held.items() if key in self._used}
        self._used, self._is_new = set(), False
