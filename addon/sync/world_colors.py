# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour and value nodes of a world's graph, as Cycles computes them, for many directions at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..scene.arrays import Float64Array
from .materials.graph import Socket, Source
from .materials.operations import BLENDS, MATH
from .world_fields import Constant, Field, add, computed, lerp, multiply
from .world_vectors import COMPONENTS

if TYPE_CHECKING:
    from .world_nodes import WorldEvaluator

_LUMINANCE = (0.2126, 0.7152, 0.0722)
_RAMP_SIZE = 256  # as in Cycles


@dataclass(frozen=True)
class PerNumber:
    """An operation on numbers, applied to arrays."""

    operation: Callable[..., float]

    def __call__(self, *arrays: Float64Array) -> Float64Array:
        """All at once where the operation is plain arithmetic, otherwise one by one; NaN where there is no result."""
        try:
            return np.asarray(self.operation(*arrays), np.float64)
        except (TypeError, ValueError):  # numpy refuses whatever branches
            return np.asarray(np.frompyfunc(self._one, len(arrays), 1)(*arrays), np.float64)

    def _one(self, *numbers: float) -> float:
        try:
            return self.operation(*numbers)
        except ArithmeticError:
            return np.nan


@dataclass(frozen=True)
class Ramp:
    """A colour ramp as (256, 3) entries between 0 and 1, interpolated linearly where `smooth`."""

    entries: tuple[tuple[float, ...], ...]
    smooth: bool

    def __call__(self, fraction: Float64Array) -> Float64Array:
        """(n, 3) for values (n, 3) with equal channels."""
        place = np.clip(fraction[:, 0], 0.0, 1.0) * (_RAMP_SIZE - 1)
        entries = np.array(self.entries)
        if not self.smooth:
            return entries[place.astype(np.int64)]
        positions = np.arange(_RAMP_SIZE)
        return np.stack([np.interp(place, positions, channel) for channel in entries.T], axis=-1)


def as_value(colors: Float64Array) -> Float64Array:
    """What Blender makes of colours that are plugged into values, without rounding where all channels are equal."""
    grey = np.all(colors == colors[:, :1], axis=-1, keepdims=True)
    return np.repeat(np.where(grey, colors[:, :1], (colors @ _LUMINANCE)[:, None]), 3, axis=1)


def mean_value(vectors: Float64Array) -> Float64Array:
    """What Blender makes of vectors that are plugged into values."""
    return np.repeat(np.mean(vectors, axis=-1, keepdims=True), 3, axis=1)


def unit_range(values: Float64Array) -> Float64Array:
    """Values within 0…1."""
    return np.clip(values, 0.0, 1.0)


def mixed(first: Field, second: Field, fraction: Field) -> Field:
    """`first` where `fraction` is 0, `second` where it is 1."""
    if isinstance(fraction, Constant) and fraction.value in {(0.0, 0.0, 0.0), (1.0, 1.0, 1.0)}:
        return second if fraction.value[0] else first
    return computed(lerp, first, second, fraction)


def _mix(source: Source, evaluator: WorldEvaluator) -> Field:
    node = source.node
    suffix = {"RGBA": "Color", "FLOAT": "Float", "VECTOR": "Vector"}.get(node.data_type)
    by_identifier = {socket.identifier: socket for socket in node.inputs}
    if suffix is None:
        evaluator.warn(node, f"{node.data_type.title()} is not rendered yet; its first input is used as it is")
        return evaluator.field(node.inputs[0], source.groups)
    uneven = node.data_type == "VECTOR" and node.factor_mode == "NON_UNIFORM"
    fraction = by_identifier["Factor_Vector" if uneven else "Factor_Float"]
    inputs = fraction, by_identifier[f"A_{suffix}"], by_identifier[f"B_{suffix}"]
    colors = node.data_type == "RGBA"
    result = _blended(source, evaluator, node.blend_type if colors else "MIX", inputs, node.clamp_factor)
    return computed(unit_range, result) if colors and node.clamp_result else result


def _mix_legacy(source: Source, evaluator: WorldEvaluator) -> Field:
    node = source.node
    result = _blended(source, evaluator, node.blend_type, tuple(node.inputs[:3]), True)
    return computed(unit_range, result) if node.use_clamp else result


