# SPDX-License-Identifier: GPL-3.0-or-later
"""Driving an engine through Blender, in a process of its own: choose it, render once, say in words why it cannot."""

import importlib
import json
import os
import signal
import socket
import sys
import threading
import time
import traceback
from collections.abc import Callable
from types import FrameType
from typing import Any, NoReturn

import bpy

from .engines import Engine, assign
from .messages import INTERRUPTED, EngineMissingError, JobError, send

PROGRESS_SECONDS = 0.25
"""Least time between two texts of progress: some engines have hundreds a second."""


def message(error: Exception) -> str:
    """The text of an error without the `Error:` that Blender's operators put before each report, each report once."""
    lines = (line.removeprefix("Error: ") for line in str(error).strip().splitlines())
    return "\n".join(dict.fromkeys(lines))


def run_to_end(run: Callable[[dict[str, Any]], None]) -> NoReturn:
    """Do the job that comes as JSON after `--` on the command line, and end the process: exit code 1 where it failed.

    What `run` raises is told to the parent: JobError, ValueError, OSError and RuntimeError (Blender's) are sentences
    for a person, anything else is named by its type.
    """
    code = 1
    try:
        run(json.loads(sys.argv[sys.argv.index("--") + 1]))
        code = 0
    except (JobError, ValueError, RuntimeError, OSError) as error:
        traceback.print_exc()
        send("error", message(error))
    except Exception as error:
        traceback.print_exc()
        send("error", f"{type(error).__name__}: {error}")
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)  # Blender 4.5 may wait for ever at exit once it had a GL context of its own


def stop_on_interrupt(package: str | None) -> None:
    """Let SIGINT end this process at once, the GL thread of the add-on `package` first. Call it on the main thread.

    A thread of its own does that: while Cycles renders, no Python runs on the main thread for minutes.
    """

    def stop() -> None:
        woken.recv(1)
        if package and (started := sys.modules.get(f"{package}.render")):
            started.stop_gl_thread()
        os._exit(INTERRUPTED)

    woken, wake = socket.socketpair()
    wake.setblocking(False)
    signal.set_wakeup_fd(wake.detach(), warn_on_full_buffer=False)
    signal.signal(signal.SIGINT, _hold)
    threading.Thread(target=stop, name="Interrupt", daemon=True).start()


def _hold(_number: int, _frame: FrameType | None) -> None:
    """Keep the main thread from anything more, such as a message, while the process is about to end."""
    threading.Event().wait()


def open_scene(file: str, name: str | None = None) -> bpy.types.Scene:
    """Open a .blend and return its scene `name`, None: its current one. Raises JobError naming the file."""
    try:
        bpy.ops.wm.open_mainfile(filepath=file, load_ui=False)
    except RuntimeError as error:
        raise JobError(message(error)) from error  # Blender's text names the file
    scene = bpy.context.scene if name is None else bpy.data.scenes.get(name)
    if scene is None:
        raise JobError(f"{file} has no scene{f' {name!r}' if name else ''}.")
    return scene


def choose_engine(scene: bpy.types.Scene, engine: Engine) -> None:
    """Make `engine` the scene's. Raises EngineMissingError where this Blender has none of its identifiers."""
    for identifier in engine.identifiers:
        try:
            setattr(scene.render, "engine", identifier)  # noqa: B010, its type knows only Blender's own engines
        except TypeError:
            continue
        return
    names = " or ".join(engine.identifiers)
    raise EngineMissingError(f"This Blender ({bpy.app.version_string}) has no engine {names}.")


def set_resolution(scene: bpy.types.Scene, width: int, height: int) -> None:
    """Render pictures of this many pixels, at 100 %. Raises ValueError naming what Blender does not allow."""
    assign(scene.render, "resolution_x", str(width))
    assign(scene.render, "resolution_y", str(height))
    scene.render.resolution_percentage = 100


def choose_format(scene: bpy.types.Scene, suffix: str) -> None:
    """Multi-layer EXR in 32-bit float with every enabled pass, or PNG through the scene's view transform."""
    image = scene.render.image_settings
    multilayer = suffix == ".exr"
    if hasattr(image, "media_type"):  # from Blender 5.0
        setattr(image, "media_type", "MULTI_LAYER_IMAGE" if multilayer else "IMAGE")  # noqa: B010, not in 4.5's types
    image.file_format = "OPEN_EXR_MULTILAYER" if multilayer else "PNG"
    if multilayer:
        image.color_depth = "32"
        image.exr_codec = "ZIP"  # without loss, whatever the file had


def show_progress(tell: Callable[[str], None]) -> None:
    """Pass the engine's own status texts on to `tell`, a few a second, until another file is opened."""
    last = -PROGRESS_SECONDS

    def report(status: object, *_unused: object) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= PROGRESS_SECONDS:
            last = now
            tell(str(status))

    bpy.app.handlers.render_stats.append(report)


def render_once(scene: bpy.types.Scene) -> float:
    """Render the current frame into Blender's render result; seconds it took. Raises JobError without a picture."""
    started = time.perf_counter()
    try:
        outcome = bpy.ops.render.render(scene=scene.name) or ()
    except RuntimeError as error:  # the operator's reports, ours included
        raise JobError(message(error)) from error
    if "FINISHED" not in outcome:
        raise JobError("The render was cancelled.")
    return time.perf_counter() - started


def own_statistics(package: str, scene: bpy.types.Scene) -> dict[str, Any]:
    """What our engine, of the add-on `package`, says of the render just made.

    Raises JobError where it says nothing, so made no picture.
    """
    own = importlib.import_module(f"{package}.engine.statistics").last(scene.name)
    if own is None:
        raise JobError("The engine finished without a picture.")
    return own


def save_picture(scene: bpy.types.Scene, path: str) -> None:
    """Write Blender's render result as `choose_format` chose. Raises RuntimeError (Blender's) where it cannot be."""
    bpy.data.images["Render Result"].save_render(path, scene=scene)


def device_name(engine: str) -> str | None:
    """What Blender's own GPU engines draw with; None for others and where Blender does not say."""
    if engine not in {"EEVEE", "WORKBENCH"}:
        return None
    import gpu

    try:
        return gpu.platform.renderer_get()
    except SystemError:  # no GPU context on this thread in background
        return None
