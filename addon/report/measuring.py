# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders of one file, timed: engines and settings one after the other in one process, each from the file as it is."""

import importlib
import itertools
import os
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import addon_utils
import bpy

from . import rendering
from .engines import ENGINES, assign
from .messages import EngineMissingError, JobError, send
from .sweep import OURS, PERCENT

CHECKOUT = "addon"
"""Our package where it is no installed extension."""


def run(job: dict[str, Any]) -> None:
    """Do a job and tell the parent what comes of it. Raises JobError where the file cannot be opened.

    A job has
      file, scene          of that name, None: the file's current one
      frames               None: the file's current one
      resolution           (width, height) in pixels, None: the file's
      folder               where pictures go
      package              of our own add-on
      renders              each {name, engine: of ENGINES, settings: {property: text}, warm_seconds}
    and tells
      opened    {frame, resolution, blender}: the file's current frame, the pictures' size, Blender's version
      progress  {name, text}
      picture   {name, frame, path}: a multi-layer EXR in 32-bit float of the last render of that frame
      done      {name, cold_s, warm_s, warnings, left_out, files, blender, device}, see `measure`
      failed    {name, reason, engine_missing}: that render has no picture; the others are made all the same
    """
    package = job["package"]
    trouble = enable(package) if any(render["engine"] == OURS for render in job["renders"]) else ""
    rendering.stop_on_interrupt(package)
    scene = open_scene(job)
    send("opened", {"frame": scene.frame_current, "resolution": size(scene), "blender": bpy.app.version_string})
    for index, render in enumerate(job["renders"]):
        if index:
            scene = open_scene(job)
        try:
            if render["engine"] == OURS and trouble:
                raise JobError(trouble)
            send("done", measure(scene, job, index))
        except (JobError, ValueError, RuntimeError, OSError) as error:
            traceback.print_exc()
            is_missing = isinstance(error, EngineMissingError)
            send("failed", {"name": render["name"], "reason": rendering.message(error), "engine_missing": is_missing})


def enable(package: str) -> str:
    """Register our add-on for this process alone, where it is not yet; why that failed, "" where it did not."""
    problems: list[str] = []

    def failed(error: Exception) -> None:
        problems.append(str(error))

    if package == CHECKOUT:
        importlib.import_module(package).register()
    elif not addon_utils.check(package)[1]:
        addon_utils.enable(package, persistent=True, handle_error=failed)  # pyright: ignore[reportArgumentType]
    return f"The add-on {package} could not be enabled: {problems[0]}" if problems else ""


def open_scene(job: dict[str, Any]) -> bpy.types.Scene:
    """The job's scene as it is in the file, but for the job's resolution. Raises JobError naming the file."""
    scene = rendering.open_scene(job["file"], job["scene"])
    if job["resolution"]:
        rendering.set_resolution(scene, *job["resolution"])
    return scene


def size(scene: bpy.types.Scene) -> tuple[int, int]:
    """Width and height of the scene's pictures in pixels, as Blender rounds them."""
    percent = scene.render.resolution_percentage
    return scene.render.resolution_x * percent // 100, scene.render.resolution_y * percent // 100


def measure(scene: bpy.types.Scene, job: dict[str, Any], index: int) -> dict[str, Any]:
    """Make the render `index` of `job`, tell of its pictures, and return its times and what our engine said of it.

    `cold_s`: seconds of the first render, in a process that rendered nothing before only where `index` is 0.
    `warm_s`: of each later one. `left_out`: pairs of name and reason. `files`: what our engine wrote of its own.
    `device`: what draws, as OpenGL calls it; None for an engine without OpenGL and where Blender does not say.
    Raises JobError, ValueError, OSError or RuntimeError (Blender's) saying why there is no picture.
    """
    render = job["renders"][index]
    name, ours = render["name"], render["engine"] == OURS
    stem = Path(job["folder"]) / f"render_{index}"
    prepare(scene, render, stem)
    rendering.show_progress(lambda text: send("progress", {"name": name, "text": text}))
    said: list[dict[str, Any]] = []
    pictures: dict[int, str] = {}

    def keep(frame: int) -> None:
        if ours:
            said.append(rendering.own_statistics(job["package"], scene))
        pictures[frame] = save(scene, Path(f"{stem}_frame_{frame}.exr"))

    cold, warm = timed(scene, job["frames"], render["warm_seconds"], keep)
    for frame, path in pictures.items():
        send("picture", {"name": name, "frame": frame, "path": path})
    left_out = {each["name"]: each["reason"] for entry in said for each in entry["left_out"]}
    return {
        "name": name,
        "cold_s": cold,
        "warm_s": warm,
        "warnings": list(dict.fromkeys(text for entry in said for text in entry["warnings"])),
        "left_out": list(left_out.items()),
        "files": list(dict.fromkeys(path for entry in said for path in entry["files"])),
        "blender": bpy.app.version_string,
        "device": said[0]["device"] if said else rendering.device_name(render["engine"]),
    }


def prepare(scene: bpy.types.Scene, render: dict[str, Any], stem: Path) -> None:
    """Give the scene the engine, settings and format of `render`; files of ours start with `stem`.

    Raises EngineMissingError where this Blender lacks the engine, ValueError naming what cannot be set.
    """
    engine = ENGINES[render["engine"]]
    rendering.choose_engine(scene, engine)
    settings = getattr(scene, engine.settings)
    if engine.layers_path:
        assign(settings, engine.layers_path, f"{stem}_")
    for name, text in render["settings"].items():
        assign(scene.render if name == PERCENT else settings, name, text)
    scene.render.use_compositing = scene.render.use_sequencer = False  # the engine's own picture, and no file outputs
    if render["warm_seconds"]:
        scene.render.use_persistent_data = True
    rendering.choose_format(scene, ".exr")


def timed(
    scene: bpy.types.Scene, frames: Sequence[int] | None, warm_seconds: float, keep: Callable[[int], None]
) -> tuple[float, list[float]]:
    """Render every frame once, then all again and again until `warm_seconds` are spent on renders after the first.

    `frames` None: the current one. Calls `keep(frame)` after each render, outside its time. Returns the seconds of the
    first render and of each later one. Raises JobError without a picture.
    """
    times: list[float] = []
    for number, frame in enumerate(itertools.cycle(frames or [scene.frame_current])):
        if number >= len(frames or [frame]) and sum(times[1:]) >= warm_seconds:
            break
        if frames:
            scene.frame_set(frame)
        times.append(rendering.render_once(scene))
        keep(frame)
    return times[0], times[1:]


def save(scene: bpy.types.Scene, path: Path) -> str:
    """Write Blender's render result to `path`, never half; its path. Raises RuntimeError or OSError."""
    draft = path.with_name(f"draft_{path.name}")
    rendering.save_picture(scene, str(draft))
    os.replace(draft, path)
    return str(path)