def _blended(
    source: Source, evaluator: WorldEvaluator, blend: str, inputs: tuple[Socket, ...], clamp_factor: bool
) -> Field:
    fraction, first, second = (evaluator.field(socket, source.groups) for socket in inputs)
    if clamp_factor:
        fraction = computed(unit_range, fraction)
    if blend not in BLENDS:
        name = blend.replace("_", " ").title()
        evaluator.warn(source.node, f"blend mode {name} is not rendered yet; plain mixing is used instead")
        blend = "MIX"
    if blend != "MIX":
        operation = {"ADD": add, "MULTIPLY": multiply}.get(blend) or PerNumber(BLENDS[blend])
        second = computed(operation, first, second)
    return mixed(first, second, fraction)


def _math(source: Source, evaluator: WorldEvaluator) -> Field:
    node = source.node
    inputs = [evaluator.field(socket, source.groups) for socket in node.inputs if socket.enabled]
    operation = MATH.get(node.operation)
    if operation is None:
        name = node.operation.replace("_", " ").title()
        evaluator.warn(node, f"operation {name} is not rendered yet; its first input is used as it is")
        result = inputs[0]
    elif node.operation in {"ADD", "MULTIPLY"}:
        result = computed(add if node.operation == "ADD" else multiply, *inputs)
    else:
        result = computed(PerNumber(operation), *inputs)
    return computed(unit_range, result) if node.use_clamp else result


def _color_of(source: Source, evaluator: WorldEvaluator) -> Field:
    return evaluator.field(source.node.inputs["Color"], source.groups)


def _values(source: Source, evaluator: WorldEvaluator, *identifiers: str) -> list[Field]:
    """Value inputs by identifier: their names differ between versions of Blender."""
    by_identifier = {socket.identifier: socket for socket in source.node.inputs}
    return [evaluator.field(by_identifier[identifier], source.groups) for identifier in identifiers]


def _gamma(source: Source, evaluator: WorldEvaluator) -> Field:
    return computed(_powers, _color_of(source, evaluator), *_values(source, evaluator, "Gamma"))


def _powers(colors: Float64Array, exponent: Float64Array) -> Float64Array:
    """The Gamma node: white for an exponent of 0; channels that are not positive stay as they are."""
    raised = np.where(colors > 0.0, np.maximum(colors, 0.0) ** exponent, colors)
    return np.where(exponent == 0.0, 1.0, raised)


def _invert(source: Source, evaluator: WorldEvaluator) -> Field:
    color = _color_of(source, evaluator)
    inverted = computed(_inverted, color)
    return mixed(color, inverted, *_values(source, evaluator, "Fac"))


def _inverted(colors: Float64Array) -> Float64Array:
    return 1.0 - colors


def _hue_saturation(source: Source, evaluator: WorldEvaluator) -> Field:
    color = _color_of(source, evaluator)
    hue, saturation, value, fraction = _values(source, evaluator, "Hue", "Saturation", "Value", "Fac")
    return computed(_hue_shifted, color, hue, saturation, value, fraction)


def _hue_shifted(
    colors: Float64Array, hue: Float64Array, saturation: Float64Array, value: Float64Array, fraction: Float64Array
) -> Float64Array:
    """The Hue/Saturation/Value node; `hue` 0.5 and the others 1 change nothing. No channel is negative afterwards."""
    highest, lowest = colors.max(axis=-1), colors.min(axis=-1)
    spread = highest - lowest
    divisor = np.where(spread == 0.0, 1.0, spread)
    red, green, blue = ((highest[:, None] - colors) / divisor[:, None]).T
    sector = np.where(
        colors[:, 0] == highest,
        blue - green,
        np.where(colors[:, 1] == highest, 2.0 + red - blue, 4.0 + green - red),
    )
    old_hue = np.where(spread == 0.0, 0.0, sector / 6.0)
    old_saturation = np.where(highest == 0.0, 0.0, spread / np.where(highest == 0.0, 1.0, highest))
    new_hue = (old_hue + hue[:, 0] + 0.5) % 1.0
    new_saturation = np.clip(old_saturation * saturation[:, 0], 0.0, 1.0)
    ramps = np.abs((new_hue[:, None] * 6.0 + (0.0, 4.0, 2.0)) % 6.0 - 3.0) - 1.0
    shades = 1.0 - new_saturation[:, None] * (1.0 - np.clip(ramps, 0.0, 1.0))
    shifted = shades * highest[:, None] * value
    return np.maximum(lerp(colors, shifted, fraction), 0.0)


