# SPDX-License-Identifier: GPL-3.0-or-later
"""Where passes look around a pixel: taps along a spiral in the disc that a radius covers on the screen.

A pass adds `TAP_UNIFORMS` and `GATHER_UNIFORMS` to its block and includes `common/screen_taps.glsl`.
"""

from .passes.base import Frame

TAP_UNIFORMS = (
    ("tap_count", "int"),
    ("tap_turns", "float"),  # of the spiral
    ("tap_radius", "float"),  # m
)

_TURNS = """
     1  1  1  2  3  2  5  2  3  2
     3  3  5  5  3  4  7  5  5  7
     9  8  5  5  7  7  7  8  5  8
    11 12  7 10 13  8 11  8  7 14
    11 11 13 12 13 19 17 13 11 18
    19 11 11 14 17 21 15 16 17 18
    13 17 11 17 19 18 25 18 19 19
    29 21 19 27 31 29 21 18 17 29
    31 31 23 18 25 26 25 23 19 34
    19 27 21 25 39 29 17 21 27 29
"""
_TURNS_OF_COUNT = tuple(int(turns) for turns in _TURNS.split())
_GOLDEN_TURNS_PER_TAP = 0.3819660112501051


def tap_uniforms(frame: Frame) -> dict[str, object]:
    """Values of `TAP_UNIFORMS`."""
    indirect = frame.settings.indirect
    return {"tap_count": indirect.taps, "tap_turns": spiral_turns(indirect.taps), "tap_radius": indirect.radius}


def spiral_turns(taps: int) -> float:
    """By how many turns the spiral of so many taps has the lowest discrepancy (McGuire et al. 2012, "Scalable Ambient
    Obscurance"); beyond the table, each tap is turned by the golden angle."""
    return float(_TURNS_OF_COUNT[taps]) if taps < len(_TURNS_OF_COUNT) else taps * _GOLDEN_TURNS_PER_TAP
