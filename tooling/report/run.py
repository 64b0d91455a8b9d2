# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes a report: measures what is not in the store yet, and writes the page from what is there."""

import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from datetime import date
from pathlib import Path

from addon.report.sweep import Point
from tooling.console import ToolError, warn
from tooling.machine import commit, machine
from tooling.report import plan
from tooling.report.blender import NoEngineError
from tooling.report.interfaces import Instruments, Options
from tooling.report.keys import Conditions
from tooling.report.plan import Task
from tooling.report.progress import Lines, called
from tooling.report.results import Crop, Judgement, Measurement, Reference, Report, SceneReport, Subject
from tooling.report.store import GO_ON, Measured, Store, WriteError, writing


@dataclass
class Scene:
    """A scene at work. `layers`: of a sequence with something left to be judged. `is_followed`: False for a sequence
    without motion. `hopeless`: points that failed.
    """

    subject: Subject
    reference: Reference
    layers: tuple[Path, ...] | None = None
    is_followed: bool = True
    problems: list[str] = field(default_factory=list[str])
    hopeless: list[Point] = field(default_factory=list[Point])


@contextmanager
def judging(folder: Path) -> Iterator[None]:
    """Turns what is wrong with pictures into a ToolError, and what the file system refuses as `writing` does."""
    try:
        with writing(folder):
            yield
    except ValueError as error:
        raise ToolError(f"{error}.") from error


def make(options: Options, points: Sequence[Point], instruments: Instruments) -> list[str]:
    """Measure all points of all scenes and write the page; sentences about what could not be measured.

    Raises ToolError where files cannot be written. Then, and where it is interrupted, the page is written of what is
    there, but not before every scene was looked at: it would lack those of the page before.
    """
    try:
        with tempfile.TemporaryDirectory(prefix="deep_gbuffer_report_") as scratch:
            work = Work(options, points, instruments, Path(scratch))
            work.prepare()
            try:
                work.measure()
            except BaseException:
                with suppress(ToolError, OSError):
                    work.finish()
                raise
            work.finish()
    except OSError as error:
        place = error.filename or tempfile.tempdir  # the system does not always name what it refused
        raise ToolError(f"{f'{place}: ' if place else ''}{error.strerror or error}. {GO_ON}") from error
    return work.problems