def _bright_contrast(source: Source, evaluator: WorldEvaluator) -> Field:
    return computed(_contrasted, _color_of(source, evaluator), *_values(source, evaluator, "Bright", "Contrast"))


def _contrasted(colors: Float64Array, bright: Float64Array, contrast: Float64Array) -> Float64Array:
    return np.maximum(colors * (1.0 + contrast) + bright - 0.5 * contrast, 0.0)


def _color_ramp(source: Source, evaluator: WorldEvaluator) -> Field:
    ramp = source.node.color_ramp
    colors = (ramp.evaluate(index / (_RAMP_SIZE - 1)) for index in range(_RAMP_SIZE))
    if source.socket.identifier == "Alpha":
        entries = tuple((color[3],) * 3 for color in colors)
    else:
        entries = tuple(tuple(color[:3]) for color in colors)
    fraction = evaluator.field(source.node.inputs[0], source.groups)
    return computed(Ramp(entries, ramp.interpolation != "CONSTANT"), fraction)


def _to_value(source: Source, evaluator: WorldEvaluator) -> Field:
    return computed(as_value, evaluator.field(source.node.inputs[0], source.groups))


def _separate(source: Source, evaluator: WorldEvaluator) -> Field:
    color = evaluator.field(source.node.inputs[0], source.groups)
    if source.node.mode != "RGB":
        evaluator.warn(source.node, f"mode {source.node.mode} is not rendered yet; RGB is used instead")
    return computed(COMPONENTS[("Red", "Green", "Blue").index(source.socket.identifier)], color)


def _clamp(source: Source, evaluator: WorldEvaluator) -> Field:
    value, low, high = _values(source, evaluator, "Value", "Min", "Max")
    if source.node.clamp_type == "RANGE":
        return computed(_clamped_to_range, value, low, high)
    return computed(np.clip, value, low, high)


def _clamped_to_range(values: Float64Array, first: Float64Array, second: Float64Array) -> Float64Array:
    return np.clip(values, np.minimum(first, second), np.maximum(first, second))


def _map_range(source: Source, evaluator: WorldEvaluator) -> Field:
    node = source.node
    if node.data_type != "FLOAT" or node.interpolation_type != "LINEAR":
        evaluator.warn(node, "only linear mapping of values is rendered yet; the values are mapped so")
    value, *ends = _values(source, evaluator, "Value", "From Min", "From Max", "To Min", "To Max")
    result = computed(_mapped, value, *ends)
    return computed(_clamped_to_range, result, ends[2], ends[3]) if node.clamp else result


def _mapped(
    values: Float64Array, low: Float64Array, high: Float64Array, to_low: Float64Array, to_high: Float64Array
) -> Float64Array:
    length = high - low
    share = np.where(length == 0.0, 0.0, (values - low) / np.where(length == 0.0, 1.0, length))
    return to_low + share * (to_high - to_low)


COLOR_READERS: dict[str, Callable[[Source, WorldEvaluator], Field]] = {
    "ShaderNodeMix": _mix,
    "ShaderNodeMixRGB": _mix_legacy,
    "ShaderNodeMath": _math,
    "ShaderNodeGamma": _gamma,
    "ShaderNodeInvert": _invert,
    "ShaderNodeHueSaturation": _hue_saturation,
    "ShaderNodeBrightContrast": _bright_contrast,
    "ShaderNodeValToRGB": _color_ramp,
    "ShaderNodeRGBToBW": _to_value,
    "ShaderNodeSeparateColor": _separate,
    "ShaderNodeClamp": _clamp,
    "ShaderNodeMapRange": _map_range,
}
