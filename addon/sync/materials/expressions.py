# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours and values of a node graph as a constant factor times at most one texture or colour attribute."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from ...scene.arrays import Color
from .graph import Groups, Node, Socket, Source, find_source
from .images import ImageTable

LUMINANCE = (0.2126, 0.7152, 0.0722)
WHITE: Color = (1.0, 1.0, 1.0)
_GREY = 0.5


@dataclass(frozen=True)
class Expression:
    """`factor` (linear RGB; equal components for a plain value), multiplied by what is read, if anything.

    `texture`: an image texture node, of which `component` is read: RGB, ALPHA, RED, GREEN, BLUE or INVERTED_ALPHA.
    `attribute`: name of a colour attribute, empty for the mesh's own choice.
    """

    factor: Color
    texture: Node | None = None
    component: str = "RGB"
    attribute: str | None = None

    @property
    def is_constant(self) -> bool:
        """Whether `factor` is all there is."""
        return self.texture is None and self.attribute is None

    def times(self, color: Color) -> Expression:
        """This expression times a constant colour."""
        return replace(self, factor=multiply(self.factor, color))

    def scaled(self, value: float) -> Expression:
        """This expression times a number."""
        return self.times(_uniform(value))


def grey(value: float) -> Expression:
    """A constant value."""
    return Expression((value, value, value))


def luminance(color: Color) -> float:
    """What Blender makes of a colour that is plugged into a value."""
    return sum(weight * channel for weight, channel in zip(LUMINANCE, color, strict=True))


