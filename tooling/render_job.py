# SPDX-License-Identifier: GPL-3.0-or-later
"""Render a .blend; runs inside Blender, as a program in its Python module or as a `--python` script.

The job comes as JSON after `--`; what happens goes to stdout as lines of JSON that start with MARK, everything else
there is Blender's own. Pictures are written into the job's scratch folder; `tooling.rendering` puts them in place.
"""

import importlib
import json
import os
import signal
import sys
import time
import traceback
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

sys.path.append(str(Path(__file__).resolve().parent.parent))

import bpy

from tooling.console import INTERRUPTED, MARK
from addon.report.engines import ENGINES, Engine, assign

EXTENSION_REPOSITORY = "user_default"
BESIDE_THE_BLEND = "//"  # where our layer files go unless the file says otherwise
# Measured by our engine only; the others' are null.
STATISTICS = (
    *("sync_s", "upload_s", "first_picture_s", "sample_s", "total_s", "samples", "passes", "left_out"),
    *("triangles", "draws", "instances", "bytes", "warnings", "files", "engine", "device", "blender"),
)


class JobError(RuntimeError):
    """A reason why there is no picture; its text is the whole message."""


def send(kind: str, content: object) -> None:
    """Tell the parent something."""
    print(MARK + json.dumps({"kind": kind, "content": content}), flush=True)


def message(error: Exception) -> str:
    """The text of an error without the `Error:` that Blender's operators put before each report, each report once."""
    lines = (line.removeprefix("Error: ") for line in str(error).strip().splitlines())
    return "\n".join(dict.fromkeys(lines))


def add_on(job: dict[str, Any]) -> ModuleType:
    """Our add-on, registered: installed from the job's zip in a real Blender, else from the checkout."""
    if not job["extension"]:
        package = importlib.import_module("addon")
        package.register()
        return package
    bpy.ops.extensions.package_install_files(
        filepath=job["extension"], repo=EXTENSION_REPOSITORY, enable_on_install=True
    )
    return importlib.import_module(f"bl_ext.{EXTENSION_REPOSITORY}.deep_gbuffer")


def stop_on_interrupt(package: ModuleType | None) -> None:
    """Let SIGINT end this process at once, the GL thread first. A real Blender has its own handler, which cancels."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        if package is not None:
            importlib.import_module(package.__name__ + ".render").stop_gl_thread()
        os._exit(INTERRUPTED)

    if not bpy.app.binary_path:
        signal.signal(signal.SIGINT, stop)


def choose_engine(scene: bpy.types.Scene, engine: Engine) -> None:
    """Make `engine` the scene's. Raises JobError where this Blender has none of its identifiers."""
    for identifier in engine.identifiers:
        try:
            setattr(scene.render, "engine", identifier)  # noqa: B010, its type knows only Blender's own engines
        except TypeError:
            continue
        return
    raise JobError(f"This Blender ({bpy.app.version_string}) has no engine {' or '.join(engine.identifiers)}.")


def apply_settings(scene: bpy.types.Scene, engine: Engine, job: dict[str, Any]) -> None:
    """Resolution, samples, time limit and `--set` of the job. Raises ValueError naming what cannot be set."""
    if job["resolution"]:
        for name, pixels in zip(("resolution_x", "resolution_y"), job["resolution"], strict=True):
            assign(scene.render, name, str(pixels))
        scene.render.resolution_percentage = 100
    settings = getattr(scene, engine.settings)
    if job["samples"] is not None:
        try:
            assign(settings, engine.samples, str(job["samples"]))
        except ValueError as error:
            raise JobError(f"--samples {job['samples']}: {error}") from error
    if job["time_limit"] is not None:
        if not engine.time_limit:
            raise JobError(f"{job['engine']} has no time limit.")
        assign(settings, engine.time_limit, str(job["time_limit"]))
    if engine.layers_path and getattr(settings, engine.layers_path) == BESIDE_THE_BLEND:
        assign(settings, engine.layers_path, job["layers_path"])
    for name, text in job["set"]:
        assign(settings, name, text)
    if job["repeat"] > 1:
        scene.render.use_persistent_data = True


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


def show_progress() -> None:
    """Pass the engine's own status texts on to the parent."""

    def report(status: object, *_unused: object) -> None:
        send("progress", str(status))

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


def device_name(engine: str) -> str | None:
    """What Blender's own GPU engines draw with; None for others and where Blender does not say."""
    if engine not in {"EEVEE", "WORKBENCH"}:
        return None
    import gpu

    try:
        return gpu.platform.renderer_get()
    except SystemError:  # no GPU context on this thread in background
        return None


def statistics(scene: bpy.types.Scene, job: dict[str, Any], package: ModuleType | None, total: float) -> dict[str, Any]:
    """The statistics of the render just made. Raises JobError where our engine has none, so made no picture."""
    if package is not None:
        own = importlib.import_module(package.__name__ + ".engine.statistics").last(scene.name)
        if own is None:
            raise JobError("The engine finished without a picture.")
        return own
    entry: dict[str, Any] = dict.fromkeys(STATISTICS)
    engine = ENGINES[job["engine"]]
    samples = getattr(getattr(scene, engine.settings), engine.samples)
    entry |= {"total_s": total, "samples": samples, "warnings": [], "engine": job["engine"]}
    return entry | {"device": device_name(job["engine"]), "blender": bpy.app.version_string}


def run(job: dict[str, Any]) -> None:
    """Do the job. Raises JobError, ValueError or RuntimeError (Blender's) with a message for a person."""
    engine = ENGINES[job["engine"]]
    package = add_on(job) if job["engine"] == "DEEP_GBUFFER" else None
    stop_on_interrupt(package)
    bpy.ops.wm.open_mainfile(filepath=job["file"], load_ui=False)
    scene = bpy.context.scene
    if scene is None:
        raise JobError("The file has no scene.")
    choose_engine(scene, engine)
    apply_settings(scene, engine, job)
    choose_format(scene, job["suffix"])
    show_progress()
    frames = job["frames"] or [scene.frame_current]
    entries: list[dict[str, Any]] = []
    for frame in frames:
        if job["frames"]:
            scene.frame_set(frame)
        for _ in range(job["repeat"]):
            total = render_once(scene)
            entries.append(statistics(scene, job, package, total))
        picture = str(Path(job["scratch"]) / f"frame_{frame}{job['suffix']}")
        bpy.data.images["Render Result"].save_render(picture, scene=scene)
        send("picture", {"path": picture, "frame": frame})
    send("statistics", entries)
    if package is not None:
        package.unregister()


def main() -> int:
    """Exit code of the job in `sys.argv`."""
    job = json.loads(sys.argv[sys.argv.index("--") + 1])
    try:
        run(job)
    except (JobError, ValueError, RuntimeError, OSError) as error:
        traceback.print_exc()
        send("error", message(error))
        return 1
    return 0


if __name__ == "__main__":
    code = 1
    try:
        code = main()
    except Exception as error:
        traceback.print_exc()
        send("error", f"{type(error).__name__}: {error}")
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # Blender 4.5 may wait for ever at exit once it had a GL context of its own
