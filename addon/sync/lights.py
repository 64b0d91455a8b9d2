# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's lights in radiometric units, as Cycles defines them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene import AreaShape, Light, LightKind
from ..scene.arrays import Color, Float64Array
from .changes import Messages
from .materials import ImageTable, evaluate_emission, has_nodes

if TYPE_CHECKING:
    import bpy


def read_light(
    key: str,
    shown: bpy.types.Object,
    placer: bpy.types.Object,
    matrix: Float64Array,
    images: ImageTable,
    messages: Messages,
) -> Light | None:
    """The light of an evaluated object, placed by itself or an instancer with world matrix `matrix` (4, 4).

    Whatever is linked, it reaches all groups. None where the matrix is broken, and for Cycles' portals: they guide its
    sampling and do not shine. Like Cycles, nothing here reads EEVEE's Custom Distance.
    """
    light: Any = shown.data
    if light.type == "AREA" and hasattr(light, "cycles") and light.cycles.is_portal:
        return None
    name = shown.name
    axes = matrix[:3, :3]
    lengths = np.linalg.norm(axes, axis=0)
    if not np.isfinite(matrix).all() or lengths[2] == 0.0:
        messages.add(key, "matrix", f"Light “{name}” has a scale of zero or a broken transform; it is left out.")
        return None
    color = _color(light)
    if has_nodes(light):
        emission, warnings = evaluate_emission(f"Light “{name}”", light.node_tree, "ShaderNodeOutputLight", images)
        messages.extend(key, warnings)
        color = (color[0] * emission[0], color[1] * emission[1], color[2] * emission[2])
    common: dict[str, Any] = {
        "key": key,
        "name": name,
        "world_from_light": rigid_matrix(matrix),
        "diffuse_factor": light.diffuse_factor * (shown.visible_diffuse and placer.visible_diffuse),
        "specular_factor": light.specular_factor * (shown.visible_glossy and placer.visible_glossy),
        "casts_shadow": light.use_shadow,
        "shadow_texel": shadow_texel(light),
    }
    if light.type == "SUN":
        factor = sun_irradiance(light.angle, light.normalize)
        return Light(kind=LightKind.SUN, emission=_scaled(color, factor), angle=light.angle, **common)
    if light.type == "AREA":
        return _area_light(light, color, lengths, common)
    radius = light.shadow_soft_size
    common["soft_falloff"] = light.use_soft_falloff
    emission = _scaled(color, point_intensity(radius, light.normalize))
    if light.type == "SPOT":
        _warn_uneven_cone(key, name, lengths, messages)
        return Light(
            kind=LightKind.SPOT,
            emission=emission,
            radius=radius,
            angle=light.spot_size,
            blend=light.spot_blend,
            **common,
        )
    return Light(kind=LightKind.POINT, emission=emission, radius=radius, **common)


def shadow_texel(light: Any) -> float:
    """Metres that a shadow map's texel has at least; see `Light.shadow_texel`.

    Blender's Resolution Limit is meant 1 m from the light where it is absolute, and anywhere for a sun. Relative, it
    holds at each shadowed point, however far from the light, which no one texel of a map can keep: there is none then.
    """
    absolute = light.type == "SUN" or light.use_absolute_resolution
    return light.shadow_maximum_resolution if absolute else 0.0


def point_intensity(radius: float, normalize: bool) -> float:
    """Radiant intensity (W/sr) per watt of a point or spot light; unnormalised, radiance is fixed instead."""
    if normalize:
        return 1.0 / (4.0 * math.pi)
    return radius * radius if radius > 0.0 else 1.0 / math.pi


def sun_irradiance(angle: float, normalize: bool) -> float:
    """Irradiance per unit of strength; an unnormalised sun of angular diameter `angle` has fixed radiance."""
    return 1.0 if normalize or angle == 0.0 else math.pi * math.sin(angle / 2.0) ** 2


def area_radiance(size: tuple[float, float], shape: AreaShape, normalize: bool) -> float:
    """Radiance (W/(sr·m²)) per watt of an area light that is `size` metres wide and high in the world."""
    area = size[0] * size[1] * (math.pi / 4.0 if shape is AreaShape.ELLIPSE else 1.0)
    return 1.0 / (math.pi * area) if normalize and area > 0.0 else 1.0 / math.pi


def rigid_matrix(matrix: Float64Array) -> Float64Array:
    """(4, 4) rotation and position of a matrix that may scale, mirror or shear: its −Z direction is kept exactly.

    Axes without length are replaced; the result is always a rotation.
    """
    z = _unit(matrix[:3, 2], np.array([0.0, 0.0, 1.0]))
    y = matrix[:3, 1] - z * (z @ matrix[:3, 1])
    if np.linalg.norm(y) <= 1e-12 * max(float(np.abs(matrix[:3, :3]).max()), 1e-30):
        y = np.asarray(np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))]), np.float64)
    y = _unit(y, y)
    rigid = np.eye(4)
    rigid[:3, 0], rigid[:3, 1], rigid[:3, 2], rigid[:3, 3] = np.cross(y, z), y, z, matrix[:3, 3]
    return rigid


def _unit(vector: Float64Array, otherwise: Float64Array) -> Float64Array:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else otherwise


def _color(light: Any) -> Color:
    scale = light.energy * 2.0**light.exposure
    red, green, blue = (channel * scale for channel in light.color)
    if not light.use_temperature:
        return red, green, blue
    warm_red, warm_green, warm_blue = light.temperature_color
    return red * warm_red, green * warm_green, blue * warm_blue


def _scaled(color: Color, factor: float) -> Color:
    return color[0] * factor, color[1] * factor, color[2] * factor


def _area_light(light: Any, color: Color, lengths: Float64Array, common: dict[str, Any]) -> Light:
    width = light.size
    height = light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size
    size = (width * float(lengths[0]), height * float(lengths[1]))
    shape = AreaShape.ELLIPSE if light.shape in {"DISK", "ELLIPSE"} else AreaShape.RECTANGLE
    return Light(
        kind=LightKind.AREA,
        emission=_scaled(color, area_radiance(size, shape, light.normalize)),
        shape=shape,
        size=size,
        spread=light.spread,
        **common,
    )


def _warn_uneven_cone(key: str, name: str, lengths: Float64Array, messages: Messages) -> None:
    if lengths.max() > lengths.min() * 1.0001:
        messages.add(key, "cone", f"Spot light “{name}” is scaled unevenly; its cone is shown unscaled.")
