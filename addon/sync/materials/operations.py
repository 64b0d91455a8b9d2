# SPDX-License-Identifier: GPL-3.0-or-later
"""Arithmetic of shader nodes on numbers and colours, as Cycles computes it."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Callable
from typing import Any

from ...scene.arrays import Color

WHITE: Color = (1.0, 1.0, 1.0)
LARGEST = 1e18
"""What node values are limited to: products of two still fit in 32 bits, so a picture never turns infinite."""
_LUMINANCE = (0.2126, 0.7152, 0.0722)
_SMALLEST_IOR = 1e-5


def luminance(color: Color) -> float:
    """What Blender makes of a colour that is plugged into a value."""
    return sum(weight * channel for weight, channel in zip(_LUMINANCE, color, strict=True))


def as_value(color: Color) -> float:
    """`luminance`, without rounding where all channels are equal."""
    return color[0] if color[0] == color[1] == color[2] else luminance(color)


def uniform(value: float) -> Color:
    """A colour whose channels all have one value."""
    return value, value, value


def multiply(first: Color, second: Color) -> Color:
    """Product of two colours, channel by channel."""
    return first[0] * second[0], first[1] * second[1], first[2] * second[2]


def lerp(first: Color, second: Color, fraction: float) -> Color:
    """`first` where `fraction` is 0, `second` where it is 1."""
    return per_channel(lambda a, b: a + (b - a) * fraction, first, second)


def per_channel(operation: Callable[..., float], *colors: Color) -> Color:
    """`operation` on the channels of one or more colours; see `compute`."""
    red, green, blue = (compute(operation, *channels) for channels in zip(*colors, strict=True))
    return red, green, blue


def compute(operation: Callable[..., float], *values: float) -> float:
    """The result of an operation; infinity where it is too large for a float, NaN where there is none.

    Both are for the evaluator to replace and to report.
    """
    try:
        return operation(*values)
    except OverflowError:
        return math.inf
    except ArithmeticError:
        return math.nan


def limited(value: float) -> float:
    """`value` within ±`LARGEST`; 0 for NaN."""
    return 0.0 if math.isnan(value) else min(max(value, -LARGEST), LARGEST)


def unit(value: float) -> float:
    """`value` within 0…1."""
    return min(max(value, 0.0), 1.0)


def reflectance(index_of_refraction: float) -> float:
    """Reflectance of a dielectric at normal incidence (F0); an index of 0 or less is almost 0, as in Cycles."""
    index = max(index_of_refraction, _SMALLEST_IOR)
    return ((index - 1.0) / (index + 1.0)) ** 2


def gamma(color: Color, exponent: float) -> Color:
    """The Gamma node: white for an exponent of 0; channels that are not positive stay as they are."""
    if exponent == 0.0:
        return WHITE
    return per_channel(lambda c: c**exponent if c > 0.0 else c, color)


def hue_saturation(color: Color, hue: float, saturation: float, value: float, fraction: float) -> Color:
    """The Hue/Saturation/Value node; `hue` 0.5 and the others 1 change nothing. No channel is negative afterwards."""
    old_hue, old_saturation, old_value = colorsys.rgb_to_hsv(*color) if max(color) != 0.0 else (0.0, 0.0, 0.0)
    shifted = colorsys.hsv_to_rgb((old_hue + hue + 0.5) % 1.0, unit(old_saturation * saturation), old_value * value)
    return per_channel(lambda c: max(c, 0.0), lerp(color, shifted, fraction))


def _power(base: float, exponent: float) -> float:
    if exponent == 0.0:
        return 1.0
    return base**exponent if base > 0.0 or (base < 0.0 and exponent == int(exponent)) else 0.0


BLENDS: dict[str, Callable[[float, float], float]] = {
    "MIX": lambda a, b: b,
    "MULTIPLY": lambda a, b: a * b,
    "ADD": lambda a, b: a + b,
    "SUBTRACT": lambda a, b: a - b,
    "SCREEN": lambda a, b: 1.0 - (1.0 - a) * (1.0 - b),
    "DIVIDE": lambda a, b: a / b if b else a,
    "DIFFERENCE": lambda a, b: abs(a - b),
    "DARKEN": min,
    "LIGHTEN": max,
    "OVERLAY": lambda a, b: 2.0 * a * b if a < 0.5 else 1.0 - 2.0 * (1.0 - a) * (1.0 - b),
}

MATH: dict[str, Callable[..., Any]] = {
    "ADD": lambda a, b: a + b,
    "SUBTRACT": lambda a, b: a - b,
    "MULTIPLY": lambda a, b: a * b,
    "DIVIDE": lambda a, b: a / b if b else 0.0,
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": _power,
    "SQRT": lambda a: math.sqrt(max(a, 0.0)),
    "ABSOLUTE": abs,
    "MINIMUM": min,
    "MAXIMUM": max,
    "GREATER_THAN": lambda a, b: float(a > b),
    "LESS_THAN": lambda a, b: float(a < b),
}
