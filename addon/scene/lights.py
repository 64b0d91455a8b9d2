# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights with Blender's units already resolved to radiometric quantities."""

from dataclasses import dataclass
from enum import StrEnum

from .arrays import Color, Float64Array


class LightKind(StrEnum):
    """Blender's four light types."""

    POINT = "POINT"
    SUN = "SUN"
    SPOT = "SPOT"
    AREA = "AREA"


class AreaShape(StrEnum):
    """Shape of an area light; squares and disks are those with equal sizes."""

    RECTANGLE = "RECTANGLE"
    ELLIPSE = "ELLIPSE"


LINK_GROUPS = 64
"""How many groups of instances light and shadow linking can tell apart, as in Cycles."""

ALL_GROUPS = (1 << LINK_GROUPS) - 1


@dataclass(frozen=True)
class Light:
    """One light, emitting along its local −Z.

    `world_from_light` (4, 4) float64, rigid: object scale is already in `size` (m) and `radius` (m).
    `emission`, scene-linear RGB with colour, power, exposure and temperature multiplied in:
      POINT, SPOT: radiant intensity, W/sr (before the spot cone); SUN: irradiance on a surface facing it, W/m²;
      AREA: emitted radiance, W/(sr·m²), of the front face.
    `angle` (rad): full cone angle of a spot, full angular diameter of a sun.
    `soft_falloff`: a point or spot light is a disk that always faces what it lights, not a sphere.
    `blend` 0…1: soft share of the spot's cone. `spread` (rad): full emission angle of an area light, π for all.
    `diffuse_factor`, `specular_factor`: multiply the light that leaves surfaces so; 0 where rays of the kind miss it.
    `receiver_groups`, `blocker_groups`: bit g is set where instances with `InstanceBatch.link_group` g are lit by it,
    and where they cast its shadows (Blender's light and shadow linking).
    `shadow_texel` (m): smallest useful size of a shadow-map texel on a surface 1 m away, or anywhere for a sun
    (Blender's Resolution Limit), 0 for no limit.
    """

    key: str
    name: str
    kind: LightKind
    world_from_light: Float64Array
    emission: Color
    radius: float = 0.0
    angle: float = 0.0
    soft_falloff: bool = False
    blend: float = 0.0
    shape: AreaShape = AreaShape.RECTANGLE
    size: tuple[float, float] = (0.0, 0.0)
    spread: float = 3.141592653589793
    diffuse_factor: float = 1.0
    specular_factor: float = 1.0
    casts_shadow: bool = True
    receiver_groups: int = ALL_GROUPS
    blocker_groups: int = ALL_GROUPS
    shadow_texel: float = 0.0
