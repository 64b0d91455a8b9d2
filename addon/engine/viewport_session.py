# SPDX-License-Identifier: GPL-3.0-or-later
"""One viewport's renderer: one sample per GL job, job after job until the view is finished. Knows nothing of Blender.

Several viewports and a final render take turns, because each job queues behind the others'.
"""

import logging
import threading
import time
from concurrent.futures import Future
from dataclasses import dataclass

from ..render import Device, DeviceError, GLThread, Plan, Renderer, RenderError, ShaderError, gl_thread
from ..scene import Camera, Channel, Moment, RenderSettings, Scene, Sequence, Variant
from ..scene.arrays import Float32Array
from . import messages

logger = logging.getLogger(__name__)

READ_SECONDS = 0.1
"""Shortest time between two read-backs, but for the first samples of a view, which are all shown."""

ALWAYS_SHOWN = 2

GUIDED_BY_HISTORY = frozenset({Variant.PREVIOUS, Variant.PREDICT, Variant.REPROJECT})
"""Variants whose pictures of anything that moves are approximate."""


@dataclass(frozen=True)
class View:
    """What a viewport is to show."""

    scene: Scene
    camera: Camera
    settings: RenderSettings

    @property
    def moment(self) -> Moment:
        """The scene and the camera that sees it."""
        return Moment(self.scene, self.camera)


@dataclass(frozen=True)
class Begun:
    """The view that the renderer draws, by which plan, after which view, and the one that it looks ahead to."""

    view: View
    plan: Plan
    after: View | None
    ahead: View | None

    @property
    def approximate(self) -> bool:
        """Whether its first picture is guided by one of another view."""
        return self.plan.variant in GUIDED_BY_HISTORY and self.after is not None and self.after is not self.view

    def step_towards(self, newest: View) -> "Step | None":
        """What to begin next; None to go on with what is begun.

        With Delay, a picture draws the depth that the next one needs. So the view that is shown is drawn again when
        a newer one becomes known, looking ahead to it; a view that was looked ahead to is then never left out.
        With variants that history guides, a view is drawn again when no newer one follows: at rest they are exact.
        """
        if self.view is newest:
            return Step(newest) if self.approximate else None
        if self.plan.variant is not Variant.DELAY or self.view.settings != newest.settings:
            return Step(newest)
        if self.ahead is None:
            return Step(self.view, newest)
        return Step(self.ahead, None if self.ahead is newest else newest)


@dataclass(frozen=True)
class Step:
    """A view to begin, and the one to look ahead to from there."""

    view: View
    ahead: View | None = None


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
        self._begun: Begun | None = None
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
            if view is not None and view.settings == settings and view.moment.equals(Moment(scene, camera)):
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
        """One job: one more sample of the newest view, or of one on the way to it. Returns whether more is to come."""
        newest = self._attempted = self._view
        if newest is None:
            return False
        if self._renderer is None:
            self._renderer = Renderer(device)
        begun, self._begun = self._begun, None  # where anything fails, the last picture is no history
        begun = _proceed(self._renderer, begun, newest)
        view = begun.view
        samples = self._renderer.render_sample()
        device.context.finish()  # else a fast thread would queue samples of views long gone
        complete = samples >= view.settings.samples
        if complete or samples <= ALWAYS_SHOWN or time.monotonic() - self._read_at >= READ_SECONDS:
            self._picture = Picture(self._renderer.read(Channel.COMBINED), view, samples)
            self._revision += 1
            self._read_at = time.monotonic()
        self._begun = begun
        return begun.step_towards(newest) is not None or not complete

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


def _proceed(renderer: Renderer, last: Begun | None, newest: View) -> Begun:
    """Begin what comes next on the way to `newest`, if that is not begun already; returns what is begun then.

    The picture of the `last` view is history where the settings are the same.
    """
    if last is None:
        step = Step(newest)
    else:
        step = last.step_towards(newest)
        if step is None:
            return last
    view, ahead = step.view, step.ahead
    after = last.view if last and last.view.settings == view.settings else None
    previous, following = after.moment if after else None, ahead.moment if ahead else None
    sequence = Sequence(previous=previous, following=following, continuous=True)
    return Begun(view, renderer.begin(view.scene, view.camera, view.settings, sequence), after, ahead)


def _readable(error: BaseException) -> str:
    """What the user is told; the traceback of a fault of our own goes to the log."""
    if isinstance(error, DeviceError | RenderError | ShaderError):
        return str(error)
    logger.error("the viewport failed", exc_info=error)
    return messages.internal(error)
