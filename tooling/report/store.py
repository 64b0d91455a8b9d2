# SPDX-License-Identifier: GPL-3.0-or-later
"""The measurements on disk: every one is a file of its own as soon as it is made, so none is lost or made twice.

`measured/KEY.json`, one process that rendered a point:
  version     of this format (VERSION); files of another are measured again
  scene, series, label, engine, settings, round, blender    what was rendered, for people
  cold_s, warm_s    seconds per frame of the first render, and of each further one
  process_s         seconds of the whole process
  warnings          texts
  left_out          what our engine left out, as pairs of name and reason
  device            what draws, as OpenGL calls it; null where that was not told
`judged/KEY.json`, the pictures of a point compared with the reference, with `KEY*.png` beside it:
  version, scene, series, label, engine, settings, blender    as above
  rmse, relative_mse, psnr (null: infinite, the pictures are equal), bias (red, green, blue), fireflies, invalid
  flip, flicker (null: one frame, or nothing could be followed), digest
  picture, heat     names of files in the same folder
`judged/KEY.json` of a reference: version, scene, flicker (null: nothing could be followed).

KEY stands for everything that the content depends on. Our own engine's sources are part of it, so that a new state of
the checkout measures ours again and keeps its peers. So is the machine for what was timed, as is the reference for what
was judged.
"""

import hashlib
import json
import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from addon.report.metrics import Errors
from addon.report.sweep import OURS, Point
from tooling import places
from tooling.console import ToolError, warn
from tooling.report.plan import Task
from tooling.report.results import Judgement, Reference, Run, Subject

VERSION = 1
RENDERING = (
    *("addon/engine", "addon/output", "addon/render", "addon/scene", "addon/sync", "shaders"),
    "addon/ui/properties.py",
)
"""What pictures of ours depend on: the rest of the add-on shows panels, and measures."""

Content = TypeVar("Content")


@dataclass(frozen=True)
class Measured:
    """What one process gave: its times, the seconds that it took as a whole, and what it said.

    `device`: what draws, as OpenGL calls it; None where that was not told.
    """

    run: Run
    process_seconds: float
    warnings: tuple[str, ...] = ()
    left_out: tuple[tuple[str, str], ...] = ()
    device: str | None = None


