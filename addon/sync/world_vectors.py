# SPDX-License-Identifier: GPL-3.0-or-later
"""Vector nodes of a world's graph, and what Gradient Texture makes of a vector, as Cycles computes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mathutils
import numpy as np

from ..scene.arrays import Color, Float64Array
from .materials.graph import Source
from .world_fields import Constant, Field, Linear, Operation, add, computed, multiply, normalized

if TYPE_CHECKING:
    from .world_nodes import WorldEvaluator

DIRECTION = Linear()
BACKWARDS = Linear((-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0))
_NOTHING = Constant((0.0, 0.0, 0.0))


@dataclass(frozen=True)
class AffineMap:
    """`matrix` (3, 3), row by row, times a vector, plus `offset`."""

    matrix: tuple[float, ...]
    offset: Color

    def __call__(self, vectors: Float64Array) -> Float64Array:
        """(n, 3) for (n, 3)."""
        return vectors @ np.array(self.matrix).reshape(3, 3).T + np.array(self.offset)


def affine(matrix: Float64Array, offset: Float64Array, vector: Field) -> Field:
    """`matrix` (3, 3) times `vector` plus `offset` (3,); of the direction, a `Linear` again."""
    if isinstance(vector, Linear):
        offset = matrix @ np.array(vector.offset) + offset
        matrix = matrix @ np.array(vector.matrix).reshape(3, 3)
    rows = tuple(float(value) for value in matrix.ravel())
    moved = float(offset[0]), float(offset[1]), float(offset[2])
    return Linear(rows, moved) if isinstance(vector, Linear) else computed(AffineMap(rows, moved), vector)


def _texture_coordinates(source: Source, evaluator: WorldEvaluator) -> Field:
    output, target = source.socket.identifier, source.node.object
    if output == "Object" and target is not None:
        inverse = np.array(target.matrix_world.inverted_safe())
        return affine(inverse[:3, :3], inverse[:3, 3], DIRECTION)
    if output in {"Generated", "Object"}:
        return DIRECTION
    if output in {"Normal", "Reflection"}:
        return BACKWARDS
    if output != "UV":
        evaluator.warn(source.node, f"{output} coordinates are not rendered yet; a vector of zeros is used instead")
    return _NOTHING


def _geometry(source: Source, evaluator: WorldEvaluator) -> Field:
    if source.socket.identifier == "Position":
        return DIRECTION
    if source.socket.identifier in {"Normal", "True Normal", "Incoming"}:
        return BACKWARDS
    evaluator.warn(source.node, f"{source.socket.name} is not rendered yet; 0 is used instead")
    return _NOTHING


def _mapping(source: Source, evaluator: WorldEvaluator) -> Field:
    node = source.node
    vector = evaluator.field(node.inputs["Vector"], source.groups)
    kind = node.vector_type
    rotation = evaluator.constant(node.inputs["Rotation"], source.groups)
    scale = np.array(evaluator.constant(node.inputs["Scale"], source.groups))
    moves = kind in {"POINT", "TEXTURE"}
    location = np.array(evaluator.constant(node.inputs["Location"], source.groups)) if moves else np.zeros(3)
    turn = np.array(mathutils.Euler(rotation).to_matrix())
    inverse = np.divide(1.0, scale, out=np.zeros(3), where=scale != 0.0)
    if kind == "TEXTURE":
        matrix = inverse[:, None] * turn.T
        return affine(matrix, -(matrix @ location), vector)
    if kind == "NORMAL":
        return computed(normalized, affine(turn * inverse, np.zeros(3), vector))
    return affine(turn * scale, location, vector)


def _vector_math(source: Source, evaluator: WorldEvaluator) -> Field:
    node = source.node
    operation = _VECTOR_MATH.get(node.operation)
    sockets = [socket for socket in node.inputs if socket.enabled]
    if operation is None:
        name = node.operation.title()
        evaluator.warn(node, f"operation {name} is not rendered yet; its first input is used as it is")
        return evaluator.field(sockets[0], source.groups)
    return computed(operation, *(evaluator.field(socket, source.groups) for socket in sockets))


def _combine(source: Source, evaluator: WorldEvaluator) -> Field:
    return computed(_combined, *(evaluator.field(socket, source.groups) for socket in source.node.inputs[:3]))


def _separate(source: Source, evaluator: WorldEvaluator) -> Field:
    axis = "XYZ".index(source.socket.identifier)
    return computed(COMPONENTS[axis], evaluator.field(source.node.inputs[0], source.groups))


def _combined(x: Float64Array, y: Float64Array, z: Float64Array) -> Float64Array:
    return np.stack([part[:, 0] for part in np.broadcast_arrays(x, y, z)], axis=-1)


def _component(axis: int) -> Operation:
    return lambda vectors: np.repeat(vectors[:, axis : axis + 1], 3, axis=1)


COMPONENTS = tuple(_component(axis) for axis in range(3))
"""Each takes one of the three numbers of a field, as a value."""


def _gradient(shape: Callable[[Float64Array, Float64Array, Float64Array], Float64Array]) -> Operation:
    return lambda vectors: np.repeat(np.clip(shape(*vectors.T), 0.0, 1.0)[:, None], 3, axis=1)


def _ball(x: Float64Array, y: Float64Array, z: Float64Array) -> Float64Array:
    return np.maximum(0.999999 - np.sqrt(x * x + y * y + z * z), 0.0)


def _easing(x: Float64Array) -> Float64Array:
    part = np.clip(x, 0.0, 1.0)
    return part * part * (3.0 - 2.0 * part)


GRADIENTS: dict[str, Operation] = {
    "LINEAR": _gradient(lambda x, y, z: x),
    "QUADRATIC": _gradient(lambda x, y, z: np.maximum(x, 0.0) ** 2),
    "EASING": _gradient(lambda x, y, z: _easing(x)),
    "DIAGONAL": _gradient(lambda x, y, z: 0.5 * (x + y)),
    "RADIAL": _gradient(lambda x, y, z: np.arctan2(y, x) / (2.0 * np.pi) + 0.5),
    "QUADRATIC_SPHERE": _gradient(lambda x, y, z: _ball(x, y, z) ** 2),
    "SPHERICAL": _gradient(_ball),
}
"""What Gradient Texture makes of vectors, by its type."""


def _scalar(values: Float64Array) -> Float64Array:
    return np.repeat(values[:, None], 3, axis=1)


_VECTOR_MATH: dict[str, Operation] = {
    "ADD": add,
    "SUBTRACT": lambda a, b: a - b,
    "MULTIPLY": multiply,
    "DIVIDE": lambda a, b: np.where(b != 0.0, a / b, 0.0),
    "SCALE": multiply,
    "NORMALIZE": lambda a: np.where(np.any(a != 0.0, axis=-1, keepdims=True), normalized(a), 0.0),
    "DOT_PRODUCT": lambda a, b: _scalar(np.sum(a * b, axis=-1)),
    "CROSS_PRODUCT": np.cross,
    "LENGTH": lambda a: _scalar(np.linalg.norm(a, axis=-1)),
    "ABSOLUTE": np.abs,
    "MINIMUM": np.minimum,
    "MAXIMUM": np.maximum,
}

VECTOR_READERS: dict[str, Callable[[Source, WorldEvaluator], Field]] = {
    "ShaderNodeTexCoord": _texture_coordinates,
    "ShaderNodeNewGeometry": _geometry,
    "ShaderNodeMapping": _mapping,
    "ShaderNodeVectorMath": _vector_math,
    "ShaderNodeCombineXYZ": _combine,
    "ShaderNodeSeparateXYZ": _separate,
}
