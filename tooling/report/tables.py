# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of a report: one row per point and scene, as CSV and JSON; and which points are the best."""

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from addon.report.sweep import OURS
from tooling.report.commands import repeat
from tooling.report.results import Measurement, Report, SceneReport, Spread

JSON_FORMAT = 1
UNITS = {
    "warm_s": "s",
    "warm_least_s": "s",
    "warm_greatest_s": "s",
    "cold_s": "s",
    "flip": "0 to 1",
    "rmse": "scene-linear",
    "relative_mse": "ratio",
    "psnr": "dB",
    "bias_red": "scene-linear",
    "bias_green": "scene-linear",
    "bias_blue": "scene-linear",
    "fireflies": "scene-linear",
    "invalid": "pixels",
    "flicker": "display",
}


@dataclass(frozen=True)
class Row:
    """A point of a scene in plain figures; the names are those of the JSON file.

    Seconds are per frame; `warm_s` and `cold_s` are medians, NaN where nothing was timed. `flicker`: NaN for a single
    frame. `pareto`: on the Pareto front of warm seconds and FLIP. `same_picture_as`: the first point with bit for bit
    the same picture, "" for that point itself and for pictures of their own.
    """

    scene: str
    series: str
    label: str
    engine: str
    settings: Mapping[str, str]
    warm_s: float
    warm_least_s: float
    warm_greatest_s: float
    warm_renders: int
    cold_s: float
    cold_renders: int
    flip: float
    rmse: float
    relative_mse: float
    psnr: float
    bias_red: float
    bias_green: float
    bias_blue: float
    fireflies: float
    invalid: int
    flicker: float
    pareto: bool
    same_picture_as: str
    left_out: tuple[str, ...]
    warnings: tuple[str, ...]
    command: str

    @property
    def name(self) -> str:
        """Series and label, as people say it."""
        return named(self.series, self.label)

    @property
    def title(self) -> str:
        """Its name with that of our engine before it; the other engines' series are called after them."""
        return f"Deep G-Buffer · {self.name}" if self.engine == OURS else self.name


def named(series: str, label: str) -> str:
    """A point's name; a series with one point without a label goes by its own."""
    return f"{series}: {label}" if label else series


def warm_seconds(measurement: Measurement) -> Spread:
    """Warm seconds per frame; all NaN where no warm render was made."""
    return measurement.warm if any(run.warm for run in measurement.runs) else Spread(math.nan, math.nan, math.nan, 0)


def pareto_front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """For each (cost, error): whether no other is at most as large in both and smaller in one; equal ones go together.

    Points with a NaN are never on the front and push nothing off it.
    """
    valid = [not (math.isnan(cost) or math.isnan(error)) for cost, error in points]
    front = [False] * len(points)
    least = math.inf
    order = sorted((index for index, known in enumerate(valid) if known), key=lambda index: points[index])
    best: tuple[float, float] | None = None
    for index in order:
        if best is None or points[index][1] < least or points[index] == best:
            best, least = points[index], points[index][1]
            front[index] = True
    return front


def originals(measurements: Sequence[Measurement]) -> list[int]:
    """For each measurement the index of the first with the same pictures, bit for bit; its own where that is itself."""
    first: dict[str, int] = {}
    return [first.setdefault(each.judgement.digest, index) for index, each in enumerate(measurements)]


def rows(scene: SceneReport, blender: str) -> list[Row]:
    """One row per measured point, in the order they are in; `blender` is the version named in commands."""
    measured = scene.measurements
    front = pareto_front([(warm_seconds(each).median, each.judgement.flip) for each in measured])
    same = [measured[first].point if first != index else None for index, first in enumerate(originals(measured))]
    return [
        Row(
            scene=scene.subject.name,
            series=each.point.series,
            label=each.point.label,
            engine=each.point.engine,
            settings=dict(each.point.settings),
            **_seconds(each),
            **_errors(each),
            pareto=best,
            same_picture_as=named(twin.series, twin.label) if twin else "",
            left_out=tuple(f"{name}: {reason}" for name, reason in each.left_out),
            warnings=each.warnings,
            command=repeat(scene.subject, each.point, blender),
        )
        for each, best, twin in zip(measured, front, same, strict=True)
    ]