class Work:
    """A report in the making."""

    def __init__(self, options: Options, points: Sequence[Point], instruments: Instruments, scratch: Path) -> None:
        """Nothing is looked at yet; `scratch` is for pictures that are to be judged."""
        self._options = options
        self._points = points
        self._instruments = instruments
        self._scratch = scratch
        self._scenes: dict[str, Scene] = {}
        self._conditions = Conditions("", machine(), "", instruments.warm_seconds)
        self._store = Store(options.folder, self._conditions)
        self._general: list[str] = []
        self._missing: set[str] = set()
        self._lines = Lines(0, 1)
        self._durations = plan.Durations()

    @property
    def problems(self) -> list[str]:
        """Everything that could not be measured, in sentences."""
        return [*self._general, *(problem for scene in self._scenes.values() for problem in scene.problems)]

    def prepare(self) -> None:
        """Open every file and provide its reference. A scene where that fails is a problem; the others go on."""
        blends = [blend for blend, _ in self._options.scenes]
        for name, (blend, crop) in zip(plan.names(blends), self._options.scenes, strict=True):
            try:
                self._scenes[name] = self._scene(name, blend, crop)
            except WriteError:
                raise
            except ToolError as error:
                self._problem(self._general, f"{name} is left out: {error}")
            finally:
                self._lines.clear()

    def _scene(self, name: str, blend: Path, crop: Crop | None) -> Scene:
        """A scene with what its points are judged by. Raises ToolError with the reason where there is none."""
        self._lines.prepare(f"opening {blend.name}")
        look = self._instruments.look(blend, self._options.resolution)
        if not self._conditions.blender:
            device = self._instruments.device()
            self._conditions = replace(self._conditions, blender=look.blender, device=device)
            self._store = Store(self._options.folder, self._conditions)
        subject = plan.subject(name, blend, crop, self._options.frames, look)
        self._lines.prepare(name)
        reference = self._instruments.reference(subject, look.blender, self._lines.working)
        self._lines.reference(subject, reference)
        self._store.check(subject, reference)
        scene = Scene(subject, reference)
        if len(subject.frames) > 1 and not self._is_judged(scene):
            self._follow(scene)
        return scene

    def _is_judged(self, scene: Scene) -> bool:
        """Whether nothing of a sequence needs its motion any more."""
        subject, reference = scene.subject, scene.reference
        return self._store.is_reference_judged(subject, reference) and all(
            self._judgement(scene, point) for point in self._points
        )

    def _follow(self, scene: Scene) -> None:
        """Get a sequence's motion, and the reference's own flicker. Without, the sequence is judged but for flicker."""
        subject, folder = scene.subject, Path(tempfile.mkdtemp(dir=self._scratch))
        self._lines.prepare(f"{subject.name}: motion")
        try:
            layers = self._instruments.layers(subject, folder, self._lines.working)
            with judging(folder):
                flicker = self._instruments.reference_flicker(scene.reference, subject, layers)
        except WriteError:
            raise
        except ToolError as error:
            scene.is_followed = False
            self._problem(scene.problems, f"The flicker of {subject.name} is left out: {error}")
        else:
            self._store.keep_reference_flicker(subject, scene.reference, flicker)
            scene.layers = layers

    def measure(self) -> None:
        """Run every process that is not in the store yet, and write the page after each round.

        A point that fails is a problem and not tried again; a missing engine is one problem.
        """
        subjects = [scene.subject for scene in self._scenes.values()]
        rounds = plan.rounds(subjects, self._points, self._options.rounds)
        tasks = [task for each in rounds for task in each]
        todo = [task for task in tasks if not self._is_done(task)]
        self._lines = Lines(len(tasks), len(rounds))
        if len(todo) < len(tasks):
            self._lines.say(f"{len(tasks) - len(todo)} of {len(tasks)} renders were measured before and are kept")
        while todo:
            task = todo[0]
            if not self._is_hopeless(task):
                left = self._durations.left(other for other in todo if not self._is_hopeless(other))
                self._lines.start(task, len(tasks) - len(todo), left)
                self._measure(task)
            todo.pop(0)
            if todo and todo[0].round > task.round:
                self.write()

    def _is_done(self, task: Task) -> bool:
        """Whether the store has the task's times and, of a first round, how good its picture is."""
        measured = self._store.measured(task)
        if measured is None:
            return False
        self._durations.add(task, measured.process_seconds)
        return task.round > 1 or self._judgement(self._scenes[task.subject.name], task.point) is not None

    def _is_hopeless(self, task: Task) -> bool:
        """Whether this point or its engine has failed before."""
        return task.point.engine in self._missing or task.point in self._scenes[task.subject.name].hopeless

    def _judgement(self, scene: Scene, point: Point) -> Judgement | None:
        """What the store knows of the point's pictures."""
        return self._store.judgement(self._picture_name(scene, point))

    def _picture_name(self, scene: Scene, point: Point) -> str:
        """What the store calls the point's pictures."""
        return self._store.picture_name(scene.subject, point, scene.reference, followed=scene.is_followed)

    def _measure(self, task: Task) -> None:
        """Run one process, judge its pictures unless that was done in a round before, and keep what it gave."""
        scene, point = self._scenes[task.subject.name], task.point
        started = time.monotonic()
        try:
            with tempfile.TemporaryDirectory(dir=self._scratch) as folder:
                rendered = self._instruments.render(scene.subject, point, Path(folder), self._lines.working)
                took = time.monotonic() - started
                judgement = self._judgement(scene, point) or self._judge(scene, point, rendered.pictures)
        except NoEngineError as error:
            self._missing.add(point.engine)
            self._problem(self._general, f"Everything that {point.engine} renders is left out: {error}")
        except WriteError:
            raise
        except ToolError as error:
            scene.hopeless.append(point)
            self._problem(scene.problems, f"{called(scene.subject, point)} is left out: {error}")
        else:
            said = rendered.warnings, rendered.left_out, rendered.device
            measured = Measured(rendered.run, took, date.today().isoformat(), *said)
            self._store.keep_measured(task, measured)
            self._durations.add(task, took)
            self._lines.measured(task, measured, judgement)

    def _judge(self, scene: Scene, point: Point, pictures: Sequence[Path]) -> Judgement:
        """Judge a point's pictures and keep that."""
        name = self._picture_name(scene, point)
        folder = self._store.pictures
        with judging(folder):
            judgement = self._instruments.judge(pictures, scene.reference, scene.subject, scene.layers, folder, name)
        self._store.keep_judgement(name, scene.subject, point, judgement)
        return judgement

    def _problem(self, problems: list[str], sentence: str) -> None:
        """Keep a problem, and say it at once."""
        problems.append(sentence)
        self._lines.clear()
        warn(f"problem: {sentence}")

    def write(self) -> None:
        """Write the page of what is there. Raises WriteError where it cannot be written."""
        self._lines.prepare("writing the page")
        with writing(self._options.folder):
            self._instruments.write(self.report(), self._options.folder)
        self._lines.clear()

    def finish(self) -> None:
        """Write the page for the last time, and say where it is. Raises WriteError where it cannot be written."""
        self.write()
        self._lines.say(f"wrote {self._options.folder / 'index.html'}")

    def report(self) -> Report:
        """Everything that is known now."""
        return Report(
            scenes=tuple(self._scene_report(scene) for scene in self._scenes.values()),
            command=self._options.command,
            machine=self._machine(),
            blender=self._conditions.blender or "unknown",
            commit=commit(),
            date=date.today().isoformat(),
            quick=self._options.quick,
            problems=tuple(self._general),
        )

    def _machine(self) -> str:
        """The machine in words, with what draws there where that was told."""
        tasks = (Task(scene.subject, point, 1) for scene in self._scenes.values() for point in self._points)
        found = (measured.device for task in tasks if (measured := self._store.measured(task)) and measured.device)
        return "; ".join(filter(None, (self._conditions.machine, next(found, None))))

    def _scene_report(self, scene: Scene) -> SceneReport:
        """What is known of a scene now: its points that were rendered and judged."""
        return SceneReport(
            scene.subject,
            scene.reference,
            tuple(filter(None, (self._measurement(scene, point) for point in self._points))),
            self._store.reference_flicker(scene.subject, scene.reference),
            tuple(scene.problems),
        )

    def _measurement(self, scene: Scene, point: Point) -> Measurement | None:
        """A point's rounds and judgement; None where there are none yet."""
        tasks = (Task(scene.subject, point, number) for number in range(1, self._options.rounds + 1))
        found = [measured for task in tasks if (measured := self._store.measured(task))]
        judgement = self._judgement(scene, point)
        if not found or judgement is None:
            return None
        runs = tuple(measured.run for measured in found)
        days = tuple(measured.day for measured in found)
        return Measurement(point, runs, judgement, found[0].warnings, found[0].left_out, days)
