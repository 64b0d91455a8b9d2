# SPDX-License-Identifier: GPL-3.0-or-later
"""A world's shader nodes as fields: colours and vectors by direction.

Nodes that are not told of here are read as constants, as for materials, and reported where they are not.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy
import mathutils
import numpy as np

from ..scene.arrays import Color
from .materials import ImageTable
from .materials.expressions import Evaluator
from .materials.graph import Groups, Socket, Source, find_source
from .materials.nodes import NODE_READERS
from .materials.surfaces import evaluate_surface
from .sky import SMALLEST_SUN, Air, Sky
from .sky_preetham import PreethamSky
from .world_colors import COLOR_READERS, as_value, mean_value, mixed, unit_range
from .world_fields import LARGEST_SIZE, Constant, EnvironmentImage, Field, SkyTexture, add, computed, multiply
from .world_vectors import DIRECTION, GRADIENTS, VECTOR_READERS

BLACK = Constant((0.0, 0.0, 0.0))


class WorldEvaluator:
    """Reads the sockets of one world's node graph; keeps no Blender object longer than that.

    `owner` (“World “X””) begins each text about what is not rendered as the graph says.
    """

    def __init__(self, owner: str, images: ImageTable) -> None:
        self.owner = owner
        self.images = images
        self._constants = Evaluator(owner, images, NODE_READERS)
        self._fields = Evaluator(owner, images, {})
        self.warn = self._constants.warn

    @property
    def warnings(self) -> tuple[str, ...]:
        """Texts about what is not rendered as the graph says."""
        return tuple(self._constants.warnings | self._fields.warnings)

    def tell(self, text: str) -> None:
        """Report a clause about the world as a whole."""
        self._fields.warnings.setdefault(f"{self.owner}: {text}.", None)

    def radiance(self, socket: Socket, groups: Groups) -> Field:
        """What a shader input receives; black where nothing is connected."""
        source = find_source(socket, groups)
        reader = None if source.node is None or source.node.mute else _SHADERS.get(source.node.bl_idname)
        if reader is None:
            return Constant(evaluate_surface(socket, groups, self._constants).emission)
        return self._fields.once(source, lambda source, _: reader(source, self), BLACK)

    def field(self, socket: Socket, groups: Groups) -> Field:
        """What a colour, vector or value input receives, converted to that."""
        source = find_source(socket, groups)
        reader = None if source.node is None or source.node.mute else _READERS.get(source.node.bl_idname)
        if reader is None:
            return Constant(self._constants.color(socket, groups))
        result = self._fields.once(source, lambda source, _: reader(source, self), BLACK)
        if socket.type != "VALUE" or source.socket.type == "VALUE":
            return result
        return computed(mean_value if source.socket.type == "VECTOR" else as_value, result)

    def vector(self, source: Source) -> Field:
        """The vector input of a texture; the direction itself where nothing that can be read is connected to one."""
        socket = source.node.inputs.get("Vector")
        if socket is None:
            return DIRECTION
        linked = find_source(socket, source.groups)
        if linked.node is not None and not linked.node.mute and linked.node.bl_idname not in _READERS:
            self.warn(linked.node, f"{linked.node.bl_label} is not rendered yet; the direction itself is used instead")
            return DIRECTION
        return DIRECTION if linked.node is None else self.field(socket, source.groups)

    def constant(self, socket: Socket, groups: Groups) -> Color:
        """What an input receives; the user is told where it varies, and what is not connected to it is used."""
        result = self.field(socket, groups)
        if isinstance(result, Constant):
            return result.value
        self.warn(socket.node, f"{socket.name} that varies is not rendered yet; its own value is used instead")
        red, green, blue = np.broadcast_to(socket.default_value, 3)
        return float(red), float(green), float(blue)


def _background(source: Source, evaluator: WorldEvaluator) -> Field:
    color, strength = (evaluator.field(source.node.inputs[name], source.groups) for name in ("Color", "Strength"))
    return computed(multiply, color, strength)


def _mix_shader(source: Source, evaluator: WorldEvaluator) -> Field:
    fraction, *shaders = source.node.inputs[:3]
    first, second = (evaluator.radiance(shader, source.groups) for shader in shaders)
    return mixed(first, second, computed(unit_range, evaluator.field(fraction, source.groups)))


def _add_shader(source: Source, evaluator: WorldEvaluator) -> Field:
    return computed(add, *(evaluator.radiance(socket, source.groups) for socket in source.node.inputs[:2]))


def _environment_texture(source: Source, evaluator: WorldEvaluator) -> Field:
    node = source.node
    if node.interpolation == "Closest":
        evaluator.warn(node, "its pixels are interpolated linearly, for now")
    image = evaluator.images.mirror(node, evaluator.owner).image
    texture = EnvironmentImage((evaluator.vector(source),), image, node.projection == "MIRROR_BALL")
    if texture.size != image.pixels.shape[:2]:
        evaluator.warn(node, f"image “{image.name}” is larger than {LARGEST_SIZE} pixels; it is halved until it is not")
    return texture


def _gradient_texture(source: Source, evaluator: WorldEvaluator) -> Field:
    return computed(GRADIENTS[source.node.gradient_type], evaluator.vector(source))


def _sky_texture(source: Source, evaluator: WorldEvaluator) -> Field:
    node = source.node
    inputs = (evaluator.vector(source),)
    rgb_from_xyz = _rgb_from_xyz()
    if node.sky_type in {"PREETHAM", "HOSEK_WILKIE"}:
        if node.sky_type == "HOSEK_WILKIE":
            evaluator.warn(
                node,
                "the Hosek / Wilkie model is not rendered yet; the Preetham model, which is brighter, is used instead",
            )
        x, y, z = node.sun_direction
        return SkyTexture(inputs, PreethamSky((x, y, z), node.turbidity, rgb_from_xyz))
    if node.sky_type not in {"NISHITA", "SINGLE_SCATTERING", "MULTIPLE_SCATTERING"}:
        name = node.sky_type.replace("_", " ").title()
        evaluator.warn(node, f"the {name} model is not rendered yet; single scattering is used instead")
    before_5 = bpy.app.version < (5, 0, 0)
    aerosols = node.dust_density if before_5 else node.aerosol_density
    sky = Sky(
        Air(node.altitude, node.air_density, aerosols, node.ozone_density),
        *_sun_position(node.sun_elevation, node.sun_rotation),
        rgb_from_xyz=rgb_from_xyz,
        multiple=node.sky_type == "MULTIPLE_SCATTERING",
        before_5=before_5,
    )
    return SkyTexture(inputs, sky, max(node.sun_size, SMALLEST_SUN) if node.sun_disc else 0.0, node.sun_intensity)


def _sun_position(elevation: float, rotation: float) -> tuple[float, float]:
    """Elevation within ±90° and rotation (rad) of a sun that may have gone on beyond the zenith, over and over."""
    elevation = (elevation + math.pi) % (2.0 * math.pi) - math.pi
    if abs(elevation) <= 0.5 * math.pi:
        return elevation, rotation
    return math.copysign(math.pi, elevation) - elevation, rotation + math.pi


def _rgb_from_xyz() -> tuple[float, ...]:
    """(3, 3), row by row: scene-linear colours of CIE XYZ, in whatever colour space Blender works."""
    columns = [mathutils.Color(axis.tolist()).from_xyz_d65_to_scene_linear() for axis in np.eye(3)]
    return tuple(float(column[row]) for row in range(3) for column in columns)


Reader = Callable[[Source, WorldEvaluator], Field]

_SHADERS: dict[str, Reader] = {
    "ShaderNodeBackground": _background,
    "ShaderNodeEmission": _background,
    "ShaderNodeMixShader": _mix_shader,
    "ShaderNodeAddShader": _add_shader,
}

_READERS: dict[str, Reader] = {
    **COLOR_READERS,
    **VECTOR_READERS,
    "ShaderNodeTexEnvironment": _environment_texture,
    "ShaderNodeTexGradient": _gradient_texture,
    "ShaderNodeTexSky": _sky_texture,
}
