# SPDX-License-Identifier: GPL-3.0-or-later
"""How light that was reflected before is found: the method and its numbers."""

from dataclasses import dataclass
from enum import StrEnum


class IndirectMethod(StrEnum):
    """Where a pixel's indirect light, and that of the world, come from.

    NONE: direct light only. OCCLUSION: the world's light, as far as the layers around the pixel leave it open: ambient
    obscurance. SSAO: the same from random depth comparisons. RADIOSITY: the layers around the pixel without
    visibility, after Mara et al. 2016, "Deep G-Buffers for Stable Global Illumination Approximation". DEEP_MARCH: rays
    marched through the layers, then the world. MARCH_GRID: rays marched through the layers near the pixel, then through
    a grid of radiance in world space, then the world.
    """

    NONE = "NONE"
    OCCLUSION = "OCCLUSION"
    SSAO = "SSAO"
    RADIOSITY = "RADIOSITY"
    DEEP_MARCH = "DEEP_MARCH"
    MARCH_GRID = "MARCH_GRID"


RAY_METHODS = frozenset({IndirectMethod.DEEP_MARCH, IndirectMethod.MARCH_GRID})
"""Methods that send rays."""

BOUNCING_METHODS = RAY_METHODS | {IndirectMethod.RADIOSITY}
"""Methods that find light which surfaces reflect."""

WORLD_METHODS = RAY_METHODS | {IndirectMethod.OCCLUSION, IndirectMethod.SSAO}
"""Methods that find the world's diffuse light themselves; with the others it is sampled as direct light."""


@dataclass(frozen=True)
class IndirectSettings:
    """Numbers of the indirect light of one view.

    `bounces` ≥ 1 between a light's first reflection and the surface that is seen, None for all there are.
    `divisor` 1, 2 or 4: pixels along each side of those that share one gathered irradiance. `rays` per gathered pixel
    and sample. `taps` per gathered pixel (OCCLUSION, SSAO, RADIOSITY) within `radius` (m).
    `march_steps` of a ray through the layers, `march_distance` (m) its length, 0 for no limit: DEEP_MARCH.
    `contact_steps` of a ray through the layers before it goes on through the grid, 0 for none: MARCH_GRID.
    `exit_surfaces`: whether marched rays know where solids end.
    `cell_size` (m) of the grid's finest level, 0 for what suits the view: `cells` along the longest side of what is
    seen. `cell_rays`: rays by which light bounces from cell to cell. `grid_memory` (MiB): limit of all levels.
    `spatial_filter`: smooth noise between pixels that see the same surface; `temporal_filter`: between a viewport's
    views. `paper_composite`: RADIOSITY as its authors show it, which is not energy-correct.
    """

    method: IndirectMethod = IndirectMethod.NONE
    bounces: int | None = 4
    divisor: int = 2
    rays: int = 8
    taps: int = 19
    radius: float = 1.0
    march_steps: int = 32
    march_distance: float = 0.0
    contact_steps: int = 4
    exit_surfaces: bool = False
    cell_size: float = 0.0
    cells: int = 64
    cell_rays: int = 32
    grid_memory: int = 512
    spatial_filter: bool = True
    temporal_filter: bool = True
    paper_composite: bool = False


DIRECT_ONLY = IndirectSettings()
