# SPDX-License-Identifier: GPL-3.0-or-later
"""The measurements on disk: every one is a file of its own as soon as it is made, so none is lost or made twice.

`measured/KEY.json`, one process that rendered a point:
  version     of this format (VERSION); files of another are measured again
  scene, series, label, engine, settings, round, blender    what was rendered, for people
  cold_s, warm_s    seconds per frame of the first render, and of each further one
  process_s         seconds of the whole process
  day               when it ended, as ISO 8601 date
  warnings          texts
  left_out          what our engine left out, as pairs of name and reason
  device            what draws, as OpenGL calls it; null where that was not told
`judged/KEY.json`, the pictures of a point compared with the reference, with `KEY*.png` beside it:
  version, scene, series, label, engine, settings, blender    as above
  rmse, relative_mse, psnr (null: infinite, the pictures are equal), bias (red, green, blue), fireflies, invalid
  flip, flicker (null: one frame, or nothing could be followed), digest
  picture, heat     names of files in the same folder
`judged/KEY.json` of a reference: version, scene, flicker (null: nothing could be followed).

KEY stands for everything that the content depends on, see `tooling.report.keys`. Our own engine's sources are part of
it, so that a new state of the checkout measures ours again and keeps its peers; what measures and judges is, too. So is
the machine for what was timed, as is the reference for what was judged.
"""

import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

from addon.report.metrics import Errors
from addon.report.sweep import Point
from tooling import places
from tooling.console import ToolError, warn
from tooling.report.keys import Conditions, content
from tooling.report.plan import Task
from tooling.report.results import Judgement, Reference, Run, Subject

VERSION = 2
GO_ON = (
    "What was finished before is kept; when this is put right, give the same command again and it goes on from there."
)

Content = TypeVar("Content")


@dataclass(frozen=True)
class Measured:
    """What one process gave: its times, the seconds that it took as a whole, and what it said.

    `day`: when, as ISO 8601 date. `device`: what draws, as OpenGL calls it; None where that was not told.
    """

    run: Run
    process_seconds: float
    day: str
    warnings: tuple[str, ...] = ()
    left_out: tuple[tuple[str, str], ...] = ()
    device: str | None = None


