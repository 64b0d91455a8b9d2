# SPDX-License-Identifier: GPL-3.0-or-later
"""What each type of shader node that gives a colour or value computes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ...scene.arrays import Color
from .expressions import Evaluator, Expression, Reader, grey
from .graph import Socket, Source, find_source
from .operations import (
    BLENDS,
    MATH,
    WHITE,
    compute,
    gamma,
    hue_saturation,
    lerp,
    per_channel,
    reflectance,
    uniform,
    unit,
)


def _color_output(source: Source, evaluator: Evaluator) -> Expression:
    return Expression(tuple(source.socket.default_value[:3]))


def _value_output(source: Source, evaluator: Evaluator) -> Expression:
    return grey(source.socket.default_value)


def _image_texture(source: Source, evaluator: Evaluator) -> Expression:
    node = source.node
    vector = find_source(node.inputs["Vector"], source.groups)
    kind = "" if vector.node is None else vector.node.bl_idname
    by_uv = kind in {"", "ShaderNodeUVMap"} or (kind == "ShaderNodeTexCoord" and vector.socket.identifier == "UV")
    if not by_uv or node.projection != "FLAT":
        evaluator.warn(node, "only the plain UV map is rendered yet; other coordinates and projections are ignored")
    return Expression(WHITE, node, "ALPHA" if source.socket.identifier == "Alpha" else "RGB")


def _environment(source: Source, evaluator: Evaluator) -> Expression:
    evaluator.warn(source.node, "environment images are not rendered yet; the image's mean is used instead")
    return Expression(evaluator.images.mirror(source.node, evaluator.owner).mean[:3])


def _vertex_color(source: Source, evaluator: Evaluator) -> Expression:
    return _attribute(source, evaluator, source.node.layer_name)


def _geometry_attribute(source: Source, evaluator: Evaluator) -> Expression:
    if source.node.attribute_type != "GEOMETRY":
        return evaluator.unknown(source)
    return _attribute(source, evaluator, source.node.attribute_name)


def _attribute(source: Source, evaluator: Evaluator, name: str) -> Expression:
    if source.socket.identifier == "Alpha":
        evaluator.warn(source.node, "an attribute's alpha is not rendered yet; 1 is used instead")
        return grey(1.0)
    attribute = Expression(WHITE, attribute=name)
    if source.socket.type == "VALUE":
        return evaluator.to_value(attribute, source.node, source.socket.name)
    return attribute


def _mix(source: Source, evaluator: Evaluator) -> Expression:
    node = source.node
    suffix = {"RGBA": "Color", "FLOAT": "Float", "VECTOR": "Vector"}.get(node.data_type)
    if suffix is None:
        return evaluator.unknown(source)
    by_identifier = {entry.identifier: entry for entry in node.inputs}
    inputs = (by_identifier["Factor_Float"], by_identifier[f"A_{suffix}"], by_identifier[f"B_{suffix}"])
    blend = node.blend_type if node.data_type == "RGBA" else "MIX"
    mixed = _blend(source, evaluator, blend, inputs, node.clamp_factor)
    return evaluator.clamped(mixed, node) if node.data_type == "RGBA" and node.clamp_result else mixed


def _mix_legacy(source: Source, evaluator: Evaluator) -> Expression:
    node = source.node
    mixed = _blend(source, evaluator, node.blend_type, tuple(node.inputs[:3]), True)
    return evaluator.clamped(mixed, node) if node.use_clamp else mixed


def _blend(
    source: Source, evaluator: Evaluator, blend: str, inputs: tuple[Socket, ...], clamp_factor: bool
) -> Expression:
    fraction = evaluator.value(inputs[0], source.groups)
    if clamp_factor:
        fraction = unit(fraction)
    if fraction == 0.0:
        return evaluator.expression(inputs[1], source.groups)
    if fraction == 1.0 and blend == "MIX":
        return evaluator.expression(inputs[2], source.groups)
    first, second = (evaluator.expression(entry, source.groups) for entry in inputs[1:])
    if first.is_constant and second.is_constant:
        operation = BLENDS.get(blend)
        if operation is None:
            evaluator.warn(source.node, f"blend mode {blend.title()} is not rendered yet; plain mixing is used instead")
            operation = BLENDS["MIX"]
        return Expression(lerp(first.factor, per_channel(operation, first.factor, second.factor), fraction))
    if blend == "MULTIPLY" and second.is_constant:
        return first.times(lerp(WHITE, second.factor, fraction))
    if blend == "MULTIPLY" and first.is_constant and fraction == 1.0:
        return second.times(first.factor)
    kept = first if not first.is_constant and (blend != "MIX" or fraction < 0.5 or second.is_constant) else second
    if blend == "MULTIPLY" and second.texture is not None and first.attribute is not None:
        kept = second
    evaluator.warn(source.node, "this combination of colours is not rendered yet; only one of them is used")
    return kept


def _math(source: Source, evaluator: Evaluator) -> Expression:
    node = source.node
    operation = MATH.get(node.operation)
    if operation is None:
        name = node.operation.title()
        evaluator.warn(node, f"operation {name} is not rendered yet; its first input is used as it is")
        return evaluator.expression(node.inputs[0], source.groups)
    sockets = [entry for entry in node.inputs if entry.enabled]
    arguments = [evaluator.expression(entry, source.groups) for entry in sockets]
    exact = _product(node.operation, arguments) or _inverted_alpha(node.operation, arguments)
    if exact is None:
        values = [
            evaluator.reduce(argument, node, socket.name)[0]
            for argument, socket in zip(arguments, sockets, strict=True)
        ]
        exact = grey(compute(operation, *values))
    return evaluator.clamped(exact, node) if node.use_clamp else exact


def _product(operation: str, arguments: list[Expression]) -> Expression | None:
    """A number times a texture."""
    if operation != "MULTIPLY" or all(argument.is_constant for argument in arguments):
        return None
    first, second = arguments
    if second.is_constant:
        return first.times(second.factor)
    return second.times(first.factor) if first.is_constant else None


def _inverted_alpha(operation: str, arguments: list[Expression]) -> Expression | None:
    """1 − the alpha of a texture."""
    if operation != "SUBTRACT" or arguments[0] != grey(1.0):
        return None
    texture = arguments[1].texture
    if texture is None or arguments[1] != Expression(WHITE, texture, "ALPHA"):
        return None
    return Expression(WHITE, texture, "INVERTED_ALPHA")


def _adjust(source: Source, evaluator: Evaluator, adjust: Callable[[Color], Color], *, neutral: bool) -> Expression:
    """The node's colour input after `adjust`; a texture is kept as it is, with a warning unless `neutral`."""
    expression = evaluator.expression(source.node.inputs["Color"], source.groups)
    if neutral:
        return expression
    if expression.is_constant:
        return Expression(adjust(expression.factor))
    text = f"{source.node.bl_label} of a texture is not rendered yet; the texture is used as it is"
    evaluator.warn(source.node, text)
    return expression


