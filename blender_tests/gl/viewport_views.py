# SPDX-License-Identifier: GPL-3.0-or-later
"""Views of a viewport that follow one another, as the temporal pass sees them."""

from dataclasses import dataclass, replace

import numpy as np
from gathered import Plane, Surfaces, frame, gathered_pixels, positions, prepare, project, see, write, write_surfaces

from addon.render import gl_thread
from addon.render.indirect_plan import (
    BLENDED_TARGET,
    GATHERED_TARGET,
    HISTORY_SURFACES,
    HISTORY_TARGETS,
    plan_filters,
)
from addon.render.passes.temporal import TemporalPass
from addon.render.readback import read_target
from addon.render.targets import TexturePool
from addon.scene import Camera, Moment, RenderSettings
from addon.scene.indirect import IndirectSettings
from blender_tests import builders

SIZE = (32, 24)
FLOOR = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))


@dataclass
class Shown:
    """One view: its camera, what that sees (of planes unless it is given), and motion (H, W, 2) since the last view."""

    camera: Camera
    planes: tuple[Plane, ...] = (FLOOR,)
    motion: np.ndarray | None = None
    surfaces: Surfaces | None = None

    def __post_init__(self):
        self.surfaces = self.surfaces or see(self.camera, *SIZE, *self.planes)


class Views:
    """A viewport as far as the pass sees it: every `show` is the first sample of a view that follows the one before."""

    def __init__(self, divisor=1):
        self.divisor, self.previous, self.scene = divisor, None, builders.scene(builders.quad("q", half=9.0))
        self.shape = tuple(-(-extent // divisor) for extent in SIZE[::-1])
        self._index, self._shown, self._poisoned = 0, None, False
        indirect = IndirectSettings(divisor=divisor)
        self._planned = plan_filters(
            RenderSettings(*SIZE, indirect=indirect), GATHERED_TARGET, [], blends=True, filters=True
        )

        def job(device):
            self._device, self._pool, self._pass = device, TexturePool(device), TemporalPass(device)
            prepare(self._pool, self._planned[:1], SIZE, divisor)
            for target in self._planned[0].writes:
                write(self._pool, target.name, np.zeros((*self.shape, 4), np.float32))

        gl_thread().submit(job).result()

    def show(self, shown, gathered, *, continuous=True, previous="last"):
        """Blend the first sample of a view."""
        self._index, self._shown = 0, shown
        if previous == "last":
            previous = self.previous
        moment = Moment(self.scene, shown.camera)
        result = self._run(gathered, previous, continuous)
        self.previous = moment
        return result

    def refine(self, gathered, planes=None):
        """Blend one more sample of the view, which may see other planes where it looks."""
        self._index += 1
        if planes:
            self._shown = Shown(self._shown.camera, planes)
        return self._run(gathered, self.previous, True)

    def _run(self, gathered, previous, continuous):
        shown = self._shown

        def job(device):
            motion = np.zeros((*SIZE[::-1], 2)) if shown.motion is None else shown.motion
            write_surfaces(self._pool, shown.surfaces, motion)
            write(self._pool, GATHERED_TARGET, gathered.astype(np.float32))
            values = frame(
                device,
                self._pool,
                shown.camera,
                self.divisor,
                self._index,
                previous=previous,
                continuous=continuous,
                scene=self.scene,
            )
            self._pass.run(values, self._planned[0])
            assert device.context.error == "GL_NO_ERROR"
            for target in self._planned[0].writes:
                assert self._poisoned or np.isfinite(read_target(self._pool, target.name)).all(), target.name
            return read_target(self._pool, BLENDED_TARGET)[0]

        return gl_thread().submit(job).result()

    def poison(self, value, names=(*HISTORY_TARGETS, *HISTORY_SURFACES), components=slice(None)):
        """Overwrite what is kept from view to view, or some of it."""

        self._poisoned = True

        def job(_device):
            for name in names:
                kept = read_target(self._pool, name)[0]
                kept[..., components] = value
                write(self._pool, name, kept)

        gl_thread().submit(job).result()

    def reallocate(self):
        """Have the pool make new textures, as another size in between does; they happen to hold what the old did."""

        def job(_device):
            names = (*HISTORY_TARGETS, *HISTORY_SURFACES)
            kept = [self._pool.read(name) for name in names]
            self._pool.release()
            prepare(self._pool, self._planned[:1], SIZE, self.divisor)
            for name, data in zip(names, kept, strict=True):
                self._pool.texture(name).write(data, alignment=1)

        gl_thread().submit(job).result()

    def release(self):
        """Free the pass and its targets."""

        def job(_device):
            self._pass.release()
            self._pool.release()

        gl_thread().submit(job).result()


def texels(shown, divisor):
    """World-space positions (H, W, 3) of what the gathered texels look at, and whether they see anything."""
    seen = shown.surfaces
    chosen = np.ix_(*gathered_pixels(*SIZE, divisor))
    return positions(shown.camera, seen.depth)[chosen], np.isfinite(seen.depth)[chosen]


def moved(now, before):
    """The view `now` with the motion of a scene at rest since the view `before`."""
    seen = now.surfaces
    points = np.where(np.isfinite(seen.depth)[..., None], positions(now.camera, seen.depth), 0.0)
    motion = project(now.camera, points, *SIZE) - project(before.camera, points, *SIZE)
    return replace(now, motion=motion)


def shifted(camera, x=0.0, y=0.0, z=0.0):
    """A camera moved by metres along its axes."""
    matrix = camera.world_from_camera.copy()
    matrix[:3, 3] += camera.rotation @ (x, y, z)
    return replace(camera, world_from_camera=matrix)


def turned(camera, angle):
    """A camera turned about its vertical axis, rad."""
    matrix = camera.world_from_camera.copy()
    cosine, sine = np.cos(angle), np.sin(angle)
    matrix[:3, :3] = camera.rotation @ [[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]]
    return replace(camera, world_from_camera=matrix)