def _seconds(measurement: Measurement) -> dict[str, Any]:
    """The fields of a row that say how long it took."""
    warm, cold = warm_seconds(measurement), [run.cold for run in measurement.runs]
    return {
        "warm_s": warm.median,
        "warm_least_s": warm.least,
        "warm_greatest_s": warm.greatest,
        "warm_renders": warm.count,
        "cold_s": Spread.of(cold).median if cold else math.nan,
        "cold_renders": len(cold),
    }


def _errors(measurement: Measurement) -> dict[str, Any]:
    """The fields of a row that say how far the picture is from the reference."""
    judged = measurement.judgement
    errors = judged.errors
    return {
        "flip": judged.flip,
        "rmse": errors.rmse,
        "relative_mse": errors.relative_mse,
        "psnr": errors.psnr,
        **dict(zip(("bias_red", "bias_green", "bias_blue"), errors.bias, strict=True)),
        "fireflies": errors.fireflies,
        "invalid": errors.invalid,
        "flicker": math.nan if judged.flicker is None else judged.flicker,
    }


def csv_text(report: Report) -> str:
    """All scenes' rows as CSV, with units in the header; several values in a cell are separated by semicolons."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [field.name for field in fields(Row)]
    writer.writerow([f"{name} [{UNITS[name]}]" if name in UNITS else name for name in names])
    for scene in report.scenes:
        for row in rows(scene, report.blender):
            writer.writerow([_cell(getattr(row, name)) for name in names])
    return text.getvalue()


def _cell(value: object) -> object:
    """A value as one cell of CSV."""
    if isinstance(value, Mapping):
        return "; ".join(f"{name}={text}" for name, text in value.items())
    return "; ".join(map(str, value)) if isinstance(value, tuple) else value


def json_text(report: Report) -> str:
    """The report as JSON that any parser reads: numbers that are not finite are the texts "nan" and "inf"."""
    content = {
        "format": JSON_FORMAT,
        **{name: getattr(report, name) for name in ("command", "machine", "blender", "commit", "date", "quick")},
        "problems": report.problems,
        "scenes": [_scene(scene, report.blender) for scene in report.scenes],
    }
    return json.dumps(_parsable(content), indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def _scene(scene: SceneReport, blender: str) -> dict[str, Any]:
    """One scene as plain values."""
    subject, reference = asdict(scene.subject), asdict(scene.reference)
    reference.pop("pictures")
    return {
        **subject,
        "blend": str(scene.subject.blend),
        "reference": reference,
        "reference_flicker": scene.reference_flicker,
        "problems": scene.problems,
        "points": [asdict(row) for row in rows(scene, blender)],
    }


def _parsable(value: Any) -> Any:
    """The value without numbers that JSON has no words for."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, dict):
        return {name: _parsable(item) for name, item in value.items()}
    return [_parsable(item) for item in value] if isinstance(value, list | tuple) else value


def rows_of(text: str) -> list[list[Row]]:
    """Each scene's rows, of a report that `json_text` wrote.

    Raises ValueError where it is of another format.
    """
    content = json.loads(text)
    if content["format"] != JSON_FORMAT:
        raise ValueError(f"a report of format {content['format']}, where {JSON_FORMAT} was expected")
    return [[_row(point) for point in scene["points"]] for scene in content["scenes"]]


def _row(point: dict[str, Any]) -> Row:
    """A row from its JSON object."""
    numbers = {field.name: float(point[field.name]) for field in fields(Row) if field.type in {float, "float"}}
    texts = {name: tuple(point[name]) for name in ("left_out", "warnings")}
    return Row(**{**point, **numbers, **texts})
