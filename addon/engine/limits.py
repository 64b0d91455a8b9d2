# SPDX-License-Identifier: GPL-3.0-or-later
"""What ends a final render: enough samples, enough time, or little enough noise."""

from collections.abc import Callable

from ..render.noise import noise_left
from ..scene.arrays import Float32Array
from .settings import FinalSettings

FIRST_COMPARED = 4
"""Samples of the first picture that a later one is compared with: fewer say little."""

SAMPLES = "samples"
TIME_LIMIT = "time limit"
NOISE_THRESHOLD = "noise threshold"
"""Names of the limits, for users."""


class Limits:
    """The limits of one render, asked after every sample. `noise`: what was estimated last; None before that."""

    def __init__(self, how: FinalSettings) -> None:
        self.noise: float | None = None
        self._how = how
        self._half: Float32Array | None = None

    def reached(self, done: int, elapsed: float, read: Callable[[], Float32Array]) -> str:
        """The limit that ends the render after `done` > 0 samples and `elapsed` seconds; "" where it goes on.

        `read` returns the mean of the samples, (H, W, 4) float32 scene-linear; it is called whenever their number has
        doubled, which makes half of them the ones of the time before.
        """
        how = self._how
        if done >= how.render.samples:
            return SAMPLES
        if how.time_limit and elapsed >= how.time_limit:
            return TIME_LIMIT
        if how.noise_threshold and done >= FIRST_COMPARED and done & (done - 1) == 0:
            half, self._half = self._half, read()[..., :3]
            if half is not None:
                self.noise = noise_left(half, self._half)
                if self.noise <= how.noise_threshold:
                    return NOISE_THRESHOLD
        return ""
