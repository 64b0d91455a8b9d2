# SPDX-License-Identifier: GPL-3.0-or-later
"""What a world's node graph computes, as values that can be compared and evaluated for many directions at once.

Reading the graph into fields is quick; only where they differ from those before are they evaluated.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..scene import Image
from ..scene.arrays import Color, Float32Array, Float64Array
from ..scene.equirectangular import interpolated, look_up
from .materials.images import linear
from .sky import Sky, single_scattering_radiance
from .sky_multiple import multiple_scattering_radiance
from .sky_preetham import PreethamSky, preetham_radiance

Operation = Callable[..., Float64Array]
"""Of arrays (n, 3), or (1, 3) where all directions have one value, to another such; equal ones compute the same."""

LARGEST_SIZE = 4096
"""Most texels of a map along either axis; larger images are halved until they fit."""


@dataclass(frozen=True, eq=False)
class Field(ABC):
    """Three numbers by direction: a colour, a vector, or three times one value. `inputs`: what it is computed from."""

    inputs: tuple[Field, ...]

    @property
    @abstractmethod
    def parameters(self) -> tuple[object, ...]:
        """What it depends on besides its inputs, to be compared."""

    @abstractmethod
    def compute(self, directions: Float64Array, *inputs: Float64Array) -> Float64Array:
        """(n, 3) float64 for unit directions (n, 3) in world space, or (1, 3) where all have the same; inputs alike."""


@dataclass(frozen=True, eq=False)
class Constant(Field):
    """The same in all directions."""

    inputs: tuple[Field, ...] = field(init=False, default=())
    value: Color

    @property
    def parameters(self) -> tuple[object, ...]:
        """The value."""
        return (self.value,)

    def compute(self, directions: Float64Array, *inputs: Float64Array) -> Float64Array:
        """(1, 3)."""
        return np.array([self.value], np.float64)


@dataclass(frozen=True, eq=False)
class Linear(Field):
    """`matrix` (3, 3), row by row, times the direction, plus `offset`."""

    inputs: tuple[Field, ...] = field(init=False, default=())
    matrix: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    offset: Color = (0.0, 0.0, 0.0)

    @property
    def parameters(self) -> tuple[object, ...]:
        """Matrix and offset."""
        return (self.matrix, self.offset)

    def compute(self, directions: Float64Array, *inputs: Float64Array) -> Float64Array:
        """(n, 3)."""
        return directions @ np.array(self.matrix).reshape(3, 3).T + np.array(self.offset)

    @property
    def rotation(self) -> Float64Array | None:
        """(3, 3) where the vector's direction is a mere rotation of the world's, else None."""
        matrix = np.array(self.matrix).reshape(3, 3)
        scale = float(np.linalg.norm(matrix[0]))
        if any(self.offset) or scale == 0.0 or np.linalg.det(matrix) <= 0.0:
            return None
        matrix = matrix / scale
        return matrix if np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6) else None


@dataclass(frozen=True, eq=False)
class Computed(Field):
    """An operation on its inputs."""

    operation: Operation

    @property
    def parameters(self) -> tuple[object, ...]:
        """The operation."""
        return (self.operation,)

    def compute(self, directions: Float64Array, *inputs: Float64Array) -> Float64Array:
        """(n, 3) or (1, 3)."""
        with np.errstate(all="ignore"):
            return self.operation(*inputs)


@dataclass(frozen=True, eq=False)
class EnvironmentImage(Field):
    """An image around the world, looked up in the direction of its input; `mirror_ball`, or else equirectangular."""

    image: Image
    mirror_ball: bool

    @property
    def parameters(self) -> tuple[object, ...]:
        """Which image, and the projection."""
        return (self.image.key, self.image.version, self.mirror_ball)

    @property
    def size(self) -> tuple[int, int]:
        """(H, W) of `pixels`."""
        height, width = self.image.pixels.shape[:2]
        while max(height, width) > LARGEST_SIZE:
            height, width = -(-height // 2), -(-width // 2)
        return height, width

    @cached_property
    def pixels(self) -> Float32Array:
        """(H, W, 3) scene-linear, finite and ≥ 0, at most `LARGEST_SIZE` wide and high."""
        pixels = np.maximum(linear(self.image)[..., :3], np.float32(0.0))
        while max(pixels.shape[:2]) > LARGEST_SIZE:
            pixels = _halved(pixels)
        return np.ascontiguousarray(pixels)

    def compute(self, directions: Float64Array, *inputs: Float64Array) -> Float64Array:
        """(n, 3)."""
        vectors = normalized(inputs[0])
        if not self.mirror_ball:
            return look_up(self.pixels, vectors)
        height, width = self.pixels.shape[:2]
        across = np.sqrt(np.maximum(2.0 * (1.0 - vectors[:, 1]), 1e-30))
        column = (0.5 * vectors[:, 0] / across + 0.5) * width - 0.5
        row = (0.5 * vectors[:, 2] / across + 0.5) * height - 0.5
        return interpolated(self.pixels, column, row)


@dataclass(frozen=True, eq=False)
class SkyTexture(Field):
    """A sky in the direction of its input, without its sun, which has `sun_size` (rad, 0 for none) and is brighter by
    `sun_intensity` than in nature."""

    sky: Sky | PreethamSky
    sun_size: float = 0.0
    sun_intensity: float = 1.0

    @property
    def parameters(self) -> tuple[object, ...]:
        """The sky; the sun is a light."""
        return (self.sky,)

    def compute(self, directions: Float64Array, *inputs: Float64Array) -> Float64Array:
        """(n, 3) scene-linear radiance."""
        vectors = normalized(inputs[0])
        if isinstance(self.sky, PreethamSky):
            return preetham_radiance(self.sky, vectors)
        radiance = multiple_scattering_radiance if self.sky.multiple else single_scattering_radiance
        return radiance(self.sky, vectors)


def vector_rotation(texture: Field) -> Float64Array | None:
    """(3, 3) where a texture is looked up in the world's direction, rotated; None where it is not."""
    vector = texture.inputs[0]
    return vector.rotation if isinstance(vector, Linear) else None


