# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders for a report, each process a Blender of its own that runs `addon/report/job.py`."""

import json
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tooling import jobs, places
from tooling.console import ToolError
from tooling.report.plan import Look

JOB = places.REPOSITORY / "addon" / "report" / "job.py"
PACKAGE = "addon"
SHADER_CACHES = ("MESA_SHADER_CACHE_DIR", "__GL_SHADER_DISK_CACHE_PATH")
"""Where Mesa's and NVIDIA's OpenGL keep compiled shaders."""

Tell = Callable[[str], None]
"""Shows a text of progress."""


class NoEngineError(ToolError):
    """This Blender has no such engine."""


@dataclass(frozen=True)
class Render:
    """One thing to render: an engine of `addon.report.engines` with settings of its own or, PERCENT, of the scene.

    Every frame is rendered once, then all again until `warm_seconds` are spent on renders after the first.
    """

    name: str
    engine: str
    settings: Mapping[str, str]
    warm_seconds: float = 0.0


@dataclass(frozen=True)
class Rendered:
    """What came of a render. `cold`: seconds of the first, `warm`: of each later one, in its process.

    `pictures`: a multi-layer EXR of each frame, by frame. `left_out`: what our engine left out, and why. `files`: what
    it wrote beside the pictures, in order of the frames. `device`: what draws, None where untold.
    """

    cold: float
    warm: tuple[float, ...]
    pictures: Mapping[int, Path]
    warnings: tuple[str, ...]
    left_out: tuple[tuple[str, str], ...]
    files: tuple[Path, ...]
    device: str | None = None


def look(python: Path, blend: Path, resolution: tuple[int, int] | None = None) -> Look:
    """What the Blender of `python` says of a file; `resolution` stands for the file's own.

    Raises ToolError naming the file where it cannot be opened.
    """
    opened: dict[str, Any] = {}

    def take(kind: str, content: Any) -> None:
        if kind == "opened":
            opened.update(content)

    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_") as scratch:
        job = {**_job(blend, None, resolution), "folder": scratch, "renders": []}
        _run(python, job, Path(scratch), take, lambda: bool(opened))
    width, height = opened["resolution"]
    return Look(opened["frame"], (width, height), opened["blender"])


def render(
    python: Path,
    blend: Path,
    frames: Sequence[int] | None,
    resolution: tuple[int, int] | None,
    renders: Sequence[Render],
    folder: Path,
    tell: Tell,
    finished: Callable[[Render, Rendered], None],
) -> None:
    """Make `renders` of a file one after the other in one process that starts with empty shader caches.

    `python`: an environment's with bpy. `frames` and `resolution` None: the file's own. Pictures go into the existing
    `folder`, from where `finished` may take them: it is called for every render at once when it is done.
    Raises ToolError where the process fails or, when the others are done, any render failed: with its reason, and as
    NoEngineError where nothing else was wrong with any.
    """
    works = {each.name: _Work(each) for each in renders}
    failures: dict[str, bool] = {}  # reason -> whether it is a missing engine

    def take(kind: str, content: Any) -> None:
        if kind == "progress":
            tell(content["text"])
        elif kind == "picture":
            works[content["name"]].pictures[content["frame"]] = Path(content["path"])
        elif kind == "failed":
            works[content["name"]].is_over = True
            failures[content["reason"]] = content["engine_missing"]
        elif kind == "done":
            work = works[content["name"]]
            work.is_over = True
            finished(work.render, work.rendered(content))

    job = {
        **_job(blend, frames, resolution),
        "folder": str(folder),
        "renders": [asdict(each) for each in renders],
    }
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_") as scratch:
        _run(python, job, Path(scratch), take, lambda: all(work.is_over for work in works.values()))
    if failures:
        raise (NoEngineError if all(failures.values()) else ToolError)("\n".join(failures))


@dataclass
class _Work:
    """A render under way."""

    render: Render
    pictures: dict[int, Path] = field(default_factory=dict[int, Path])
    is_over: bool = False

    def rendered(self, done: Mapping[str, Any]) -> Rendered:
        """What came of it by the job's message."""
        return Rendered(
            cold=done["cold_s"],
            warm=tuple(done["warm_s"]),
            pictures=self.pictures,
            warnings=tuple(done["warnings"]),
            left_out=tuple((name, reason) for name, reason in done["left_out"]),
            files=tuple(Path(path) for path in done["files"]),
            device=done["device"],
        )


def _job(blend: Path, frames: Sequence[int] | None, resolution: tuple[int, int] | None) -> dict[str, Any]:
    """What every job says of its file and of our add-on."""
    return {"file": str(blend.resolve()), "scene": None, "frames": frames, "resolution": resolution, "package": PACKAGE}


def _run(python: Path, job: Mapping[str, Any], scratch: Path, take: jobs.Take, has_all: Callable[[], bool]) -> None:
    """Run a job with empty shader caches, like `jobs.run`."""
    caches = {name: str(scratch / name) for name in SHADER_CACHES}
    for folder in caches.values():
        Path(folder).mkdir()
    command = [str(python), "-P", str(JOB), "--", json.dumps(job)]
    jobs.run(command, scratch, take, has_all, {**caches, "PYTHONPATH": str(places.REPOSITORY)})