class Store:
    """The measurements in a report's folder that were made under the same conditions."""

    def __init__(self, folder: Path, conditions: Conditions) -> None:
        """`folder` is the report's."""
        self._measured = folder / "measured"
        self._judged = folder / "judged"
        self._conditions = conditions

    @property
    def pictures(self) -> Path:
        """The folder of the pictures of what was judged."""
        return self._judged

    def check(self, subject: Subject, reference: Reference) -> None:
        """Raise ToolError naming the file where the scene or its reference cannot be read."""
        content((subject.blend,))
        content(reference.pictures)

    def measured(self, task: Task) -> Measured | None:
        """What the task's process gave; None where it is still to be run."""
        return _read(self._measured_path(task), _measured)

    def keep_measured(self, task: Task, measured: Measured) -> None:
        """Write what the task's process gave. Raises WriteError where that cannot be written."""
        said = {
            **self._about(task.subject, task.point),
            "round": task.round,
            "cold_s": measured.run.cold,
            "warm_s": measured.run.warm,
            "process_s": measured.process_seconds,
            "day": measured.day,
            "warnings": measured.warnings,
            "left_out": measured.left_out,
            "device": measured.device,
        }
        _write(self._measured_path(task), said)

    def judgement(self, name: str) -> Judgement | None:
        """How far the pictures of this `picture_name` are from the reference; None where that is still to be judged."""
        return _read(self._judged / f"{name}.json", self._judgement)

    def keep_judgement(self, name: str, subject: Subject, point: Point, judgement: Judgement) -> None:
        """Write how far pictures are from the reference. Raises WriteError where that fails."""
        errors = asdict(judgement.errors)
        said = {
            **self._about(subject, point),
            **errors,
            "psnr": errors["psnr"] if math.isfinite(errors["psnr"]) else None,
            "flip": judgement.flip,
            "flicker": judgement.flicker,
            "digest": judgement.digest,
            "picture": judgement.picture.name,
            "heat": judgement.heat.name,
        }
        _write(self._judged / f"{name}.json", said)

    def picture_name(self, subject: Subject, point: Point, reference: Reference, *, followed: bool) -> str:
        """How the files of a judgement start; `followed`: a sequence's surfaces, so that it has a flicker."""
        return self._conditions.judgement(subject, point, reference, followed=followed)

    def reference_flicker(self, subject: Subject, reference: Reference) -> float | None:
        """The reference's own flicker; None where that is still to be judged, and where nothing could be followed."""
        return _read(self._reference_path(subject, reference), lambda said: said["flicker"])

    def is_reference_judged(self, subject: Subject, reference: Reference) -> bool:
        """Whether the reference's own flicker was kept."""
        return bool(_read(self._reference_path(subject, reference), lambda said: "flicker" in said))

    def keep_reference_flicker(self, subject: Subject, reference: Reference, flicker: float | None) -> None:
        """Write the reference's own flicker. Raises WriteError where that cannot be written."""
        said = {"version": VERSION, "scene": subject.name, "flicker": flicker}
        _write(self._reference_path(subject, reference), said)

    def _about(self, subject: Subject, point: Point) -> dict[str, object]:
        """What every file says of what was rendered."""
        return {
            "version": VERSION,
            "scene": subject.name,
            "series": point.series,
            "label": point.label,
            "engine": point.engine,
            "settings": dict(point.settings),
            "blender": self._conditions.blender,
        }

    def _measured_path(self, task: Task) -> Path:
        return self._measured / f"{self._conditions.run(task)}.json"

    def _reference_path(self, subject: Subject, reference: Reference) -> Path:
        return self._judged / f"{self._conditions.reference(subject, reference)}.json"

    def _judgement(self, said: dict[str, Any]) -> Judgement:
        """The judgement that a file says. Raises ValueError where a picture of it is gone."""
        picture, heat = self._judged / said["picture"], self._judged / said["heat"]
        for path in (picture, heat):
            if not path.is_file():
                raise ValueError(f"{path.name} is gone")
        red, green, blue = map(float, said["bias"])
        errors = Errors(
            rmse=float(said["rmse"]),
            relative_mse=float(said["relative_mse"]),
            psnr=math.inf if said["psnr"] is None else float(said["psnr"]),
            bias=(red, green, blue),
            fireflies=float(said["fireflies"]),
            invalid=int(said["invalid"]),
        )
        flicker = None if said["flicker"] is None else float(said["flicker"])
        return Judgement(errors, float(said["flip"]), flicker, str(said["digest"]), picture, heat)


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
        raise WriteError(f"{path} could not be written: {error.strerror}. {GO_ON}") from error


def _write(path: Path, said: dict[str, Any]) -> None:
    """Write a file so that there is never half of it. Raises WriteError where that fails."""
    with writing(path), places.replacing(path) as draft:
        draft.write_text(json.dumps(said, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _read(path: Path, understand: Callable[[dict[str, Any]], Content]) -> Content | None:
    """What `understand` makes of a file's content; None, with a warning, where it is not whole, and where it is not
    there.
    """
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
        if said["version"] != VERSION:
            raise ValueError(f"it has version {said['version']}, not {VERSION}")
        return understand(said)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError) as error:
        warn(f"warning: {path} cannot be used ({type(error).__name__}: {error}); it is measured again.")
        return None


def _measured(said: dict[str, Any]) -> Measured:
    """What the process gave whose file says this."""
    return Measured(
        Run(float(said["cold_s"]), tuple(map(float, said["warm_s"]))),
        float(said["process_s"]),
        str(said["day"]),
        tuple(map(str, said["warnings"])),
        tuple((str(name), str(reason)) for name, reason in said["left_out"]),
        said["device"],
    )