def in_order(whole: Field) -> list[Field]:
    """`whole` and everything that it is computed from, each once and after its inputs."""
    ordered: dict[int, Field] = {}
    waiting = [whole]
    while waiting:
        current = waiting[-1]
        missing = [source for source in current.inputs if id(source) not in ordered]
        waiting.extend(missing)
        if not missing:
            ordered[id(waiting.pop())] = current
    return list(ordered.values())


def signature(whole: Field) -> tuple[object, ...]:
    """A value that is equal for fields that compute the same from the same."""
    ordered = in_order(whole)
    numbers = {id(part): number for number, part in enumerate(ordered)}
    return tuple(
        (type(part), part.parameters, tuple(numbers[id(source)] for source in part.inputs)) for part in ordered
    )


def evaluate(whole: Field, directions: Float64Array) -> Float64Array:
    """(n, 3) float64 for unit directions (n, 3) in world space, or (1, 3) where all have the same."""
    values: dict[int, Float64Array] = {}
    for part in in_order(whole):
        values[id(part)] = part.compute(directions, *(values[id(source)] for source in part.inputs))
    return values[id(whole)]


def computed(operation: Operation, *inputs: Field) -> Field:
    """An operation on fields; a constant where all of them are."""
    result = Computed(inputs, operation)
    if not all(isinstance(source, Constant) for source in inputs):
        return result
    red, green, blue = np.broadcast_to(evaluate(result, np.zeros((1, 3))), (1, 3))[0]
    return Constant((float(red), float(green), float(blue)))


def split_factor(whole: Field) -> tuple[Color, Field]:
    """A constant factor and what it multiplies: together they are `whole`."""
    red = green = blue = 1.0
    while isinstance(whole, Computed) and whole.operation is multiply:
        first, second = whole.inputs
        constant, rest = (first, second) if isinstance(first, Constant) else (second, first)
        if not isinstance(constant, Constant):
            break
        red, green, blue = red * constant.value[0], green * constant.value[1], blue * constant.value[2]
        whole = rest
    return (red, green, blue), whole


def linear_shares(whole: Field) -> Iterator[tuple[Field, Color]]:
    """The parts that `whole` is a sum of, each with its constant factor, also those that are sums themselves.

    What an operation other than addition, a constant factor or a mix by a constant makes of its inputs is one part.
    """
    shares: dict[int, Float64Array] = {id(whole): np.ones(3)}
    for part in reversed(in_order(whole)):
        share = shares.get(id(part))
        if share is None:
            continue
        yield part, (float(share[0]), float(share[1]), float(share[2]))
        for source, factor in _weighted_inputs(part):
            shares[id(source)] = shares.get(id(source), np.zeros(3)) + share * factor


def _weighted_inputs(part: Field) -> list[tuple[Field, Float64Array]]:
    """Inputs and factors of a sum; nothing for anything else."""
    if not isinstance(part, Computed):
        return []
    if part.operation is add:
        return [(source, np.ones(3)) for source in part.inputs]
    if part.operation is multiply:
        first, second = part.inputs
        pairs = (first, second), (second, first)
        return [(source, np.array(by.value)) for source, by in pairs if isinstance(by, Constant)]
    if part.operation is lerp and isinstance(part.inputs[2], Constant):
        fraction = np.array(part.inputs[2].value)
        return [(part.inputs[0], 1.0 - fraction), (part.inputs[1], fraction)]
    return []


def add(first: Float64Array, second: Float64Array) -> Float64Array:
    """Sum."""
    return first + second


def multiply(first: Float64Array, second: Float64Array) -> Float64Array:
    """Product, channel by channel."""
    return first * second


def lerp(first: Float64Array, second: Float64Array, fraction: Float64Array) -> Float64Array:
    """`first` where `fraction` is 0, `second` where it is 1."""
    return first + (second - first) * fraction


def normalized(vectors: Float64Array) -> Float64Array:
    """Unit vectors (n, 3); (1, 0, 0) for those of length 0."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > 0.0, vectors / np.where(length > 0.0, length, 1.0), (1.0, 0.0, 0.0))


def _halved(pixels: Float32Array) -> Float32Array:
    """(⌈H/2⌉, ⌈W/2⌉, C): means of 2 × 2 texels; the last of an odd number counts twice."""
    height, width, channels = pixels.shape
    even = np.pad(pixels, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    return even.reshape(even.shape[0] // 2, 2, even.shape[1] // 2, 2, channels).mean(axis=(1, 3), dtype=np.float32)
