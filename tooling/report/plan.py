# SPDX-License-Identifier: GPL-3.0-or-later
"""What is to be measured, in which order, and how long what is left of it will take."""

import statistics
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from itertools import chain, count
from pathlib import Path

from addon.report.sweep import Point
from tooling.console import ToolError
from tooling.report.results import Crop, Subject


@dataclass(frozen=True)
class Look:
    """What a Blender says of a file that it opened: its current frame, the size (width, height) of its pictures as they
    will be rendered, and Blender's own version.
    """

    frame: int
    resolution: tuple[int, int]
    blender: str


@dataclass(frozen=True)
class Task:
    """One process: a point of a scene, for the `round`-th time (from 1)."""

    subject: Subject
    point: Point
    round: int


def subject(name: str, blend: Path, crop: Crop | None, frames: Sequence[int] | None, look: Look) -> Subject:
    """The scene as it is measured; `frames` None: the file's own frame.

    Raises ToolError where the rectangle `crop` is larger than the picture.
    """
    if crop is not None and (crop[0] > look.resolution[0] or crop[1] > look.resolution[1]):
        raise ToolError("a rectangle of {}x{} cannot be judged in a picture of {}x{}.".format(*crop, *look.resolution))
    return Subject(name, blend, tuple(frames or [look.frame]), look.resolution, crop)


def names(blends: Sequence[Path]) -> list[str]:
    """A name for each scene, its file's; numbered where it is taken, so that files that are named by it differ."""
    found: list[str] = []
    for blend in blends:
        taken = {name.casefold() for name in found}
        numbered = (f"{blend.stem}_{number}" for number in count(2))
        found.append(next(name for name in chain([blend.stem], numbered) if name.casefold() not in taken))
    return found


def rounds(subjects: Sequence[Subject], points: Sequence[Point], number_of_rounds: int) -> list[list[Task]]:
    """Every process of the report: a round of all points of all scenes, then the next round, so that a machine that is
    busy for a while disturbs one round of many points rather than all rounds of a few.
    """
    return [
        [Task(subject, point, number) for subject in subjects for point in points]
        for number in range(1, number_of_rounds + 1)
    ]


class Durations:
    """How long processes took (seconds of the whole process), and from that how long others will take."""

    def __init__(self) -> None:
        """Nothing is known."""
        self._known: dict[Hashable, list[float]] = {}

    def add(self, task: Task, seconds: float) -> None:
        """The process of `task` took this long."""
        for alike in _alike(task):
            self._known.setdefault(alike, []).append(seconds)

    def left(self, tasks: Iterable[Task]) -> tuple[float, bool]:
        """Estimated seconds of those of `tasks` that something alike was timed of, and whether that is all of them."""
        timed = [self._most_alike(task) for task in tasks]
        return sum(map(statistics.median, filter(None, timed))), all(timed)

    def _most_alike(self, task: Task) -> list[float]:
        """Seconds of what is most like `task` among what was timed; empty where nothing is."""
        return next((self._known[alike] for alike in _alike(task) if alike in self._known), [])


def _alike(task: Task) -> tuple[Hashable, ...]:
    """What tasks that take about as long have in common, the most alike first: the point of the scene, the engine in
    the scene, the engine.
    """
    subject, point = task.subject, task.point
    return (subject, point.identity), (subject, point.engine), point.engine
