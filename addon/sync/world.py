# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's world as radiance by direction, and the suns in its skies as lights."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene import EnvironmentMap, Light, SunDisc, World
from ..scene.arrays import Color, Float32Array, Float64Array
from ..scene.equirectangular import texel_directions
from ..scene.versions import new_version
from .changes import Messages, same_fields
from .materials import ImageTable, has_nodes
from .materials.graph import find_output, find_source
from .materials.operations import LARGEST
from .sky import Sky
from .sun import sun_disc, sun_light
from .world_fields import (
    LARGEST_SIZE,
    Constant,
    EnvironmentImage,
    Field,
    SkyTexture,
    evaluate,
    in_order,
    linear_shares,
    signature,
    split_factor,
    vector_rotation,
)
from .world_nodes import BLACK, WorldEvaluator

if TYPE_CHECKING:
    import bpy

_KEY = "world"
_PROCEDURAL_SIZE = (512, 1024)
_ROWS_AT_ONCE = 64


@dataclass(frozen=True)
class _Frame:
    """The directions that a map is made for: its size, and the rotation from world space to the map's."""

    height: int
    width: int
    rotation: Float64Array | None


class WorldTable:
    """The world, kept between syncs so that its map is made again only when something changes what it shows."""

    def __init__(self) -> None:
        self._content: tuple[object, ...] = ()
        self._map: EnvironmentMap | None = None
        self._world = World()

    def read(
        self, depsgraph: bpy.types.Depsgraph, images: ImageTable, messages: Messages
    ) -> tuple[World, tuple[Light, ...]]:
        """The view layer's world, its own or the scene's, and the lights in it; the same `World` where it is equal.

        Black where the layer has no Environment and without a world or surface. What cannot be rendered is told.
        """
        world, lights = self._read(depsgraph, images, messages)
        if not same_fields(world, self._world):
            self._world = world
        return self._world, lights

    def _read(
        self, depsgraph: bpy.types.Depsgraph, images: ImageTable, messages: Messages
    ) -> tuple[World, tuple[Light, ...]]:
        scene: Any = depsgraph.scene_eval
        view_layer: Any = depsgraph.view_layer_eval
        world = view_layer.world_override or scene.world
        if world is None or not view_layer.use_sky:
            return World(), ()
        black = _black(world)
        casts_shadow = getattr(getattr(world, "cycles", None), "use_shadows", True)  # since Blender 5.2
        if not has_nodes(world):
            red, green, blue = world.color
            return replace(black, radiance=(red, green, blue)), ()
        evaluator = WorldEvaluator(f"World “{world.name}”", images)
        radiance = _radiance(world.node_tree, evaluator)
        lights, black = _suns(radiance, world.name, black, evaluator)
        if not casts_shadow:
            evaluator.tell("only its sun can be without shadows yet; its other light is blocked by what is in its way")
            lights = tuple(replace(light, casts_shadow=False) for light in lights)
        mirrored = self._mirror(world.name, radiance, black)
        messages.extend(_KEY, evaluator.warnings)
        return mirrored, lights

    def _mirror(self, name: str, radiance: Field, black: World) -> World:
        factor, shown = split_factor(radiance)
        if isinstance(shown, Constant):
            self._map = None
            return replace(black, radiance=_limited(np.multiply(factor, shown.value)))
        frame = _frame(shown)
        plain = shown if isinstance(shown, EnvironmentImage) and frame.rotation is not None else None
        content = plain.parameters if plain else signature(shown)
        if self._map is None or self._content != content:
            pixels = plain.pixels if plain else _pixels(shown, frame)
            self._map = EnvironmentMap(_KEY, name, new_version(), pixels)
            self._content = content
        elif self._map.name != name:
            self._map = replace(self._map, name=name)
        unturned = frame.rotation is None or np.allclose(frame.rotation, np.eye(3), atol=1e-7)
        return replace(
            black,
            radiance=_limited(np.array(factor)),
            environment=self._map,
            environment_from_world=None if unturned else frame.rotation,
        )


def _radiance(tree: Any, evaluator: WorldEvaluator) -> Field:
    output = find_output(tree, "ShaderNodeOutputWorld")
    if output is None:
        return BLACK
    if find_source(output.inputs["Volume"], ()).node is not None:
        evaluator.warn(output, "volume is not rendered yet")
    return evaluator.radiance(output.inputs["Surface"], ())


def _black(world: Any) -> World:
    """A world without radiance that is seen by the same rays as Blender's."""
    rays = getattr(world, "cycles_visibility", None)
    if rays is None:
        return World()
    return World(seen_by_camera=rays.camera, seen_by_diffuse=rays.diffuse, seen_by_glossy=rays.glossy)


def _limited(color: Float64Array) -> Color:
    red, green, blue = np.clip(np.nan_to_num(color, nan=0.0), 0.0, LARGEST)
    return float(red), float(green), float(blue)


def _frame(shown: Field) -> _Frame:
    """The directions of the first image's own texels where one is merely rotated, otherwise a grid of directions."""
    images = [part for part in in_order(shown) if isinstance(part, EnvironmentImage)]
    for image in images:
        rotation = vector_rotation(image)
        if not image.mirror_ball and rotation is not None:
            return _Frame(*image.size, rotation)
    if not images:
        return _Frame(*_PROCEDURAL_SIZE, None)
    width = min(max(image.size[1] * (2 if image.mirror_ball else 1) for image in images), LARGEST_SIZE)
    return _Frame(max(width // 2, 1), width, None)


def _pixels(shown: Field, frame: _Frame) -> Float32Array:
    """(H, W, 3) radiance in the directions of a frame, finite and ≥ 0."""
    pixels = np.empty((frame.height, frame.width, 3), np.float32)
    for start in range(0, frame.height, _ROWS_AT_ONCE):
        rows = slice(start, start + _ROWS_AT_ONCE)
        directions = texel_directions(frame.height, frame.width, rows).reshape(-1, 3)
        if frame.rotation is not None:
            directions = directions @ frame.rotation
        values = np.nan_to_num(evaluate(shown, directions), nan=0.0)
        pixels[rows].reshape(-1, 3)[:] = np.clip(values, 0.0, LARGEST)
    return pixels


def _suns(radiance: Field, name: str, black: World, evaluator: WorldEvaluator) -> tuple[tuple[Light, ...], World]:
    """The suns of the skies in a world, as far as it is their sum: lights, and `black` with the first one's disc."""
    shares = {id(part): share for part, share in linear_shares(radiance)}
    lights: list[Light] = []
    disc: SunDisc | None = None
    for part in in_order(radiance):
        if not (isinstance(part, SkyTexture) and isinstance(part.sky, Sky) and part.sun_size > 0.0):
            continue
        share, rotation = shares.get(id(part)), vector_rotation(part)
        if share is None or rotation is None:
            evaluator.tell("the sun of a sky whose colour or vector is changed is not rendered yet; it is left out")
            continue
        color = _limited(np.array(share) * part.sun_intensity)
        if disc is None:
            disc = sun_disc(part.sky, part.sun_size, color, rotation)
        elif black.seen_by_camera:
            evaluator.tell("only one sun's disc is seen in the background yet; the others light the scene unseen")
        light = sun_light(f"{_KEY}/sun{len(lights) or ''}", name, part.sky, part.sun_size, color, rotation)
        seen = {"diffuse_factor": float(black.seen_by_diffuse), "specular_factor": float(black.seen_by_glossy)}
        lights.append(replace(light, **seen))
    return tuple(lights), replace(black, sun_disc=disc)