def _gamma(source: Source, evaluator: Evaluator) -> Expression:
    exponent = evaluator.value(source.node.inputs["Gamma"], source.groups)
    return _adjust(source, evaluator, lambda color: gamma(color, exponent), neutral=exponent == 1.0)


def _invert(source: Source, evaluator: Evaluator) -> Expression:
    fraction = evaluator.value(source.node.inputs[0], source.groups)

    def adjust(color: Color) -> Color:
        return lerp(color, per_channel(lambda c: 1.0 - c, color), fraction)

    return _adjust(source, evaluator, adjust, neutral=fraction == 0.0)


def _hue_saturation(source: Source, evaluator: Evaluator) -> Expression:
    hue, saturation, value, fraction = (
        evaluator.value(source.node.inputs[name], source.groups) for name in ("Hue", "Saturation", "Value", "Fac")
    )
    return _adjust(
        source,
        evaluator,
        lambda color: hue_saturation(color, hue, saturation, value, fraction),
        neutral=fraction == 0.0 or (hue, saturation, value) == (0.5, 1.0, 1.0),
    )


def _bright_contrast(source: Source, evaluator: Evaluator) -> Expression:
    bright, contrast = (evaluator.value(source.node.inputs[name], source.groups) for name in ("Bright", "Contrast"))
    scale, offset = 1.0 + contrast, bright - contrast * 0.5
    return _adjust(
        source,
        evaluator,
        lambda color: per_channel(lambda c: max(c * scale + offset, 0.0), color),
        neutral=bright == contrast == 0.0,
    )


def _color_ramp(source: Source, evaluator: Evaluator) -> Expression:
    result = source.node.color_ramp.evaluate(evaluator.value(source.node.inputs[0], source.groups))
    return grey(result[3]) if source.socket.identifier == "Alpha" else Expression(tuple(result[:3]))


def _to_value(source: Source, evaluator: Evaluator) -> Expression:
    expression = evaluator.expression(source.node.inputs[0], source.groups)
    return evaluator.to_value(expression, source.node, source.socket.name)


def _separate(source: Source, evaluator: Evaluator) -> Expression:
    if source.node.mode != "RGB":
        return evaluator.unknown(source)
    color = evaluator.expression(source.node.inputs[0], source.groups)
    channel = source.socket.identifier
    if color.attribute is not None:
        color = Expression(evaluator.reduce(color, source.node, channel))
    factor = uniform(color.factor[("Red", "Green", "Blue").index(channel)])
    reads_color = color.texture is not None and color.component == "RGB"
    return replace(color, factor=factor, component=channel.upper() if reads_color else color.component)


def _combine(source: Source, evaluator: Evaluator) -> Expression:
    if source.node.mode != "RGB":
        return evaluator.unknown(source)
    red, green, blue = (evaluator.value(entry, source.groups) for entry in source.node.inputs[:3])
    return Expression((red, green, blue))


def _light_path(source: Source, evaluator: Evaluator) -> Expression:
    evaluator.warn(source.node, "rays of different kinds are not told apart yet; all are treated as camera rays")
    return grey(1.0 if source.socket.name == "Is Camera Ray" else 0.0)


def _fresnel(source: Source, evaluator: Evaluator) -> Expression:
    node = source.node
    evaluator.warn(node, f"{node.bl_label} is not rendered yet; its value for facing surfaces is used")
    if source.socket.identifier == "Facing":
        return grey(0.0)
    if node.bl_idname == "ShaderNodeFresnel":
        return grey(reflectance(evaluator.value(node.inputs["IOR"], source.groups)))
    blend = evaluator.value(node.inputs["Blend"], source.groups)
    return grey(reflectance(1.0 / max(1.0 - blend, 1e-5)))


NODE_READERS: dict[str, Reader] = {
    "ShaderNodeRGB": _color_output,
    "ShaderNodeValue": _value_output,
    "ShaderNodeTexImage": _image_texture,
    "ShaderNodeTexEnvironment": _environment,
    "ShaderNodeVertexColor": _vertex_color,
    "ShaderNodeAttribute": _geometry_attribute,
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
    "ShaderNodeCombineColor": _combine,
    "ShaderNodeLightPath": _light_path,
    "ShaderNodeFresnel": _fresnel,
    "ShaderNodeLayerWeight": _fresnel,
}
