# SPDX-License-Identifier: GPL-3.0-or-later
"""Render a .blend; runs inside Blender, as a program in its Python module or as a `--python` script.

The job comes as JSON after `--`; what happens goes to stdout as `addon.report.messages`, everything else there is
Blender's own. Pictures are written into the job's scratch folder; `tooling.rendering` puts them in place.
"""

import importlib
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

sys.path.append(str(Path(__file__).resolve().parent.parent))

import bpy

from addon.report import rendering
from addon.report.engines import ENGINES, Engine, assign
from addon.report.messages import JobError, send

EXTENSION_REPOSITORY = "user_default"
BESIDE_THE_BLEND = "//"  # where our layer files go unless the file says otherwise
# Measured by our engine only; the others' are null.
STATISTICS = (
    *("sync_s", "upload_s", "first_picture_s", "sample_s", "total_s", "samples", "passes", "left_out"),
    *("triangles", "draws", "instances", "bytes", "warnings", "files", "engine", "device", "blender"),
)


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


def apply_settings(scene: bpy.types.Scene, engine: Engine, job: dict[str, Any]) -> None:
    """Resolution, samples, time limit and `--set` of the job. Raises ValueError naming what cannot be set."""
    if job["resolution"]:
        rendering.set_resolution(scene, *job["resolution"])
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


def statistics(scene: bpy.types.Scene, job: dict[str, Any], package: ModuleType | None, total: float) -> dict[str, Any]:
    """The statistics of the render just made. Raises JobError where our engine has none, so made no picture."""
    if package is not None:
        return rendering.own_statistics(package.__name__, scene)
    entry: dict[str, Any] = dict.fromkeys(STATISTICS)
    engine = ENGINES[job["engine"]]
    samples = getattr(getattr(scene, engine.settings), engine.samples)
    entry |= {"total_s": total, "samples": samples, "warnings": [], "engine": job["engine"]}
    return entry | {"device": rendering.device_name(job["engine"]), "blender": bpy.app.version_string}


def run(job: dict[str, Any]) -> None:
    """Do the job. Raises JobError, ValueError or RuntimeError (Blender's) with a message for a person."""
    engine = ENGINES[job["engine"]]
    package = add_on(job) if job["engine"] == "DEEP_GBUFFER" else None
    rendering.stop_on_interrupt(package.__name__ if package else None)
    scene = rendering.open_scene(job["file"])
    rendering.choose_engine(scene, engine)
    apply_settings(scene, engine, job)
    rendering.choose_format(scene, job["suffix"])
    rendering.show_progress(lambda text: send("progress", text))
    frames = job["frames"] or [scene.frame_current]
    entries: list[dict[str, Any]] = []
    for frame in frames:
        if job["frames"]:
            scene.frame_set(frame)
        for _ in range(job["repeat"]):
            total = rendering.render_once(scene)
            entries.append(statistics(scene, job, package, total))
        picture = str(Path(job["scratch"]) / f"frame_{frame}{job['suffix']}")
        rendering.save_picture(scene, picture)
        send("picture", {"path": picture, "frame": frame})
    send("statistics", entries)
    if package is not None:
        package.unregister()


if __name__ == "__main__":
    rendering.run_to_end(run)
