# SPDX-License-Identifier: GPL-3.0-or-later
"""The radiance grid: which surfaces are where in the world, and what light they send."""

from collections.abc import Hashable, Iterator
from itertools import chain

import numpy as np

from ...scene import Scene
from ...scene.arrays import Float64Array
from ..casters import batch_bounds
from ..device import Device
from ..draws import SceneDraws
from ..grid.fill import GridFill, fill_variants
from ..grid.levels import GridLevel, cell_size, grid_levels
from ..grid.radiance import GridRadiance, radiance_variants
from ..grid.textures import GridTextures
from ..layout import DEPTH_TILES_TARGET, TILE_SIZE
from ..planned_pass import PlannedPass
from ..programs import ProgramSpec
from ..readback import read_target
from ..receivers import visible_receivers
from .base import Frame

_SEEN_SHARE = 0.8
"""Share of the picture whose depth decides how fine the cells are: what is farther may be any distance away."""


class RadianceGridPass:
    """Fills, lights and bounces; each only where what it depends on changed."""

    name = "radiance_grid"

    def __init__(self, device: Device) -> None:
        self._fill = GridFill(device)
        self._radiance = GridRadiance(device)
        self._grid: GridTextures | None = None
        self._levels: tuple[GridLevel, ...] = ()
        self._filled: Hashable = None
        self._lit: tuple[object, ...] = ()
        self._begun = False

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """What fills it, and what lights it."""
        yield from chain(fill_variants(), radiance_variants())

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """A new view begins: where its grid must be is found with its first sample."""
        self._begun = False

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Have the grid as this sample needs it."""
        if not self._begun:
            self._levels = _levels(frame)
            self._begun = True
        filled = _contents(frame, self._levels)
        lit = (frame.scene.lights, frame.scene.world, frame.settings.indirect)
        if self._grid is None or self._filled != filled:
            self._release_grid()
            self._grid, self._filled = self._fill.fill(frame, self._levels), filled
            self._radiance.link(frame, self._grid)
            self._lit = ()
        if not _same(self._lit, lit):
            self._radiance.light(frame, self._grid)
            self._radiance.meet_first(frame, self._grid)
            self._radiance.bounce(frame, self._grid)
            self._lit = lit
        frame.grid = self._grid

    def release(self) -> None:
        """Free the grid and what it is made with."""
        self._release_grid()
        self._fill.release()
        self._radiance.release()

    def _release_grid(self) -> None:
        if self._grid is not None:
            self._grid.release()
        self._grid = None


def _levels(frame: Frame) -> tuple[GridLevel, ...]:
    """Where the grid is, by what the camera sees and where the scene is."""
    indirect = frame.settings.indirect
    bounds = scene_bounds(frame.scene)
    seen = _seen_box(frame)
    if seen is None:
        seen = bounds
    cell = indirect.cell_size or cell_size(seen, indirect.cells)
    return grid_levels(bounds, seen.mean(axis=0), cell, indirect.cells, indirect.grid_memory << 20)


def _seen_box(frame: Frame) -> Float64Array | None:
    """(2, 3) box in world space of the nearer part of what the camera sees; None where it sees nothing."""
    tiles = read_target(frame.pool, DEPTH_TILES_TARGET)[:1]
    seen = visible_receivers(tiles, TILE_SIZE, frame.view, frame.pool.size, 0.0)
    if seen.count == 0:
        return None
    corners = seen.between(0.0, float(np.quantile(seen.far, _SEEN_SHARE))).corners.reshape(-1, 3)
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def scene_bounds(scene: Scene) -> Float64Array:
    """(2, 3) lowest and highest corner of everything, world space."""
    boxes = [batch_bounds(scene.meshes[batch.mesh], batch) for batch in scene.batches if batch.count]
    if not boxes:
        return np.zeros((2, 3))
    return np.stack([np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)])


def _contents(frame: Frame, levels: tuple[GridLevel, ...]) -> Hashable:
    """Equal where the grid holds the same surfaces."""
    draws: SceneDraws = frame.draws.of(frame.scene)
    scene = frame.scene
    surfaces = tuple(
        (draw.batch.key, draw.batch.version, draw.batch.mesh, scene.meshes[draw.batch.mesh].version, draw.first_index)
        for draw in draws.draws
    )
    materials = tuple((material.key, material.version) for material in scene.materials.values())
    images = tuple((image.key, image.version) for image in scene.images.values())
    sampled = tuple((light.key, light.front, light.back) for light in frame.plan.lights.mesh_lights)
    indirect = frame.settings.indirect
    return levels, surfaces, materials, images, sampled, indirect.cell_rays, frame.plan.indirect.world_gathered


def _same(one: tuple[object, ...], other: tuple[object, ...]) -> bool:
    """Whether these are the very same objects."""
    return len(one) == len(other) and all(a is b for a, b in zip(one, other, strict=True))
