# SPDX-License-Identifier: GPL-3.0-or-later
"""What the passes that gather irradiance have in common: which pixels they look from, and their random numbers.

A pass adds `GATHER_UNIFORMS` to its block and includes `common/gather.glsl`.
"""

import numpy as np

from .passes.base import Frame
from .sampling import pixel_shift

GATHER_UNIFORMS = (
    ("gather_offset", "vec2"),  # pixels from the lower left of those that share a texel to the one that it is found for
    ("gather_shift", "vec2"),  # of all pixels' random numbers in this sample
    ("gather_divisor", "int"),  # pixels along each side of those that share a texel
    ("gather_rays", "int"),  # per texel
)


def gather_uniforms(frame: Frame) -> dict[str, object]:
    """Values of `GATHER_UNIFORMS` for the current sample."""
    indirect, index = frame.settings.indirect, frame.sample.index
    return {
        "gather_offset": gather_offset(indirect.divisor, index),
        "gather_shift": pixel_shift(index + frame.picture, frame.settings.seed),
        "gather_divisor": indirect.divisor,
        "gather_rays": indirect.rays,
    }


def gather_offset(divisor: int, index: int) -> tuple[float, float]:
    """Which of `divisor`² pixels sample `index` looks from: all of them in turn, the middle first, each time half of
    what is left between those before (a bit-reversed Morton order)."""
    bits = max(divisor.bit_length() - 1, 0)
    place = np.array([divisor // 2, divisor // 2])
    turn = index % divisor**2
    for level in range(bits):
        quarter = turn >> 2 * level & 3
        place += np.array([quarter & 1 ^ quarter >> 1, quarter >> 1]) * (divisor >> level + 1)
    x, y = place % divisor
    return float(x), float(y)
