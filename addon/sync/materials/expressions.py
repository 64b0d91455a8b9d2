# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours and values of a node graph as a constant factor times at most one texture or colour attribute."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from ...scene.arrays import Color
from .graph import Groups, Node, Socket, Source, find_source
from .images import ImageTable
from .operations import as_value, limited, luminance, multiply, per_channel, uniform, unit

_GREY = 0.5
_DEEPEST = 80
"""Nodes on one path, well within Python's own limit of nested calls."""
_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Expression:
    """`factor` (linear RGB; equal components for a plain value), multiplied by what is read, if anything.

    `texture`: an image texture node, of which `component` is read: RGB, LUMINANCE, RED, GREEN, BLUE, ALPHA or
    INVERTED_ALPHA. `attribute`: name of a colour attribute, empty for the mesh's own choice.
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
        return self.times(uniform(value))


Reader = Callable[[Source, "Evaluator"], Expression]


def grey(value: float) -> Expression:
    """A constant value."""
    return Expression(uniform(value))


class Evaluator:
    """Evaluates the sockets of one node graph; `owner` (“Material “X””) begins each text it adds to `warnings`.

    `readers` are what each type of node (`bl_idname`) computes. Every output is read once, however many inputs
    share it. No Blender object is kept longer than the evaluator.
    """

    def __init__(self, owner: str, images: ImageTable, readers: Mapping[str, Reader]) -> None:
        self.owner = owner
        self.images = images
        self.warnings: dict[str, None] = {}
        self._readers = readers
        self._results: dict[object, Any] = {}
        self._depth = 0

    def warn(self, node: Node, text: str) -> None:
        """Report once what `node` asks for and what is shown instead; `text` is a clause."""
        self.warnings.setdefault(f"{self.owner}, node “{node.name}”: {text}.", None)

    def once(self, source: Source, read: Callable[[Source, Evaluator], _Result], too_deep: _Result) -> _Result:
        """What `read` makes of a node's output, remembered; `too_deep`, told, at the end of a very long path."""
        if source.key in self._results:
            return self._results[source.key]
        if self._depth == _DEEPEST:
            self.warn(source.node, f"more than {_DEEPEST} nodes follow one another; what comes before is left out")
            return too_deep
        self._depth += 1
        try:
            result = read(source, self)
        finally:
            self._depth -= 1
        self._results[source.key] = result
        return result

    def expression(self, socket: Socket, groups: Groups) -> Expression:
        """What an input receives, converted to a value (see `to_value`) where the input is one."""
        source = find_source(socket, groups)
        if source.node is None:
            value = _socket_value(source.socket)
            expression = replace(value, factor=self.limited(value.factor, source.socket.node))
        elif source.node.mute:
            return grey(0.0)
        else:
            expression = self.once(source, Evaluator._read, grey(_GREY))
        return self.to_value(expression, socket.node, socket.name) if socket.type == "VALUE" else expression

    def color(self, socket: Socket, groups: Groups) -> Color:
        """What an input receives as one colour; a texture is replaced by its mean, and the user is told."""
        return self.reduce(self.expression(socket, groups), socket.node, socket.name)

    def value(self, socket: Socket, groups: Groups) -> float:
        """What an input receives as one number; a texture is replaced by its mean, and the user is told."""
        return as_value(self.color(socket, groups))

    def reduce(self, expression: Expression, node: Node, what: str) -> Color:
        """`expression` without its texture or attribute, which the user is told `node` cannot have for `what`."""
        if expression.is_constant:
            return expression.factor
        if expression.texture is None:
            self.warn(node, f"a colour attribute for {what} is not rendered yet; white is used instead")
            return expression.factor
        self.warn(node, f"a texture for {what} is not rendered yet; the image's mean is used instead")
        return multiply(expression.factor, self._mean(expression))

    def to_value(self, expression: Expression, node: Node, what: str) -> Expression:
        """`expression` as grey: the luminance of a colour, a texture's too where its factor has no hue.

        Otherwise it is reduced to a constant for `what`, which the user is told.
        """
        value = as_value(expression.factor)
        has_hue = expression.factor != uniform(value)
        if expression.attribute is not None or (expression.texture is not None and expression.component == "RGB"):
            if expression.attribute is not None or has_hue:
                return grey(as_value(self.reduce(expression, node, what)))
            return replace(expression, component="LUMINANCE")
        return replace(expression, factor=uniform(value)) if has_hue else expression

    def clamped(self, expression: Expression, node: Node) -> Expression:
        """`expression` within 0…1; a texture that may leave it is reduced to a constant, which the user is told."""
        if expression.attribute is not None:
            self.warn(node, "clamping a colour attribute is not rendered yet; the attribute is used as it is")
            return expression
        if expression.texture is not None:
            pixels = self.images.mirror(expression.texture, self.owner).image.pixels
            if pixels.dtype == np.uint8 and all(0.0 <= factor <= 1.0 for factor in expression.factor):
                return expression
        return Expression(per_channel(unit, self.reduce(expression, node, "a clamped result")))

    def limited(self, color: Color, node: Node) -> Color:
        """`color` within what a picture can hold; the user is told where `node` exceeds it."""
        result = per_channel(limited, color)
        if result != color:
            shown = ", ".join(f"{channel:g}" for channel in dict.fromkeys(result))
            self.warn(node, f"its value is too large or not a number; {shown} is used instead")
        return result

    def unknown(self, source: Source) -> Expression:
        """What is shown for a node that cannot be computed: its colour input, or grey; the user is told."""
        colors = [entry for entry in source.node.inputs if entry.type == "RGBA" and entry.enabled]
        if colors:
            self.warn(source.node, f"{source.node.bl_label} is not rendered yet; its colour input is used as it is")
            return self.expression(colors[0], source.groups)
        self.warn(source.node, f"{source.node.bl_label} is not rendered yet; grey {_GREY} is used instead")
        return grey(_GREY)

    @staticmethod
    def _read(source: Source, evaluator: Evaluator) -> Expression:
        reader = evaluator._readers.get(source.node.bl_idname)
        expression = evaluator.unknown(source) if reader is None else reader(source, evaluator)
        return replace(expression, factor=evaluator.limited(expression.factor, source.node))

    def _mean(self, expression: Expression) -> Color:
        red, green, blue, alpha = self.images.mirror(expression.texture, self.owner).mean
        if expression.component == "RGB":
            return red, green, blue
        by_component = {
            "LUMINANCE": luminance((red, green, blue)),
            "RED": red,
            "GREEN": green,
            "BLUE": blue,
            "ALPHA": alpha,
            "INVERTED_ALPHA": 1.0 - alpha,
        }
        return uniform(by_component[expression.component])


def _socket_value(socket: Socket) -> Expression:
    value = getattr(socket, "default_value", 0.0)
    if isinstance(value, bool | int | float):
        return grey(float(value))
    return Expression(tuple(value[:3]))
