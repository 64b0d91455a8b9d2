# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person sees while a report is made: one line of where it is, and one for everything that finished."""

from statistics import median

from addon.report.sweep import Point
from tooling.console import Progress, say
from tooling.report.plan import Task
from tooling.report.results import Judgement, Reference, Subject
from tooling.report.store import Measured
from tooling.report.tables import named


def called(subject: Subject, point: Point) -> str:
    """A point of a scene, as people say it."""
    return f"{subject.name} · {named(point.series, point.label)}"


class Lines:
    """Says how far a report of `total` processes in `rounds` rounds is."""

    def __init__(self, total: int, rounds: int) -> None:
        """Nothing is done yet."""
        self._total = total
        self._rounds = rounds
        self._progress = Progress("Report")
        self._head = self._tail = ""

    def start(self, task: Task, done: int, left: tuple[float, bool]) -> None:
        """A process starts after `done` others. `left`: seconds of what is left with it, and whether nothing is missing
        in that.
        """
        self._head = f"{done + 1}/{self._total} {called(task.subject, task.point)}"
        self._head += f" · round {task.round} of {self._rounds}" if self._rounds > 1 else ""
        seconds, is_all = left
        self._tail = f"{'about' if is_all else 'more than'} {duration(seconds)} left" if seconds else "… left"
        self.working("")

    def prepare(self, what: str) -> None:
        """Something that is no point of the sweep starts."""
        self._head, self._tail = what, ""
        self.working("")

    def working(self, text: str) -> None:
        """Blender says how far it is with what was started."""
        self._progress.show(" · ".join(filter(None, (self._head, self._tail, text))))

    def measured(self, task: Task, measured: Measured, judgement: Judgement) -> None:
        """A process has ended well."""
        warm = measured.run.warm
        seconds = f"{median(warm):.2f} s" if warm else f"{measured.run.cold:.2f} s cold"
        self.say(f"{called(task.subject, task.point)}: {seconds}, FLIP {judgement.flip:.3f}")

    def reference(self, subject: Subject, reference: Reference) -> None:
        """The reference is there."""
        samples = f", {reference.samples} samples per pixel" if reference.samples else ""
        noise = (
            f"about {reference.noise_rmse:.2g} RMSE, {reference.noise_flip:.2g} FLIP"
            if reference.is_noise_known
            else "unknown, as there is no Cycles to estimate it"
        )
        self.say(f"{subject.name}: reference: {reference.source}{samples}; its own noise is {noise}")

    def say(self, text: str) -> None:
        """A line that stays."""
        self.clear()
        say(text)

    def clear(self) -> None:
        """Take the line of progress away."""
        self._progress.clear()


def duration(seconds: float) -> str:
    """Seconds, as people say a time that was guessed."""
    if round(seconds) < 60:
        return f"{max(round(seconds), 1)} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 120 else f"{minutes / 60.0:.1f} h"
