# SPDX-License-Identifier: GPL-3.0-or-later
"""The lights that cast shadows on what is seen, and the maps that each needs. Pure: no OpenGL."""

from dataclasses import dataclass
from math import inf, pi

import numpy as np

from ..scene import ALL_GROUPS, Light, LightKind
from ..scene.arrays import Float64Array
from .light_reach import extent
from .lighting_plan import LightPlan
from .receivers import Receivers
from .shadow_views import MOST_CASCADES, WIDEST_SINGLE, Cone, LocalReceivers, ShadowMap, cone_map, cube_maps, sun_maps

_EVERYWHERE = Cone(np.array([0.0, 0.0, 1.0]), pi)
_CUBE_SHARE = 2
"""A cube's face has at most half as many texels a side as the largest map: there are six."""

_WORLD_SHARE = 2
_WORLD_CASCADES = 1
"""Maps of the world's directions are coarser than a sun's: very many of them are averaged."""


@dataclass(frozen=True)
class ShadowSource:
    """A light that casts shadows: its `index` among the lights, and which groups of instances block it.

    `local`: the receivers as it sees them; None where it is infinitely far. `texel`: `Light.shadow_texel`. `share`:
    what the largest map's size is divided by; `cascades`: how many maps a distant light may have.
    """

    index: int
    blocker_groups: int
    local: LocalReceivers | None = None
    cone: Cone = _EVERYWHERE
    texel: float = 0.0
    share: int = 1
    cascades: int = MOST_CASCADES

    @property
    def is_cube(self) -> bool:
        """Whether its maps are the six faces of a cube."""
        return self.local is not None and self.cone.half_angle > WIDEST_SINGLE

    def maps(
        self, point: Float64Array, receivers: Receivers, casters: Float64Array, largest: int
    ) -> tuple[ShadowMap | None, ...]:
        """The maps as seen from a point (3,) of the light, or from the direction to it where it is infinitely far.

        `casters` (K, 2, 3): bounds of what may be in between. `largest`: texels a side. None: nothing is seen there.
        """
        largest //= self.share
        if self.local is None:
            return sun_maps(-point, receivers, casters, largest, self.texel, self.cascades)
        if self.is_cube:
            return cube_maps(point, self.local, largest, self.texel)
        return (cone_map(point, self.cone, self.local, largest, self.texel),)


def shadow_sources(planned: LightPlan, receivers: Receivers) -> tuple[ShadowSource, ...]:
    """The lights of a plan that cast shadows on anything seen."""
    sources = [
        _lamp_source(index, light, receivers, planned.reach[index])
        for index, light in enumerate(planned.lights)
        if light.casts_shadow
    ]
    for index, light in enumerate(planned.mesh_lights, start=len(planned.lights)):
        local = LocalReceivers(receivers, light.center, light.radius, _EVERYWHERE, inf)
        sources.append(ShadowSource(index, ALL_GROUPS, local, share=_CUBE_SHARE))
    first = planned.count - planned.world_directions
    sources += [
        ShadowSource(index, ALL_GROUPS, share=_WORLD_SHARE, cascades=_WORLD_CASCADES)
        for index in range(first, planned.count)
    ]
    return tuple(source for source in sources if source.local is None or source.local.any)


def _lamp_source(index: int, light: Light, receivers: Receivers, reach: float) -> ShadowSource:
    if light.kind is LightKind.SUN:
        return ShadowSource(index, light.blocker_groups, texel=light.shadow_texel)
    cone = _EVERYWHERE
    axis = -light.world_from_light[:3, 2]
    if light.kind is LightKind.SPOT:
        cone = Cone(axis, 0.5 * light.angle)
    elif light.kind is LightKind.AREA:
        cone = Cone(axis, min(0.5 * light.spread, 0.5 * pi))
    local = LocalReceivers(receivers, light.world_from_light[:3, 3], extent(light), cone, reach)
    share = _CUBE_SHARE if cone.half_angle > WIDEST_SINGLE else 1
    return ShadowSource(index, light.blocker_groups, local, cone, light.shadow_texel, share)
