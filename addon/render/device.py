# SPDX-License-Identifier: GPL-3.0-or-later
"""The one thread that owns the OpenGL context; everybody else submits jobs to it.

A standalone context on Blender's own threads would fight with Blender's context, silently under GLX; on a thread
of its own it works in every Blender version and beside the Vulkan back end.
"""

import atexit
import queue
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

import moderngl

from ..scene import Layering
from .ggx_albedo import ggx_albedo_table
from .ltc import ltc_table
from .programs import ProgramLibrary
from .raw_gl import RawGL, vertex_layer_extension

T = TypeVar("T")

REQUIRED_VERSION = 410


class DeviceError(RuntimeError):
    """There is no usable OpenGL; the message says what is missing and what to install."""


class RenderError(RuntimeError):
    """The picture cannot be rendered with these settings; the message says what is too large and what to change."""


class Device:
    """An OpenGL ≥ 4.10 core context and what is shared by every view: its programs, tables and limits.

    `subpixel`: pixels between the places that vertices snap to.
    """

    def __init__(self) -> None:
        self.context = _create_context()
        self.raw = RawGL(self.context)
        self.no_framebuffer = self.context.detect_framebuffer(0)
        self.zero_to_one_depth = self.raw.set_clip_space(zero_to_one=True)
        self.programs = ProgramLibrary(self.context)
        table = ggx_albedo_table()
        self.ggx_albedo = self.context.texture3d(table.shape[2::-1], 4, table, dtype="f4")
        self.ggx_albedo.repeat_x = self.ggx_albedo.repeat_y = self.ggx_albedo.repeat_z = False
        transforms = ltc_table()
        self.ltc = self.context.texture(transforms.shape[1::-1], 4, transforms, dtype="f4")
        self.ltc.repeat_x = self.ltc.repeat_y = False
        self.name = f"{self.context.info['GL_RENDERER']}, OpenGL {self.context.info['GL_VERSION']}"
        self.maximum_size = min(self.context.info["GL_MAX_TEXTURE_SIZE"], *self.context.info["GL_MAX_VIEWPORT_DIMS"])
        self.is_software = any(word in self.name.lower() for word in ("llvmpipe", "softpipe", "swrast", "swiftshader"))
        self.vertex_layer_extension = vertex_layer_extension(self.context)
        self.fastest_layering: Layering | None = None
        self.idle_queries: list[moderngl.Query] = []
        self.subpixel = 2.0 ** -self.context.info["GL_SUBPIXEL_BITS"]
        self.uniform_alignment: int = self.context.info["GL_UNIFORM_BUFFER_OFFSET_ALIGNMENT"]

    def out_of_memory(self) -> bool:
        """Whether the driver refused memory since this was last asked."""
        return self.context.error == "GL_OUT_OF_MEMORY"

    def check_upload(self, item: str, size: int) -> None:
        """Raise RenderError naming `item` (its kind and name) of `size` bytes where the driver had no memory for it."""
        if self.out_of_memory():
            raise RenderError(f"Out of graphics memory for {item} ({size / 2**20:.0f} MiB).")

    def release(self) -> None:
        """Free the shared objects and the context."""
        self.ltc.release()
        self.ggx_albedo.release()
        self.programs.release()
        self.context.release()


def _create_context() -> moderngl.Context:
    backends: tuple[dict[str, Any], ...] = ({"backend": "egl"}, {}) if sys.platform.startswith("linux") else ({},)
    failures: list[str] = []
    for backend in backends:
        try:
            context = moderngl.create_context(standalone=True, require=REQUIRED_VERSION, **backend)
        except Exception as error:  # moderngl and glcontext raise bare Exception for every cause
            failures.append(f"{backend.get('backend', 'default')}: {error}")
            continue
        if context.version_code >= REQUIRED_VERSION:
            return context
        failures.append(f"{backend.get('backend', 'default')}: OpenGL {context.version_code / 100:.1f}")
        context.release()
    raise DeviceError(
        "Deep G-Buffer needs OpenGL 4.1 or newer and found none "
        f"({'; '.join(failures)}). Install your graphics card's driver; on a machine without one, "
        "install Mesa's software driver (Debian/Ubuntu: apt-get install libegl1 libgl1-mesa-dri)."
    )


class GLThread:
    """Runs jobs one after another on a thread that owns the context. The context is made by the first job."""

    def __init__(self) -> None:
        self._jobs: queue.SimpleQueue[tuple[Callable[[Device], Any], Future[Any]] | None] = queue.SimpleQueue()
        self._stopping = False
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="GLThread", daemon=True)
        self._thread.start()

    def submit(self, job: Callable[[Device], T]) -> "Future[T]":
        """Queue a job; its result or exception (DeviceError where there is no OpenGL) is in the future."""
        future: Future[T] = Future()
        with self._lock:
            if self._stopping:
                future.cancel()
            else:
                self._jobs.put((job, future))
        return future

    def stop(self) -> None:
        """Let the job under way finish, cancel the queued ones, free the context and end the thread."""
        with self._lock:
            self._stopping = True
            self._jobs.put(None)
        self._thread.join()

    @property
    def alive(self) -> bool:
        """Whether the thread still takes jobs."""
        return not self._stopping

    def _run(self) -> None:
        device: Device | None = None
        while (item := self._jobs.get()) is not None:
            job, future = item
            if self._stopping:
                future.cancel()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                if device is None:
                    device = Device()
                future.set_result(job(device))
            except BaseException as error:
                future.set_exception(error)
            # The last job's closure may hold GPU objects: let it go before waiting for the next.
            del item, job, future
        if device is not None:
            device.release()


_thread_lock = threading.Lock()
_thread: GLThread | None = None


def gl_thread() -> GLThread:
    """The process's GL thread, started on first use."""
    global _thread  # noqa: PLW0603 - one context per process is the point
    with _thread_lock:
        if _thread is None or not _thread.alive:
            _thread = GLThread()
            atexit.register(stop_gl_thread)
        return _thread


def stop_gl_thread() -> None:
    """Stop the GL thread if it runs; a later `gl_thread()` starts a new one."""
    global _thread
    with _thread_lock:
        thread, _thread = _thread, None
        atexit.unregister(stop_gl_thread)
    if thread is not None:
        thread.stop()