class Store:
    """The measurements in a report's folder that were made by one Blender on one machine."""

    def __init__(self, folder: Path, blender: str, machine: str) -> None:
        """`folder` is the report's; `blender` and `machine` say with what and where it is measured."""
        self._measured = folder / "measured"
        self._judged = folder / "judged"
        self._blender = blender
        self._machine = machine

    @property
    def pictures(self) -> Path:
        """The folder of the pictures of what was judged."""
        return self._judged

    def measured(self, task: Task) -> Measured | None:
        """What the task's process gave; None where it is still to be run."""
        return _read(self._measured_path(task), _measured)

    def keep_measured(self, task: Task, measured: Measured) -> None:
        """Write what the task's process gave. Raises WriteError where that cannot be written."""
        content = {
            **self._about(task.subject, task.point),
            "round": task.round,
            "cold_s": measured.run.cold,
            "warm_s": measured.run.warm,
            "process_s": measured.process_seconds,
            "warnings": measured.warnings,
            "left_out": measured.left_out,
            "device": measured.device,
        }
        self._write(self._measured_path(task), content)

    def judgement(self, subject: Subject, point: Point, reference: Reference) -> Judgement | None:
        """How far the point's pictures are from this reference; None where that is still to be judged."""
        return _read(self._judged / f"{self.picture_name(subject, point, reference)}.json", self._judgement)

    def keep_judgement(self, subject: Subject, point: Point, reference: Reference, judgement: Judgement) -> None:
        """Write how far the point's pictures are from this reference. Raises WriteError where that fails."""
        errors = asdict(judgement.errors)
        content = {
            **self._about(subject, point),
            **errors,
            "psnr": errors["psnr"] if math.isfinite(errors["psnr"]) else None,
            "flip": judgement.flip,
            "flicker": judgement.flicker,
            "digest": judgement.digest,
            "picture": judgement.picture.name,
            "heat": judgement.heat.name,
        }
        self._write(self._judged / f"{self.picture_name(subject, point, reference)}.json", content)

    def picture_name(self, subject: Subject, point: Point, reference: Reference) -> str:
        """How the files of a judgement start."""
        return places.key(self._point_key(subject, point), _content(reference.pictures))

    def reference_flicker(self, subject: Subject, reference: Reference) -> float | None:
        """The reference's own flicker; None where that is still to be judged, and where nothing could be followed."""
        return _read(self._reference_path(subject, reference), lambda content: content["flicker"])

    def is_reference_judged(self, subject: Subject, reference: Reference) -> bool:
        """Whether the reference's own flicker was kept."""
        return bool(_read(self._reference_path(subject, reference), lambda content: "flicker" in content))

    def keep_reference_flicker(self, subject: Subject, reference: Reference, flicker: float | None) -> None:
        """Write the reference's own flicker. Raises WriteError where that cannot be written."""
        content = {"version": VERSION, "scene": subject.name, "flicker": flicker}
        self._write(self._reference_path(subject, reference), content)

    def _about(self, subject: Subject, point: Point) -> dict[str, object]:
        """What every file says of what was rendered."""
        return {
            "version": VERSION,
            "scene": subject.name,
            "series": point.series,
            "label": point.label,
            "engine": point.engine,
            "settings": dict(point.settings),
            "blender": self._blender,
        }

    def _measured_path(self, task: Task) -> Path:
        key = places.key(self._point_key(task.subject, task.point), self._machine, str(task.round))
        return self._measured / f"{key}.json"

    def _reference_path(self, subject: Subject, reference: Reference) -> Path:
        key = places.key(self._subject_key(subject), "reference", _content(reference.pictures))
        return self._judged / f"{key}.json"

    def _subject_key(self, subject: Subject) -> str:
        """Stands for the scene as it is measured, and this Blender."""
        return places.key(
            _content((subject.blend,)), repr((subject.frames, subject.resolution, subject.crop)), self._blender
        )

    def _point_key(self, subject: Subject, point: Point) -> str:
        """Stands for the pictures of a point."""
        ours = rendering_sources() if point.engine == OURS else ""
        return places.key(self._subject_key(subject), repr(point.identity), ours)

    def _judgement(self, content: dict[str, Any]) -> Judgement:
        """The judgement that a file has. Raises ValueError where a picture of it is gone."""
        picture, heat = self._judged / content["picture"], self._judged / content["heat"]
        for path in (picture, heat):
            if not path.is_file():
                raise ValueError(f"{path.name} is gone")
        red, green, blue = map(float, content["bias"])
        errors = Errors(
            rmse=float(content["rmse"]),
            relative_mse=float(content["relative_mse"]),
            psnr=math.inf if content["psnr"] is None else float(content["psnr"]),
            bias=(red, green, blue),
            fireflies=float(content["fireflies"]),
            invalid=int(content["invalid"]),
        )
        flicker = None if content["flicker"] is None else float(content["flicker"])
        return Judgement(errors, float(content["flip"]), flicker, str(content["digest"]), picture, heat)

    def _write(self, path: Path, content: dict[str, Any]) -> None:
        """Write a file so that there is never half of it. Raises WriteError where that fails."""
        draft = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            with writing(path):
                path.parent.mkdir(parents=True, exist_ok=True)
                draft.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
                draft.replace(path)
        finally:
            with suppress(OSError):
                draft.unlink(missing_ok=True)


class WriteError(ToolError):
    """A file of the report could not be written, so there is no use in going on."""


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turns what the file system refuses in the block into a WriteError that names the file or folder `path`.

    An OSError that is not the file system's own (a picture that cannot be understood) becomes a plain ToolError.
    """
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise ToolError(str(error)) from error
        raise WriteError(
            f"{path} could not be written: {error.strerror}. What was finished before is kept; when "
            "this is put right, give the same command again and it goes on from there."
        ) from error


def _read(path: Path, understand: Callable[[dict[str, Any]], Content]) -> Content | None:
    """What `understand` makes of a file's content; None, with a warning, where it is not whole, and where it is not
    there.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["version"] != VERSION:
            raise ValueError(f"it has version {content['version']}, not {VERSION}")
        return understand(content)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError) as error:
        warn(f"warning: {path} cannot be used ({type(error).__name__}: {error}); it is measured again.")
        return None


def _measured(content: dict[str, Any]) -> Measured:
    """What the process gave whose file has this content."""
    return Measured(
        Run(float(content["cold_s"]), tuple(map(float, content["warm_s"]))),
        float(content["process_s"]),
        tuple(map(str, content["warnings"])),
        tuple((str(name), str(reason)) for name, reason in content["left_out"]),
        content["device"],
    )


@cache
def _content(paths: tuple[Path, ...]) -> str:
    """Stands for what is in these files now; they are read once in a process."""
    return places.key(*(hashlib.sha256(path.read_bytes()).digest() for path in paths))


@cache
def rendering_sources() -> str:
    """Stands for everything of this checkout that our engine renders with; it is read once in a process."""
    named = [places.REPOSITORY / name for name in RENDERING]
    inside = [path for place in named for path in place.rglob("*") if "__pycache__" not in path.parts]
    files = [path for path in (*named, *inside) if path.is_file()]
    return places.key(*(part for path in sorted(files) for part in (path.name, path.read_bytes())))