class Evaluator:
    """Evaluates the sockets of one node graph; `owner` (“Material “X””) begins each text it adds to `warnings`."""

    def __init__(self, owner: str, images: ImageTable) -> None:
        self.owner = owner
        self.images = images
        self.warnings: dict[str, None] = {}
        self._handlers: dict[str, Callable[[Source], Expression]] = {
            "ShaderNodeRGB": self._color_output,
            "ShaderNodeValue": lambda source: grey(source.socket.default_value),
            "ShaderNodeTexImage": self._image_texture,
            "ShaderNodeTexEnvironment": self._environment,
            "ShaderNodeVertexColor": lambda source: self._attribute(source, source.node.layer_name),
            "ShaderNodeAttribute": self._geometry_attribute,
            "ShaderNodeMix": self._mix,
            "ShaderNodeMixRGB": self._mix_legacy,
            "ShaderNodeMath": self._math,
            "ShaderNodeGamma": self._gamma,
            "ShaderNodeInvert": self._invert,
            "ShaderNodeHueSaturation": self._hue_saturation,
            "ShaderNodeBrightContrast": self._bright_contrast,
            "ShaderNodeValToRGB": self._color_ramp,
            "ShaderNodeRGBToBW": self._to_value,
            "ShaderNodeSeparateColor": self._separate,
            "ShaderNodeCombineColor": self._combine,
            "ShaderNodeLightPath": self._light_path,
            "ShaderNodeFresnel": self._fresnel,
            "ShaderNodeLayerWeight": self._fresnel,
        }

    def warn(self, node: Node, text: str) -> None:
        """Report once what `node` asks for and what is shown instead; `text` is a clause."""
        self.warnings.setdefault(f"{self.owner}, node “{node.name}”: {text}.", None)

    def expression(self, socket: Socket, groups: Groups) -> Expression:
        """What an input receives."""
        source = find_source(socket, groups)
        if source.node is None:
            return _socket_value(source.socket)
        if source.node.mute:
            return grey(0.0)
        handler = self._handlers.get(source.node.bl_idname)
        return self._unknown(source) if handler is None else handler(source)

    def color(self, socket: Socket, groups: Groups) -> Color:
        """What an input receives as one colour; a texture is replaced by its mean, and the user is told."""
        return self.reduce(self.expression(socket, groups), socket.node, socket.name)

    def value(self, socket: Socket, groups: Groups) -> float:
        """What an input receives as one number; a texture is replaced by its mean, and the user is told."""
        color = self.color(socket, groups)
        return color[0] if color[0] == color[1] == color[2] else luminance(color)

    def reduce(self, expression: Expression, node: Node, what: str) -> Color:
        """`expression` without its texture or attribute, which the user is told `node` cannot have for `what`."""
        if expression.is_constant:
            return expression.factor
        if expression.texture is None:
            self.warn(node, f"a colour attribute for {what} is not rendered yet; white is used instead")
            return expression.factor
        self.warn(node, f"a texture for {what} is not rendered yet; the image's mean is used instead")
        return multiply(expression.factor, self._mean(expression))

    def _mean(self, expression: Expression) -> Color:
        red, green, blue, alpha = self.images.mirror(expression.texture, self.owner).mean
        by_component = {"RED": red, "GREEN": green, "BLUE": blue, "ALPHA": alpha, "INVERTED_ALPHA": 1.0 - alpha}
        if expression.component == "RGB":
            return red, green, blue
        return _uniform(by_component[expression.component])

    def _unknown(self, source: Source) -> Expression:
        colors = [entry for entry in source.node.inputs if entry.type == "RGBA" and entry.enabled]
        if colors:
            self.warn(source.node, f"{source.node.bl_label} is not rendered yet; its colour input is used as it is")
            return self.expression(colors[0], source.groups)
        self.warn(source.node, f"{source.node.bl_label} is not rendered yet; grey {_GREY} is used instead")
        return grey(_GREY)

    def _color_output(self, source: Source) -> Expression:
        return Expression(tuple(source.socket.default_value[:3]))

    def _image_texture(self, source: Source) -> Expression:
        self._check_projection(source.node, source.groups)
        return Expression(WHITE, source.node, "ALPHA" if source.socket.identifier == "Alpha" else "RGB")

    def _environment(self, source: Source) -> Expression:
        self.warn(source.node, "environment images are not rendered yet; the image's mean is used instead")
        return Expression(self.images.mirror(source.node, self.owner).mean[:3])

    def _check_projection(self, node: Node, groups: Groups) -> None:
        vector = find_source(node.inputs["Vector"], groups)
        kind = "" if vector.node is None else vector.node.bl_idname
        by_uv = kind in {"", "ShaderNodeUVMap"} or (kind == "ShaderNodeTexCoord" and vector.socket.identifier == "UV")
        if not by_uv or node.projection != "FLAT":
            self.warn(node, "only the plain UV map is rendered yet; other coordinates and projections are ignored")

    def _attribute(self, source: Source, name: str) -> Expression:
        if source.socket.identifier == "Alpha":
            self.warn(source.node, "an attribute's alpha is not rendered yet; 1 is used instead")
            return grey(1.0)
        return Expression(WHITE, attribute=name)

    def _geometry_attribute(self, source: Source) -> Expression:
        if source.node.attribute_type != "GEOMETRY":
            return self._unknown(source)
        return self._attribute(source, source.node.attribute_name)

    def _mix(self, source: Source) -> Expression:
        node = source.node
        suffix = {"RGBA": "Color", "FLOAT": "Float", "VECTOR": "Vector"}.get(node.data_type)
        if suffix is None:
            return self._unknown(source)
        by_identifier = {entry.identifier: entry for entry in node.inputs}
        blend = node.blend_type if node.data_type == "RGBA" else "MIX"
        inputs = (by_identifier["Factor_Float"], by_identifier[f"A_{suffix}"], by_identifier[f"B_{suffix}"])
        return self._blend(source, blend, inputs, node.clamp_factor)

    def _mix_legacy(self, source: Source) -> Expression:
        return self._blend(source, source.node.blend_type, tuple(source.node.inputs[:3]), True)

    def _blend(self, source: Source, blend: str, inputs: tuple[Socket, ...], clamp_factor: bool) -> Expression:
        fraction = self.value(inputs[0], source.groups)
        if clamp_factor:
            fraction = min(max(fraction, 0.0), 1.0)
        if fraction == 0.0:
            return self.expression(inputs[1], source.groups)
        if fraction == 1.0 and blend == "MIX":
            return self.expression(inputs[2], source.groups)
        first, second = (self.expression(entry, source.groups) for entry in inputs[1:])
        if first.is_constant and second.is_constant:
            operation = _BLENDS.get(blend)
            if operation is None:
                self.warn(source.node, f"blend mode {blend.title()} is not rendered yet; plain mixing is used instead")
                operation = _BLENDS["MIX"]
            blended = per_channel(operation, first.factor, second.factor)
            return Expression(_lerp(first.factor, blended, fraction))
        if blend == "MULTIPLY" and second.is_constant:
            return first.times(_lerp(WHITE, second.factor, fraction))
        if blend == "MULTIPLY" and first.is_constant and fraction == 1.0:
            return second.times(first.factor)
        kept = first if not first.is_constant and (blend != "MIX" or fraction < 0.5 or second.is_constant) else second
        if blend == "MULTIPLY" and second.texture is not None and first.attribute is not None:
            kept = second
        self.warn(source.node, "this combination of colours is not rendered yet; only one of them is used")
        return kept

    def _math(self, source: Source) -> Expression:
        node = source.node
        if node.operation == "MULTIPLY":
            first, second = (self.expression(entry, source.groups) for entry in node.inputs[:2])
            if first.is_constant or second.is_constant:
                constant, other = (first, second) if first.is_constant else (second, first)
                return other.scaled(luminance(constant.factor))
        if node.operation == "SUBTRACT":
            first, second = (self.expression(entry, source.groups) for entry in node.inputs[:2])
            if first == grey(1.0) and second == Expression(WHITE, second.texture, "ALPHA"):
                return replace(second, component="INVERTED_ALPHA")
        operation = _MATH.get(node.operation)
        if operation is None:
            self.warn(node, f"operation {node.operation.title()} is not rendered yet; its first input is used as it is")
            return self.expression(node.inputs[0], source.groups)
        arguments = [self.value(entry, source.groups) for entry in node.inputs if entry.enabled]
        result = operation(*arguments)
        return grey(min(max(result, 0.0), 1.0) if node.use_clamp else result)

    def _adjust(self, source: Source, adjust: Callable[[Color], Color], *, neutral: bool) -> Expression:
        """The node's colour input after `adjust`; a texture is kept as it is, with a warning unless `neutral`."""
        expression = self.expression(source.node.inputs["Color"], source.groups)
        if neutral:
            return expression
        if expression.is_constant:
            return Expression(adjust(expression.factor))
        self.warn(source.node, f"{source.node.bl_label} of a texture is not rendered yet; the texture is used as it is")
        return expression

    def _gamma(self, source: Source) -> Expression:
        gamma = self.value(source.node.inputs["Gamma"], source.groups)
        return self._adjust(
            source, lambda color: per_channel(lambda c: c**gamma if c > 0.0 else c, color), neutral=gamma == 1.0
        )

    def _invert(self, source: Source) -> Expression:
        fraction = self.value(source.node.inputs[0], source.groups)
        return self._adjust(
            source, lambda color: _lerp(color, per_channel(lambda c: 1.0 - c, color), fraction), neutral=fraction == 0.0
        )

    def _hue_saturation(self, source: Source) -> Expression:
        hue, saturation, value, fraction = (
            self.value(source.node.inputs[name], source.groups) for name in ("Hue", "Saturation", "Value", "Fac")
        )

        def adjust(color: Color) -> Color:
            old_hue, old_saturation, old_value = colorsys.rgb_to_hsv(*color)
            new_saturation = min(max(old_saturation * saturation, 0.0), 1.0)
            shifted = colorsys.hsv_to_rgb((old_hue + hue + 0.5) % 1.0, new_saturation, old_value * value)
            return _lerp(color, per_channel(lambda c: max(c, 0.0), shifted), fraction)

        return self._adjust(source, adjust, neutral=fraction == 0.0 or (hue, saturation, value) == (0.5, 1.0, 1.0))

    def _bright_contrast(self, source: Source) -> Expression:
        bright, contrast = (self.value(source.node.inputs[name], source.groups) for name in ("Bright", "Contrast"))
        scale, offset = 1.0 + contrast, bright - contrast * 0.5
        return self._adjust(
            source,
            lambda color: per_channel(lambda c: max(c * scale + offset, 0.0), color),
            neutral=bright == contrast == 0.0,
        )

    def _color_ramp(self, source: Source) -> Expression:
        result = source.node.color_ramp.evaluate(self.value(source.node.inputs[0], source.groups))
        return grey(result[3]) if source.socket.identifier == "Alpha" else Expression(tuple(result[:3]))

    def _to_value(self, source: Source) -> Expression:
        expression = self.expression(source.node.inputs[0], source.groups)
        return grey(luminance(expression.factor)) if expression.is_constant else expression

    def _separate(self, source: Source) -> Expression:
        if source.node.mode != "RGB":
            return self._unknown(source)
        expression = self.expression(source.node.inputs[0], source.groups)
        index = ("Red", "Green", "Blue").index(source.socket.identifier)
        component = source.socket.identifier.upper() if expression.component == "RGB" else expression.component
        return replace(expression, factor=_uniform(expression.factor[index]), component=component)

    def _combine(self, source: Source) -> Expression:
        if source.node.mode != "RGB":
            return self._unknown(source)
        red, green, blue = (self.value(entry, source.groups) for entry in source.node.inputs[:3])
        return Expression((red, green, blue))

    def _light_path(self, source: Source) -> Expression:
        self.warn(source.node, "rays of different kinds are not told apart yet; all are treated as camera rays")
        return grey(1.0 if source.socket.name == "Is Camera Ray" else 0.0)

    def _fresnel(self, source: Source) -> Expression:
        self.warn(source.node, f"{source.node.bl_label} is not rendered yet; its value for facing surfaces is used")
        if source.socket.identifier == "Facing":
            return grey(0.0)
        if source.node.bl_idname == "ShaderNodeFresnel":
            return grey(reflectance(self.value(source.node.inputs["IOR"], source.groups)))
        blend = self.value(source.node.inputs["Blend"], source.groups)
        return grey(reflectance(1.0 / max(1.0 - blend, 1e-5)))


