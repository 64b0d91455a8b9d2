# SPDX-License-Identifier: GPL-3.0-or-later
"""The radiance grid: which surfaces are where in the world, and what light they send."""

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from itertools import chain

from ...scene import Light, World
from ..device import Device
from ..grid.changes import NOTHING_CHANGED, changed_boxes
from ..grid.contents import GridContents, contents_key, grid_contents
from ..grid.fill import GridFill, fill_variants
from ..grid.levels import GridLevel
from ..grid.radiance import GridRadiance, radiance_variants
from ..grid.textures import GridTextures
from ..grid.view import GridFitting, GridView
from ..planned_pass import PlannedPass
from ..programs import ProgramSpec
from .base import Frame

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
        self._fitting = GridFitting()
        self._view: GridView | None = None
        self._key: Hashable = None

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """What fills it, and what lights it."""
        yield from chain(fill_variants(), radiance_variants())

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """A new view begins: where its grid must be is found with its first sample."""
        self._view = None

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Have the grid as this sample needs it. The first lattice's is kept for the next view."""
        if self._view is None:
            self._view = self._fitting.fit(frame)
            self._key = contents_key(frame)
        lattice = frame.sample.index // SAMPLES_PER_LATTICE
        for other in self._grids.keys() - {0, lattice}:
            self._grids.pop(other).textures.release()
        grid = self._filled(frame, lattice, self._view.levels(frame.settings.indirect, lattice))
        light = _GridLight.of(frame)
        if grid.light is None or not grid.light.is_same(light):
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
        """A grid of the frame's surfaces: one from before, made anew only where something changed.

        Points lie otherwise where levels are elsewhere, so that cells kept there differ a little from new ones: enough
        for a viewport, but a film's frame is the same whatever was rendered before.
        """
        held, rays = self._grids.get(lattice), frame.settings.indirect.cell_rays
        if held is not None and held.holds(self._key, levels, rays):
            return held
        contents = grid_contents(frame)
        before, changed = None, NOTHING_CHANGED
        if held is not None and held.textures.cell_rays == rays:
            same_levels = held.textures.levels == levels
            changed = changed_boxes(held.contents.surfaces, contents.surfaces)
            if same_levels and len(changed) == 0:
                held.contents = contents
                return held
            if same_levels or frame.continuous:
                before = held.textures
        filled = _LitGrid(self._fill.fill(frame, levels, before, changed), contents)
        try:
            self._radiance.link(frame, filled.textures, before, changed)
        except BaseException:
            filled.textures.release()
            raise
        self._grids[lattice] = filled
        if held is not None:
            held.textures.release()
        return filled


@dataclass
class _LitGrid:
    """A grid, what it was filled with, and what its light was found from: None where it is not lit."""

    textures: GridTextures
    contents: GridContents
    light: "_GridLight | None" = None

    def holds(self, key: Hashable, levels: tuple[GridLevel, ...], cell_rays: int) -> bool:
        """Whether it has these surfaces in these levels, and as many rays."""
        textures = self.textures
        return self.contents.key == key and textures.levels == levels and textures.cell_rays == cell_rays


@dataclass(frozen=True)
class _GridLight:
    """What the light of a grid depends on beside its surfaces."""

    lights: tuple[Light, ...]
    world: World
    settings: Hashable

    @classmethod
    def of(cls, frame: Frame) -> "_GridLight":
        """That of a frame."""
        settings, scene = frame.settings, frame.scene
        numbers = settings.indirect.bounces, settings.shadow_map_size, frame.plan.indirect.world_gathered
        return cls(scene.lights, scene.world, numbers)

    def is_same(self, other: "_GridLight") -> bool:
        """Whether nothing differs; what is equal is one object from scene to scene."""
        return self.lights is other.lights and self.world is other.world and self.settings == other.settings
