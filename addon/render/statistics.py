# SPDX-License-Identifier: GPL-3.0-or-later
"""What a render did and what it cost."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import moderngl


@dataclass(frozen=True)
class RenderStatistics:
    """`upload_s` of the last `begin`; GPU milliseconds per pass of the last sample; reasons for what was left out;
    triangles (instances counted), draws and instances of one geometry pass; bytes of video memory per target.
    """

    upload_s: float
    passes: tuple[tuple[str, float], ...]
    left_out: tuple[tuple[str, str], ...]
    triangles: int
    draws: int
    instances: int
    bytes: dict[str, int]
    warnings: tuple[str, ...]
    device: str


class PassTimers:
    """One GPU timer query per pass."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._queries: dict[str, moderngl.Query] = {}

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Time what is drawn inside the block under a pass's name."""
        if name not in self._queries:
            self._queries[name] = self._context.query(time=True)
        with self._queries[name]:
            yield

    def forget(self) -> None:
        """Drop the figures of passes that may no longer run."""
        self._queries.clear()

    def milliseconds(self) -> tuple[tuple[str, float], ...]:
        """(pass, ms) in the order the passes first ran; waits for the GPU."""
        return tuple((name, query.elapsed / 1e6) for name, query in self._queries.items())
