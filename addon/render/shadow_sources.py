# SPDX-License-Identifier: GPL-3.0-or-later
"""The lights that cast shadows on what is seen, and the maps that each needs. Pure: no OpenGL."""

from dataclasses import dataclass
from math import pi

import numpy as np

from ..scene import ALL_GROUPS, Light, LightKind
from ..scene.arrays import Float64Array
from .light_reach import extent
from .lighting_plan import LightPlan
from .receivers import Receivers
from .shadow_views import (
    MOST_CASCADES,
    WIDEST_SINGLE,
    Cone,
    Fineness,
    LocalReceivers,
    ShadowMap,
    cone_map,
    cube_maps,
    sun_maps,
)
from .surfaces import Surface

_EVERYWHERE = Cone(np.array([0.0, 0.0, 1.0]), pi)
_CUBE_SHARE = 2
"""A cube's face has at most half as many texels a side as the largest map: there are six."""

_TEXELS_OF_HARD_EDGES, _TEXELS_OF_SOFT_EDGES = 4.0, 2.0
"""Texels per pixel: a shadow's edge is blurred by a texel (measured against Cycles: a pixel's width is too much)."""

_WORLD_SHARE = 4
_WORLD_CASCADES = 1
"""Maps of the world's directions are coarser than a sun's: very many of them are averaged."""


@dataclass(frozen=True)
class ShadowSource:
    """A light that casts shadows: its `index` among the lights, and which groups of instances block it.

    `center` (3,), world space: its middle, which no point of it is farther from than `extent` (m); None where it is
    infinitely far. `nearest` (m): what is nearer to its sampled point blocks nothing. `texel`: `Light.shadow_texel`.
    `share`: what the largest map's size is divided by; `cascades`: how many maps a distant light may have.
    """

    index: int
    blocker_groups: int
    center: Float64Array | None = None
    extent: float = 0.0
    cone: Cone = _EVERYWHERE
    texel: float = 0.0
    share: int = 1
    cascades: int = MOST_CASCADES
    nearest: float = 0.0

    @property
    def texels_per_pixel(self) -> float:
        """A light without size always has the same map, whose edges are seen; those of others are averaged."""
        return _TEXELS_OF_HARD_EDGES if self.extent == 0.0 else _TEXELS_OF_SOFT_EDGES

    @property
    def is_cube(self) -> bool:
        """Whether its maps are the six faces of a cube."""
        return self.center is not None and self.cone.half_angle > WIDEST_SINGLE

    def maps(
        self, point: Float64Array, receivers: Receivers, casters: Float64Array, largest: int, reach: float
    ) -> tuple[ShadowMap | None, ...]:
        """The maps as seen from a point (3,) of the light, or from the direction to it where it is infinitely far.

        `casters` (K, 2, 3): bounds of what may be in between. `largest`: texels a side. `reach` (m): how far from its
        middle it lights anything. None: nothing is seen there; no maps where it reaches nothing that is seen.
        """
        fineness = Fineness(largest // self.share, self.texels_per_pixel, self.texel)
        if self.center is None:
            return sun_maps(-point, receivers, casters, fineness, self.cascades)
        local = LocalReceivers(receivers, self.center, self.extent, self.cone, reach, self.nearest)
        if not local.any:
            return ()
        if self.is_cube:
            return cube_maps(point, local, fineness)
        return (cone_map(point, self.cone, local, fineness),)


def shadow_sources(planned: LightPlan) -> tuple[ShadowSource, ...]:
    """The lights of a plan that cast shadows."""
    sources = [_lamp_source(index, light) for index, light in enumerate(planned.lights) if light.casts_shadow]
    sources += [
        _surface_source(index, light.surface) for index, light in enumerate(planned.mesh_lights, len(planned.lights))
    ]
    first = planned.count - planned.world_directions
    sources += [
        ShadowSource(index, ALL_GROUPS, share=_WORLD_SHARE, cascades=_WORLD_CASCADES)
        for index in range(first, planned.count)
    ]
    return tuple(sources)


def _surface_source(index: int, surface: Surface) -> ShadowSource:
    """An emissive surface's; it does not shadow itself where it is not exactly where its points are."""
    center, radius = surface.center, surface.radius
    return ShadowSource(index, ALL_GROUPS, center, radius, share=_CUBE_SHARE, nearest=surface.rounding)


def _lamp_source(index: int, light: Light) -> ShadowSource:
    if light.kind is LightKind.SUN:
        return ShadowSource(index, light.blocker_groups, texel=light.shadow_texel)
    cone = _EVERYWHERE
    axis = -light.world_from_light[:3, 2]
    if light.kind is LightKind.SPOT:
        cone = Cone(axis, 0.5 * light.angle)
    elif light.kind is LightKind.AREA:
        cone = Cone(axis, min(0.5 * light.spread, 0.5 * pi))
    share = _CUBE_SHARE if cone.half_angle > WIDEST_SINGLE and extent(light) > 0.0 else 1
    center = light.world_from_light[:3, 3]
    return ShadowSource(index, light.blocker_groups, center, extent(light), cone, light.shadow_texel, share)
