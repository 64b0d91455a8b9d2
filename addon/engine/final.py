# SPDX-License-Identifier: GPL-3.0-or-later
"""A final render of one view layer: read its frames, render on the GL thread, refine Blender's result meanwhile."""

import time
from concurrent.futures import CancelledError
from contextlib import suppress
from typing import Any

import bpy

from ..render import Device, LayerImages, Plan, Renderer, frames_before
from ..scene import Channel, Moment, Sequence
from ..scene.arrays import Float32Array
from . import frames, gl_jobs, limits, messages, passes, regions, settings
from .sessions import FinalSession
from .statistics import Measured

FIRST_REFRESH_SECONDS = 0.5
"""Refreshing the picture costs a read-back, so the time to the next one doubles each time."""


class FinalRender:
    """One view layer of one frame on its way into Blender's render result."""

    def __init__(self, engine: bpy.types.RenderEngine, session: FinalSession) -> None:
        self.measured = Measured()
        self.frames = frames.Frames()
        self.layers: tuple[LayerImages, ...] = ()
        self._engine = engine
        self._session = session
        self._start = time.perf_counter()

    def run(self, depsgraph: Any, samples: int | None = None) -> bool:
        """Render the view layer that `depsgraph` evaluates.

        `measured`, `frames` and `layers` are filled when it returns. `samples` overrides the scene's number. Returns
        False where the user cancelled before there was a picture; a render cancelled later keeps the samples it has.
        Raises EngineError, DeviceError, RenderError or ShaderError where there can be no picture.
        """
        engine = self._engine
        result = engine.begin_result(0, 0, engine.resolution_x, engine.resolution_y, layer=depsgraph.view_layer.name)
        finished = False
        try:
            wanted = passes.requested(depsgraph.view_layer)
            width, height = result.resolution_x, result.resolution_y
            border = regions.final_border(depsgraph.scene.render, engine, width, height)
            how = settings.final(depsgraph.scene, width, height, passes.channels(wanted), samples)
            with suppress(CancelledError):
                self._read(depsgraph, frames_before(how.render))
                now = self.frames.current.moment(border)
                if now is None:
                    raise messages.EngineError(messages.no_camera(depsgraph.scene.name))
                finished = self._render(now, self.frames.sequence(border), how, result, wanted)
        finally:
            engine.end_result(result, cancel=not finished)
        self.measured.total_s = self._elapsed()
        return finished

    def _elapsed(self) -> float:
        return time.perf_counter() - self._start

    def _read(self, depsgraph: Any, before: int) -> None:
        """Read the frame to render and those before it that it needs."""
        self._engine.update_stats("", "Reading the scene")
        mirror = self._session.mirror
        self.frames = frames.read(self._engine, depsgraph, mirror, before, self._engine.test_break)
        self.measured.sync_s = self._elapsed()
        self.measured.warnings = self.frames.current.warnings

    def _render(
        self,
        now: Moment,
        sequence: Sequence,
        how: settings.FinalSettings,
        result: bpy.types.RenderResult,
        wanted: tuple[passes.OutputPass, ...],
    ) -> bool:
        """Whether `result` holds a picture. Raises CancelledError where it was cancelled before the first sample."""
        self._engine.update_stats("", "Uploading the scene")

        def begin(device: Device) -> tuple[Renderer, Plan]:
            renderer = self._session.renderer_on(device)
            return renderer, renderer.begin(now.scene, now.camera, how.render, sequence)

        renderer, plan = gl_jobs.run(begin, self._engine.test_break)
        with suppress(CancelledError):
            self._accumulate(renderer, how, result, wanted)
        if not self.measured.sample_times:
            return False
        self._write(renderer, result, wanted)
        self.measured.renderer = gl_jobs.finish(lambda _device: renderer.statistics())
        self.measured.warnings += self.measured.renderer.warnings
        if how.render.deep_output:
            self.layers = gl_jobs.finish(lambda _device: tuple(map(renderer.read_layer, range(plan.layers))))
        return True

    def _accumulate(
        self,
        renderer: Renderer,
        how: settings.FinalSettings,
        result: bpy.types.RenderResult,
        wanted: tuple[passes.OutputPass, ...],
    ) -> None:
        """Render samples until a limit is reached, showing some on the way."""

        def sample(device: Device) -> int:
            done = renderer.render_sample()
            device.context.finish()
            return done

        def picture() -> Float32Array:
            return gl_jobs.finish(lambda _device: renderer.read(Channel.COMBINED))

        refresh_at, interval = 0.0, FIRST_REFRESH_SECONDS
        total, until = how.render.samples, limits.Limits(how)
        while not self.measured.ended_by:
            start = time.perf_counter()
            done = gl_jobs.run(sample, self._engine.test_break)
            self.measured.sample_times.append(time.perf_counter() - start)
            self.measured.ended_by = until.reached(done, self._elapsed(), picture)
            self._engine.update_progress(done / total)
            self._engine.update_stats("", messages.progress(done, total, until.noise, self.measured.ended_by))
            if not self.measured.ended_by and self._elapsed() >= refresh_at:
                self._write(renderer, result, wanted[:1])
                self._engine.update_result(result)
                refresh_at, interval = self._elapsed() + interval, 2.0 * interval

    def _write(self, renderer: Renderer, result: bpy.types.RenderResult, wanted: tuple[passes.OutputPass, ...]) -> None:
        """Put the samples so far into `result`."""

        def read(_device: Device) -> dict[Channel, Float32Array]:
            return {channel: renderer.read(channel) for channel in passes.channels(wanted)}

        passes.write(result, passes.images(wanted, gl_jobs.finish(read)))
        self.measured.first_picture_s = self.measured.first_picture_s or self._elapsed()
