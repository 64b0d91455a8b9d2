# SPDX-License-Identifier: GPL-3.0-or-later
"""What a render did and what it cost."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import moderngl

from .device import Device


@dataclass(frozen=True)
class RenderStatistics:
    """`upload_s` of the last `begin`; milliseconds per pass of the last sample; reasons for what was left out;
    triangles (instances counted), draws and instances of one geometry pass; bytes of video memory per target; how many
    shadow maps were drawn since `begin`, and how often one was there already.
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
    shadow_maps_drawn: int = 0
    shadow_maps_kept: int = 0


class PassTimers:
    """Milliseconds per pass: by timer queries, or by the clock where the driver draws on the CPU.

    llvmpipe answers queries with the time until its threads were done with everything, the passes before included.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        self._queries: dict[str, moderngl.Query] = {}
        self._milliseconds: dict[str, float] = {}

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Time what is drawn inside the block under a pass's name."""
        if self._device.is_software:
            start = time.perf_counter()
            yield
            self._device.context.finish()
            self._milliseconds[name] = (time.perf_counter() - start) * 1e3
            return
        if name not in self._queries:
            idle = self._device.idle_queries
            self._queries[name] = idle.pop() if idle else self._device.context.query(time=True)
        with self._queries[name]:
            yield

    def forget(self) -> None:
        """Drop the figures of passes that may no longer run. Queries are kept for others: moderngl frees none."""
        self._device.idle_queries += self._queries.values()
        self._queries.clear()
        self._milliseconds.clear()

    def milliseconds(self) -> tuple[tuple[str, float], ...]:
        """(pass, ms) of the last sample, in the order the passes ran; waits for the GPU."""
        queried = {name: query.elapsed / 1e6 for name, query in self._queries.items()}
        return tuple((self._milliseconds | queried).items())
