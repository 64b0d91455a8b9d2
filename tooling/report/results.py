# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report knows, as plain values: what the page, the tables and the plots are made of."""

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from addon.report.metrics import Errors
from addon.report.sweep import Point

Crop = tuple[int, int]
"""Width and height of the rectangle about the picture's centre that is judged."""


@dataclass(frozen=True)
class Subject:
    """A scene as it is measured: frames of a .blend at a resolution (width, height).

    `frames`: consecutive; several make a sequence. `crop` None: the whole picture is judged.
    """

    name: str
    blend: Path
    frames: tuple[int, ...]
    resolution: tuple[int, int]
    crop: Crop | None


@dataclass(frozen=True)
class Reference:
    """What pictures are judged by. `noise_rmse` (scene-linear) and `noise_flip` estimate how far it is from the truth.

    Both are NaN where that is not known. `source` says where it is from, in words. `pictures`: scene-linear EXR files,
    one per frame.
    """

    source: str
    samples: int | None
    noise_rmse: float
    noise_flip: float
    pictures: tuple[Path, ...]

    @property
    def is_noise_known(self) -> bool:
        """Whether its noise could be estimated."""
        return math.isfinite(self.noise_rmse) and math.isfinite(self.noise_flip)


@dataclass(frozen=True)
class Run:
    """One process that rendered a point: seconds of the first render (cold), and of further ones of the same (warm).

    Seconds are per frame. `cold`: a new process with an empty shader cache; loading the file does not count.
    """

    cold: float
    warm: tuple[float, ...]


@dataclass(frozen=True)
class Judgement:
    """How far a point's pictures are from the reference; of a sequence, `errors` over all its frames.

    `flip`: in display space, mean over pixels and frames. `flicker`: None for a single frame, and where nothing in a
    sequence can be followed from frame to frame. `digest`: equal for equal pictures.
    `picture` (as displayed) and `heat` (FLIP's error map) are PNG files of the first frame's judged rectangle.
    """

    errors: Errors
    flip: float
    flicker: float | None
    digest: str
    picture: Path
    heat: Path


@dataclass(frozen=True)
class Measurement:
    """A point of a scene, measured. `left_out`: what our engine left out, and why; empty for peers.

    `days`: when its runs were made, as ISO 8601 dates.
    """

    point: Point
    runs: tuple[Run, ...]
    judgement: Judgement
    warnings: tuple[str, ...] = ()
    left_out: tuple[tuple[str, str], ...] = ()
    days: tuple[str, ...] = ()

    @property
    def warm(self) -> "Spread":
        """Seconds of warm renders."""
        return Spread.of([seconds for run in self.runs for seconds in run.warm])


@dataclass(frozen=True)
class Spread:
    """Median, least and greatest of `count` values."""

    median: float
    least: float
    greatest: float
    count: int

    @classmethod
    def of(cls, values: Sequence[float]) -> "Spread":
        """Of at least one value. Raises ValueError where there is none."""
        if not values:
            raise ValueError("no values")
        return cls(statistics.median(values), min(values), max(values), len(values))


@dataclass(frozen=True)
class SceneReport:
    """One scene's measurements. `reference_flicker`: of the reference's own frames, None for a single frame.

    `problems`: what could not be measured, and why, in sentences.
    """

    subject: Subject
    reference: Reference
    measurements: tuple[Measurement, ...]
    reference_flicker: float | None = None
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Report:
    """Everything. `command` makes it again; `machine`, `blender` and `commit` say where it was made, and with what."""

    scenes: tuple[SceneReport, ...]
    command: str
    machine: str
    blender: str
    commit: str
    date: str
    quick: bool
    problems: tuple[str, ...] = field(default=())

    @property
    def made(self) -> str:
        """When it was made, and when that was measured where it was on other days."""
        days = {day for scene in self.scenes for each in scene.measurements for day in each.days}
        if days <= {self.date}:
            return self.date
        first, last = min(days), max(days)
        return f"{self.date}, measured {f'on {first}' if first == last else f'from {first} to {last}'}"