def reflectance(index_of_refraction: float) -> float:
    """Reflectance of a dielectric at normal incidence (F0)."""
    return ((index_of_refraction - 1.0) / (index_of_refraction + 1.0)) ** 2


def _socket_value(socket: Socket) -> Expression:
    value = getattr(socket, "default_value", 0.0)
    if isinstance(value, bool | int | float):
        return grey(float(value))
    return Expression(tuple(value[:3]))


def multiply(first: Color, second: Color) -> Color:
    """Product of two colours, channel by channel."""
    return first[0] * second[0], first[1] * second[1], first[2] * second[2]


def _lerp(first: Color, second: Color, fraction: float) -> Color:
    return per_channel(lambda a, b: a + (b - a) * fraction, first, second)


def per_channel(operation: Callable[..., float], *colors: Color) -> Color:
    """`operation` on the channels of one or more colours."""
    red, green, blue = (operation(*channels) for channels in zip(*colors, strict=True))
    return red, green, blue


def _uniform(value: float) -> Color:
    return value, value, value


_BLENDS: dict[str, Callable[[float, float], float]] = {
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

_MATH: dict[str, Callable[..., Any]] = {
    "ADD": lambda a, b: a + b,
    "SUBTRACT": lambda a, b: a - b,
    "MULTIPLY": lambda a, b: a * b,
    "DIVIDE": lambda a, b: a / b if b else 0.0,
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": lambda a, b: a**b if a > 0.0 or (a != 0.0 and b == int(b)) else 0.0,
    "SQRT": lambda a: math.sqrt(max(a, 0.0)),
    "ABSOLUTE": abs,
    "MINIMUM": min,
    "MAXIMUM": max,
    "GREATER_THAN": lambda a, b: float(a > b),
    "LESS_THAN": lambda a, b: float(a < b),
}
