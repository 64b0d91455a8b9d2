# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report is asked to measure, and what it is made with."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from addon.report.sweep import Point
from tooling.report.plan import Look
from tooling.report.results import Crop, Judgement, Reference, Report, Run, Subject

Working = Callable[[str], None]
"""Takes what Blender says of how far it is."""


@dataclass(frozen=True)
class Options:
    """What the command line asked for.

    `scenes`: files, each with the rectangle that is judged (None: all of it). `resolution` (width, height) and `frames`
    None: each file's own. `command` makes the report again.
    """

    scenes: tuple[tuple[Path, Crop | None], ...]
    folder: Path
    quick: bool
    resolution: tuple[int, int] | None
    frames: tuple[int, ...] | None
    rounds: int
    command: str


@dataclass(frozen=True)
class Rendered:
    """What a process that rendered a point gave: its times, what it said, and one EXR picture per frame."""

    run: Run
    warnings: tuple[str, ...]
    left_out: tuple[tuple[str, str], ...]
    device: str | None
    pictures: tuple[Path, ...]


class Instruments(Protocol):
    """What does the work. All raise ToolError with the reason, as a sentence, where something cannot be done, and
    OSError where the file system refuses something.
    """

    @property
    def warm_seconds(self) -> float:
        """What each process spends on warm renders."""
        ...

    def device(self) -> str:
        """What draws, as OpenGL calls it; "" where there is no OpenGL."""
        ...

    def look(self, blend: Path, resolution: tuple[int, int] | None) -> Look:
        """Open a file. `resolution` None: the file's."""
        ...

    def reference(self, subject: Subject, version: str, working: Working) -> Reference:
        """What pictures of the scene are judged by; `version` is Blender's."""
        ...

    def layers(self, subject: Subject, folder: Path, working: Working) -> tuple[Path, ...]:
        """A layer file with depth and motion per frame of a sequence, in `folder`."""
        ...

    def render(self, subject: Subject, point: Point, folder: Path, working: Working) -> Rendered:
        """Render a point in a process of its own, pictures in `folder`. Raises NoEngineError too."""
        ...

    def judge(
        self,
        pictures: Sequence[Path],
        reference: Reference,
        subject: Subject,
        layers: Sequence[Path] | None,
        folder: Path,
        name: str,
    ) -> Judgement:
        """Compare pictures with the reference; PNG files go to `folder`. ValueError, too, where they do not fit."""
        ...

    def reference_flicker(self, reference: Reference, subject: Subject, layers: Sequence[Path]) -> float | None:
        """Flicker of the reference's own frames; None where nothing can be followed. ValueError as in `judge`."""
        ...

    def write(self, report: Report, folder: Path) -> None:
        """Write the page and everything that belongs to it."""
        ...
