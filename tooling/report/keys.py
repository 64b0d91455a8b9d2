# SPDX-License-Identifier: GPL-3.0-or-later
"""What a measurement depends on, as short names: it is made again where one of them changes."""

import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from addon.report.sweep import OURS, Point
from tooling import places
from tooling.console import ToolError
from tooling.report.plan import Task
from tooling.report.results import Reference, Subject

RENDERING = (
    *("addon/engine", "addon/output", "addon/render", "addon/scene", "addon/sync", "shaders"),
    "addon/ui/properties.py",
)
"""What pictures of ours depend on: the rest of the add-on shows panels, and measures."""

MEASURING = tuple(f"addon/report/{name}.py" for name in ("engines", "job", "measuring", "rendering"))
"""What has any engine render, and times it."""

JUDGING = (
    *(f"addon/report/{name}.py" for name in ("flicker", "metrics", "pictures")),
    *(f"tooling/report/{name}.py" for name in ("judging", "pictures")),
)
"""What compares pictures with the reference."""


@dataclass(frozen=True)
class Conditions:
    """What is the same for all measurements of a report: Blender's version, the machine in words, what draws as OpenGL
    calls it, and the seconds that a process spends on warm renders.
    """

    blender: str
    machine: str
    device: str
    warm_seconds: float

    def run(self, task: Task) -> str:
        """Stands for a process that renders and times."""
        return places.key(self._pictures(task.subject, task.point), self.machine, f"{self.warm_seconds} {task.round}")

    def judgement(self, subject: Subject, point: Point, reference: Reference, *, followed: bool) -> str:
        """Stands for a point's pictures as they are judged; `followed`: a sequence's surfaces, so that flicker is."""
        judged = (content(reference.pictures), sources(JUDGING), str(followed))
        return places.key(self._pictures(subject, point), *judged)

    def reference(self, subject: Subject, reference: Reference) -> str:
        """Stands for the reference's own flicker: our engine says how surfaces move."""
        judged = (content(reference.pictures), sources(JUDGING), sources(RENDERING))
        return places.key(self._subject(subject), "reference", *judged)

    def _subject(self, subject: Subject) -> str:
        """Stands for the scene as it is rendered."""
        shape = repr((subject.frames, subject.resolution, subject.crop))
        return places.key(content((subject.blend,)), shape, self.blender, self.device, sources(MEASURING))

    def _pictures(self, subject: Subject, point: Point) -> str:
        """Stands for the pictures of a point."""
        ours = sources(RENDERING) if point.engine == OURS else ""
        return places.key(self._subject(subject), repr(point.identity), ours)


@cache
def content(paths: tuple[Path, ...]) -> str:
    """Stands for what is in these files now; they are read once in a process.

    Raises ToolError naming the file that cannot be read.
    """
    digests: list[bytes] = []
    for path in paths:
        try:
            digests.append(hashlib.sha256(path.read_bytes()).digest())
        except OSError as error:
            raise ToolError(f"{path} could not be read: {error.strerror}.") from error
    return places.key(*digests)


@cache
def sources(names: tuple[str, ...]) -> str:
    """Stands for these files and everything in these folders of the checkout; they are read once in a process."""
    named = [places.REPOSITORY / name for name in names]
    inside = [path for place in named for path in place.rglob("*") if "__pycache__" not in path.parts]
    files = [path for path in (*named, *inside) if path.is_file()]
    return places.key(*(part for path in sorted(files) for part in (path.name, path.read_bytes())))
