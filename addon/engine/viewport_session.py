# SPDX-License-Identifier: GPL-3.0-or-later
"""One viewport's renderer: one sample per GL job, job after job until the view is finished. Knows nothing of Blender.

Several viewports and a final render take turns, because each job queues behind the others'.
"""

import logging
import threading
import time
from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np

from ..render import Device, DeviceError, GLThread, Renderer, RenderError, ShaderError, gl_thread
from ..scene import Camera, Channel, RenderSettings, Scene
from ..scene.arrays import Float32Array
from . import messages

logger = logging.getLogger(__name__)

READ_SECONDS = 0.1
"""Shortest time between two read-backs, but for the first samples of a view, which are all shown."""

ALWAYS_SHOWN = 2


@dataclass(frozen=True)
class View:
    """What a viewport is to show."""

    scene: Scene
    camera: Camera
    settings: RenderSettings


@dataclass(frozen=True)
class Picture:
    """A finished image: `pixels` (H, W, 4) float32 premultiplied, row 0 at the bottom, of `samples` samples."""

    pixels: Float32Array
    view: View
    samples: int

    @property
    def complete(self) -> bool:
        """Whether no more samples will come for its view."""
        return self.samples >= self.view.settings.samples


def same_camera(first: Camera, second: Camera) -> bool:
    """Whether two cameras make the same picture."""
    return np.array_equal(first.world_from_camera, second.world_from_camera) and (
        first.window,
        first.clip_start,
        first.clip_end,
        first.orthographic,
    ) == (second.window, second.clip_start, second.clip_end, second.orthographic)


class ViewportSession:
    """Blender's thread calls `show` and `close` and reads `picture` and `error`; jobs run on the GL thread."""

    def __init__(self) -> None:
        self._lock = threading.RLock()  # a future that is done already calls `_rendered` from within `_queue`
        self._view: View | None = None
        self._picture: Picture | None = None
        self._error: str | None = None
        self._revision = 0
        self._queued = False
        self._closed = False
        self._thread: GLThread
        # Only the GL thread touches these.
        self._renderer: Renderer | None = None
        self._begun: View | None = None
        self._attempted: View | None = None
        self._read_at = 0.0

    @property
    def picture(self) -> Picture | None:
        """The newest finished picture, maybe of an earlier view."""
        return self._picture

    @property
    def error(self) -> str | None:
        """Why the current view cannot be shown, or None."""
        return self._error

    @property
    def busy(self) -> bool:
        """Whether a newer picture is on its way."""
        return self._queued

    @property
    def revision(self) -> int:
        """Raised whenever there is a newer picture or error to paint."""
        return self._revision

    def show(self, scene: Scene, camera: Camera, settings: RenderSettings) -> None:
        """Render this view from now on; where it is what is already shown, go on refining. Never waits."""
        with self._lock:
            view = self._view
            if (
                view is not None
                and view.scene is scene
                and view.settings == settings
                and same_camera(view.camera, camera)
            ):
                return
            self._view = View(scene, camera, settings)
            self._error = None
            self._queue(gl_thread())

    def close(self) -> None:
        """Stop refining and free the GPU data once the job under way is done. Never waits."""
        with self._lock:
            self._closed = True
            self._view = None
            if self._renderer is not None or self._queued:
                gl_thread().submit(self._release)

    def _queue(self, thread: GLThread) -> None:
        """Have the next job run on `thread`, unless it is queued already. Call with the lock held."""
        if not self._queued and not self._closed:
            self._queued = True
            self._thread = thread
            thread.submit(self._render).add_done_callback(self._rendered)

    def _render(self, device: Device) -> bool:
        """One job: one more sample of the newest view. Returns whether it needs more."""
        view = self._attempted = self._view
        if view is None:
            return False
        if self._renderer is None:
            self._renderer = Renderer(device)
        if view is not self._begun:
            self._begun = None
            self._renderer.begin(view.scene, view.camera, view.settings)
            self._begun = view
        samples = self._renderer.render_sample()
        device.context.finish()  # else a fast thread would queue samples of views long gone
        complete = samples >= view.settings.samples
        if complete or samples <= ALWAYS_SHOWN or time.monotonic() - self._read_at >= READ_SECONDS:
            self._picture = Picture(self._renderer.read(Channel.COMBINED), view, samples)
            self._revision += 1
            self._read_at = time.monotonic()
        return not complete

    def _rendered(self, future: "Future[bool]") -> None:
        """Go on with the next sample or the next view; runs on the GL thread."""
        with self._lock:
            self._queued = False
            if future.cancelled():  # the GL thread was stopped, and the renderer's context with it
                self._view = self._begun = self._renderer = None
                return
            if self._closed:
                return
            error = future.exception()
            newer = self._view is not self._attempted
            if isinstance(error, DeviceError) or (error is not None and not newer):
                self._error = _readable(error)
                self._revision += 1
            elif newer or future.result():
                self._queue(self._thread)  # not `gl_thread()`: one that is being stopped must not be started again

    def _release(self, _device: Device) -> None:
        if self._renderer is not None:
            self._renderer.release()
            self._renderer = None


def _readable(error: BaseException) -> str:
    """What the user is told; the traceback of a fault of our own goes to the log."""
    if isinstance(error, DeviceError | RenderError | ShaderError):
        return str(error)
    logger.error("the viewport failed", exc_info=error)
    return messages.internal(error)
