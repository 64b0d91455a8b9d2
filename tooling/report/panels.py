# SPDX-License-Identifier: GPL-3.0-or-later
"""What a plot of error against time shows, as plain values; `plots` draws it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from addon.report.sweep import OURS
from tooling.report.results import Judgement, Measurement, Reference, SceneReport
from tooling.report.tables import named, originals, pareto_front, warm_seconds

SMALLEST = 1e-6
"""The lower end of an axis where every error is 0."""
STEP = 2.0
"""An error of 0 is drawn this factor below the smallest other one."""
NOISE_REACH = 10.0
"""The axis goes down to the reference's noise where that is at most this factor below the smallest error."""

ROOM = 1.6
"""Between the lowest mark and the end of the axis, as a factor."""


@dataclass(frozen=True)
class Metric:
    """An error that is plotted: its name on the axis, its value, and how large the reference's own error is in it."""

    name: str
    key: str
    of: Callable[[Judgement], float | None]
    noise: Callable[[Reference], float] | None = None


FLIP = Metric("FLIP", "flip", lambda judged: judged.flip, lambda reference: reference.noise_flip)
RELATIVE_MSE = Metric("relative MSE", "relative_mse", lambda judged: judged.errors.relative_mse)
RMSE = Metric("RMSE", "rmse", lambda judged: judged.errors.rmse, lambda reference: reference.noise_rmse)
FLICKER = Metric("flicker", "flicker", lambda judged: judged.flicker)


@dataclass(frozen=True)
class Dot:
    """One point: warm seconds (median, least, greatest) and its place on the axis of errors.

    `is_zero`: there is no error, and `error` is only where that is drawn. `is_copy`: the picture is that of another.
    """

    seconds: float
    least: float
    greatest: float
    error: float
    label: str
    is_zero: bool
    is_copy: bool

    @property
    def has_spread(self) -> bool:
        """Whether times differ; a single render has no spread."""
        return self.least < self.greatest


@dataclass(frozen=True)
class Line:
    """A series. `is_sweep`: its points differ in one number, so that a line through them means something."""

    name: str
    is_peer: bool
    is_sweep: bool
    dots: tuple[Dot, ...]


@dataclass(frozen=True)
class Panel:
    """One metric of one scene. `front`: (seconds, error) of the Pareto front, by rising seconds.

    `noise`: the reference's own error, None where it is not known in this metric. `lowest`: lower end of the axis.
    """

    metric: Metric
    lines: tuple[Line, ...]
    front: tuple[tuple[float, float], ...]
    noise: float | None
    lowest: float


def metrics(scene: SceneReport) -> list[Metric]:
    """What is plotted of a scene: flicker only where there is one."""
    has_flicker = any(each.judgement.flicker is not None for each in scene.measurements)
    return [FLIP, RELATIVE_MSE, RMSE, *([FLICKER] if has_flicker else [])]


def panel(scene: SceneReport, metric: Metric) -> Panel:
    """What to draw of a scene. Points without a time above 0 or without a finite error are left away."""
    same = originals(scene.measurements)
    errors = [_finite(metric.of(each.judgement)) for each in scene.measurements]
    noise = metric.noise(scene.reference) if metric.noise and scene.reference.is_noise_known else None
    zero, lowest = _lower_end([error for error in errors if error is not None], noise)
    dots: dict[str, list[tuple[Measurement, Dot]]] = {}
    for index, (each, error) in enumerate(zip(scene.measurements, errors, strict=True)):
        warm = warm_seconds(each)
        if error is None or not 0.0 < warm.median < math.inf:
            continue
        place = max(error, zero)
        dot = Dot(warm.median, warm.least, warm.greatest, place, each.point.label, error <= 0.0, same[index] != index)
        dots.setdefault(each.point.series, []).append((each, dot))
    lines = tuple(_line(name, found) for name, found in dots.items())
    everything = [(dot.seconds, dot.error) for line in lines for dot in line.dots]
    front = sorted({place for place, best in zip(everything, pareto_front(everything), strict=True) if best})
    return Panel(metric, lines, tuple(front), noise, lowest)


def _finite(error: float | None) -> float | None:
    """The error, or None where there is none to plot."""
    return error if error is not None and math.isfinite(error) else None


def _lower_end(errors: Sequence[float], noise: float | None) -> tuple[float, float]:
    """Where errors of 0 are drawn, and where the axis ends."""
    positive = [error for error in errors if error > 0.0]
    smallest = min(positive, default=SMALLEST * STEP)
    zero = smallest / STEP if len(positive) < len(errors) else smallest
    if noise is not None and noise > 0.0 and smallest / NOISE_REACH <= noise:
        zero = min(zero, noise) if len(positive) < len(errors) else zero
        return zero, min(zero, noise) / ROOM
    return zero, zero / ROOM


def _line(name: str, found: Sequence[tuple[Measurement, Dot]]) -> Line:
    """A series from its measured points."""
    measurements = [measurement for measurement, _ in found]
    is_peer = measurements[0].point.engine != OURS
    return Line(name, is_peer, _is_sweep(measurements), tuple(dot for _, dot in found))


def _is_sweep(measurements: Sequence[Measurement]) -> bool:
    """Whether the points differ in exactly one setting, and that is a number."""
    settings = [measurement.point.settings for measurement in measurements]
    names = {name for each in settings for name in each}
    varied = [name for name in names if len({each.get(name) for each in settings}) > 1]
    return len(varied) == 1 and all(_is_number(each.get(varied[0], "")) for each in settings)


def _is_number(text: str) -> bool:
    """Whether the text is a finite number."""
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def label(line: Line, dot: Dot) -> str:
    """What stands beside a dot: its series too, but only at the first of a connected line."""
    first = next((each for each in line.dots if not each.is_copy), dot)
    return dot.label if line.is_sweep and dot != first else named(line.name, dot.label)
