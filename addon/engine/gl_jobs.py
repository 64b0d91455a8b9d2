# SPDX-License-Identifier: GPL-3.0-or-later
"""Waiting for the GL thread while the user may cancel."""

from collections.abc import Callable
from concurrent.futures import CancelledError, wait
from typing import TypeVar

from ..render import Device, gl_thread

T = TypeVar("T")

POLL_SECONDS = 0.005


def run(job: Callable[[Device], T], cancelled: Callable[[], bool]) -> T:
    """Run `job` on the GL thread and return its result, asking `cancelled` every few milliseconds.

    When cancelled, nothing of the job is left behind: a queued job is taken back, a running one is waited for.
    Raises CancelledError then, and otherwise whatever the job or the making of its OpenGL context raised.
    """
    future = gl_thread().submit(job)
    try:
        while not future.done():
            if cancelled():
                raise CancelledError
            wait([future], timeout=POLL_SECONDS)
        return future.result()
    finally:
        if not future.cancel():
            wait([future])


def finish(job: Callable[[Device], T]) -> T:
    """Run a short `job` on the GL thread to its end, cancelled or not. Raises what the job raised."""
    return run(job, lambda: False)
