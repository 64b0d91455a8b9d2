# SPDX-License-Identifier: GPL-3.0-or-later
"""The report on deep G-buffer generation, from what was measured."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean, median

from addon.scene import Layering, Variant
from blender_tests.bench._clips import Clip
from blender_tests.bench._errors import Errors
from blender_tests.bench._measuring import GEOMETRY_PASSES, Figures
from blender_tests.bench._plot import Point
from blender_tests.bench._runs import table

LAYERS = (2, 4)
SEPARATIONS = (0.0, 0.05, 0.5)
SHOWN_SEPARATION = 0.5
"""The default Δz, for which there are a summary and a plot."""
ONE_LAYER = "one layer"
METHODS = (Layering.GEOMETRY_SHADER, Layering.VERTEX_SHADER)
ONE_PASS = (Variant.PREPASS, Variant.DELAY, Variant.PREVIOUS, Variant.REPROJECT)
"""What the layering methods are compared with; Predict draws what Delay draws."""

Measured = dict[tuple[int, float], dict[str, Figures]]
"""Per number of layers and Δz: the figures of every variant and of one layer, by name."""

_ERROR_COLUMNS = ["violating Δz, %", "layer 1 differs, %", "layer 1 missed, %", "occlusion, RMSE ·10⁻³"]
_LEGEND = f"""
**time**: of the geometry stage, which makes the layers ({" and ".join(f"`{name}`" for name in GEOMETRY_PASSES)}),
relative to one layer in the same frame; **with begin**: with what comes before it in every frame, uploads,
extrapolation and planning, relative to the same of one layer. **MiB**: of the targets it writes. **violating Δz**: some
layer lies no more than Δz behind the one before. **layer 1 differs**: it is there in one of the two only, or at another
depth. These are shares of the covered pixels; **layer 1 missed** is the share of Two-Pass's layer 1 that is not there.
**occlusion**: root mean square difference of an obscurance estimate (0…1, within 0.75 m) that takes the most occluding
layer of every tap; the row "{ONE_LAYER}" says what doing without the others would cost. Layers are counted from 0.
"""


@dataclass(frozen=True)
class LayeringRow:
    """Milliseconds of Two-Pass, and per one-pass variant the time of one layering method relative to it."""

    clip: str
    layers: int
    method: Layering
    two_pass: float
    ratios: tuple[float, ...]


def title(name: str) -> str:
    """`TWO_PASS` as Two-Pass; other names as they are."""
    return name.replace("_", "-").title() if name.isupper() else name


def described(method: Layering) -> str:
    """`GEOMETRY_SHADER` as geometry shader."""
    return method.value.replace("_", " ").lower()


def document(notes: str, clips: Sequence[Clip], results: dict[str, Measured], layering: Sequence[LayeringRow]) -> str:
    """The whole report as Markdown; `notes` come first."""
    parts = [
        notes,
        f"\n## Over all sequences, Δz = {SHOWN_SEPARATION:g} m\n\nMedian times; errors as mean (worst).\n\n",
        table(["variant", "layers", "time", "MiB", *_ERROR_COLUMNS], summary_rows(results)),
        "\n![Error against time](generation.png)\n",
        _LEGEND,
        "\n## By sequence\n\nSeveral figures in a cell are one for each Δz.\n",
    ]
    header = ["variant", "layers", "time", "with begin", "MiB", *_ERROR_COLUMNS]
    for clip in clips:
        name = clip.name[0].upper() + clip.name[1:]
        separations = each(separations_of(results[clip.name]), "{:g}")
        parts.append(f"\n### {name}\n\n{triangles(clip):,} triangles; {clip.motion}. Δz = {separations} m.\n\n")
        parts.append(table(header, variant_rows(results[clip.name])))
    parts.append(
        "\n## One pass over the geometry, by layering method\n\nMilliseconds of Two-Pass, and times relative to it in "
        f"the same frames, Δz = {SHOWN_SEPARATION:g} m. Predict draws what Delay draws.\n\n"
    )
    header = ["sequence", "layers", "method", "Two-Pass, ms", *map(title, ONE_PASS)]
    parts.append(table(header, layering_rows(layering)))
    return "".join((*parts, "\n", *(verdict(method, layering) for method in METHODS)))


def summary_rows(results: dict[str, Measured]) -> list[list[str]]:
    """Over all sequences: median time and memory, mean and worst errors at the shown Δz."""
    rows: list[list[str]] = []
    for layers in LAYERS:
        groups = [measured[layers, SHOWN_SEPARATION] for measured in results.values()]
        for name in groups[0]:
            time = median(group[name].relative_to(group[ONE_LAYER]) for group in groups)
            size = median(group[name].bytes for group in groups)
            found = zip(*(_shown(group[name].error) for group in groups), strict=True)
            errors = [f"{fmean(values):.2f} ({max(values):.2f})" if any(values) else "0" for values in found]
            rows.append([title(name), str(layers), f"{time:.2f}", f"{size / 2**20:.1f}", *errors])
    return rows


def variant_rows(measured: Measured) -> list[list[str]]:
    """The table of one sequence: a line per variant and number of layers; the cells have a figure per Δz."""
    rows: list[list[str]] = []
    for layers in LAYERS:
        groups = [measured[layers, separation] for separation in separations_of(measured)]
        for name in groups[0]:
            times = [group[name].relative_to(group[ONE_LAYER]) for group in groups]
            whole = [group[name].relative_to(group[ONE_LAYER], with_begin=True) for group in groups]
            errors = zip(*(_shown(group[name].error) for group in groups), strict=True)
            rows.append(
                [
                    title(name),
                    str(layers),
                    each(times, "{:.2f}"),
                    each(whole, "{:.2f}"),
                    f"{groups[0][name].bytes / 2**20:.1f}",
                    *(each(values, "{:.2f}") for values in errors),
                ]
            )
    return rows


def layering_rows(rows: Sequence[LayeringRow]) -> list[list[str]]:
    """The table of layering methods."""
    return [
        [
            row.clip,
            str(row.layers),
            described(row.method),
            f"{row.two_pass:.0f}",
            *(f"{ratio:.2f}" for ratio in row.ratios),
        ]
        for row in rows
    ]


def verdict(method: Layering, rows: Sequence[LayeringRow]) -> str:
    """Whether one pass over the geometry costs no more than two at two layers, as a line of a list."""
    ratios = [round(ratio, 2) for row in rows if row.method is method and row.layers == 2 for ratio in row.ratios]
    dearer = [ratio for ratio in ratios if ratio > 1.0]
    answer = "yes, always"
    if dearer:
        answer = (
            f"no, more in {len(dearer)} of {len(ratios)} cases ({min(ratios):.2f} to {max(ratios):.2f} times as much)"
        )
    return f"- By {described(method)}, does one pass cost no more than Two-Pass at two layers? {answer}.\n"


def points(results: dict[str, Measured]) -> list[Point]:
    """What the plot shows: every variant in every sequence at the shown Δz."""
    return [
        Point(
            layers,
            title(name),
            clip,
            figures.relative_to(measured[layers, SHOWN_SEPARATION][ONE_LAYER]),
            100.0 * figures.error.differing,
        )
        for clip, measured in results.items()
        for layers in LAYERS
        for name, figures in measured[layers, SHOWN_SEPARATION].items()
        if name != ONE_LAYER
    ]


def triangles(clip: Clip) -> int:
    """Triangles of a frame, instances counted."""
    scene = clip.moments[0].scene
    return sum(len(scene.meshes[batch.mesh].triangles) * batch.count for batch in scene.batches)


def separations_of(measured: Measured) -> list[float]:
    """Every Δz that was measured, rising."""
    return sorted({separation for _, separation in measured})


def each(values: Iterable[float], pattern: str) -> str:
    """The figures one after the other; a single 0 where all are nothing."""
    listed = list(values)
    return " / ".join(pattern.format(value) for value in listed) if any(listed) else "0"


def _shown(errors: Errors) -> tuple[float, ...]:
    """The figures of the error columns, in their units."""
    return 100 * errors.violating, 100 * errors.differing, 100 * errors.missed, 1000 * errors.occlusion
