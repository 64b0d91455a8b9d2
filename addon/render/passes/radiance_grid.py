# SPDX-License-Identifier: GPL-3.0-or-later
"""The radiance grid: which surfaces are where in the world, and what light they send."""

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from ...scene import Scene
from ...scene.arrays import Float64Array
from ..casters import batch_bounds
from ..device import Device
from ..grid.changes import changed_box
from ..grid.contents import GridContents, contents_key, grid_contents
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

_SAME_CELLS = 1.5
"""A viewport keeps its cells until they are so many times larger or smaller than they should be."""

_CLOSEST = 4.0
"""A camera that comes near something typical of the scene gets cells so many times finer than where it sees all."""

_SEEN_SHARE = 0.8
"""Share of the picture whose depth decides how fine the cells are: what is farther may be any distance away."""

SAMPLES_PER_LATTICE = 16
"""Samples of a film that share one grid: the next ones' cells lie elsewhere, so that what cells do to the picture
averages out. Four grids in place of one: Sponza's FLIP .073 for .077, Cornell's .046 for .047."""


class RadianceGridPass:
    """Fills, lights and bounces; each only where what it depends on changed."""

    name = "radiance_grid"

    def __init__(self, device: Device) -> None:
        self._fill = GridFill(device)
        self._radiance = GridRadiance(device)
        self._grids: dict[int, _LitGrid] = {}
        self._seen: _Seen | None = None
        self._cell: float | None = None

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """What fills it, and what lights it."""
        yield from chain(fill_variants(), radiance_variants())

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """A new view begins: where its grid must be is found with its first sample."""
        self._seen = None

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Have the grid as this sample needs it. The first lattice's is kept for the next view."""
        if self._seen is None:
            self._seen = _look(frame, self._cell if frame.continuous else None)
            self._cell = self._seen.cell
        lattice = frame.sample.index // SAMPLES_PER_LATTICE
        for other in self._grids.keys() - {0, lattice}:
            self._grids.pop(other).textures.release()
        grid = self._filled(frame, lattice, _levels(frame, self._seen, lattice))
        scene = frame.scene
        light = (scene.lights, scene.world, frame.settings.indirect.bounces, frame.plan.indirect.world_gathered)
        if len(grid.light) == 0 or not all(one is other for one, other in zip(grid.light, light, strict=True)):
            self._radiance.light(frame, grid.textures)
            self._radiance.meet_first(frame, grid.textures)
            self._radiance.bounce(frame, grid.textures)
            grid.light = light
        frame.grid = grid.textures

    def release(self) -> None:
        """Free the grids and what they are made with."""
        for grid in self._grids.values():
            grid.textures.release()
        self._grids.clear()
        self._fill.release()
        self._radiance.release()

    def _filled(self, frame: Frame, lattice: int, levels: tuple[GridLevel, ...]) -> "_LitGrid":
        """A grid of the frame's surfaces: one from before, made anew only where something changed."""
        held = self._grids.get(lattice)
        rays = frame.settings.indirect.cell_rays
        if held is not None and held.holds(contents_key(frame), levels, rays):
            return held
        contents = grid_contents(frame)
        before, changed = None, None
        if held is not None and held.textures.cell_rays == rays:
            before, changed = held.textures, changed_box(held.contents.surfaces, contents.surfaces)
            if before.levels == levels and changed is None:
                held.contents = contents
                return held
        filled = _LitGrid(self._fill.fill(frame, levels, before, changed), contents)
        self._grids[lattice] = filled
        self._radiance.link(frame, filled.textures, before, changed)
        if held is not None:
            held.textures.release()
        return filled


@dataclass
class _LitGrid:
    """A grid, what it was filled with, and what its light depends on: none where it is not lit."""

    textures: GridTextures
    contents: GridContents
    light: tuple[object, ...] = ()

    def holds(self, key: Hashable, levels: tuple[GridLevel, ...], cell_rays: int) -> bool:
        """Whether it has these surfaces in these levels, and as many rays."""
        textures = self.textures
        return self.contents.key == key and textures.levels == levels and textures.cell_rays == cell_rays


@dataclass(frozen=True)
class _Seen:
    """What a view's grid is fitted to: the box (2, 3) in world space around the scene, the middle (3,) of what is seen,
    and how large (m) the finest cells are."""

    bounds: Float64Array
    center: Float64Array
    cell: float


def _look(frame: Frame, before: float | None) -> _Seen:
    """What a view's grid is fitted to. `before` (m): cells of the view before it in a viewport."""
    boxes, indirect = scene_boxes(frame.scene), frame.settings.indirect
    bounds = np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    seen = _seen_box(frame)
    seen = bounds if seen is None else seen
    typical = float(np.median((boxes[:, 1] - boxes[:, 0]).max(axis=1)))
    cell = indirect.cell_size or max(cell_size(seen, indirect.cells), typical / (_CLOSEST * indirect.cells))
    if before is not None and not indirect.cell_size and 1.0 / _SAME_CELLS <= before / cell <= _SAME_CELLS:
        cell = before
    return _Seen(bounds, seen.mean(axis=0), cell)


def _levels(frame: Frame, seen: _Seen, lattice: int) -> tuple[GridLevel, ...]:
    """Where the grid is."""
    indirect = frame.settings.indirect
    return grid_levels(seen.bounds, seen.center, seen.cell, indirect.cells, indirect.grid_memory << 20, lattice)


def _seen_box(frame: Frame) -> Float64Array | None:
    """(2, 3) box in world space of the nearer part of what the camera sees; None where it sees nothing."""
    tiles = read_target(frame.pool, DEPTH_TILES_TARGET)[:1]
    seen = visible_receivers(tiles, TILE_SIZE, frame.view, frame.pool.size, 0.0)
    if seen.count == 0:
        return None
    corners = seen.between(0.0, float(np.quantile(seen.far, _SEEN_SHARE))).corners.reshape(-1, 3)
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def scene_boxes(scene: Scene) -> Float64Array:
    """(N, 2, 3) lowest and highest corner of all instances of each batch, world space; at least one box."""
    boxes = [batch_bounds(scene.meshes[batch.mesh], batch) for batch in scene.batches if batch.count]
    return np.array(boxes or [np.zeros((2, 3))])
