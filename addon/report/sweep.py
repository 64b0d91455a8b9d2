# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report measures: one table of series. A new method joins with one line."""

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ..scene import IndirectMethod
from ..scene.quality import DEFAULT_QUALITY, QUALITIES
from .reference import REFERENCE_SETTINGS, UNBIASED

PRESETS = Path(__file__).resolve().parent.parent / "ui" / "presets" / "deep_gbuffer"
PERCENT = "resolution_percentage"
"""A setting of the scene, not of an engine: the picture is rendered at this percentage of its width and height."""

Settings = Mapping[str, str]
"""Properties of the engine's own settings, as `build.py render --set` takes them."""


@dataclass(frozen=True)
class Point:
    """One way to render a scene."""

    series: str
    label: str
    engine: str
    settings: Settings

    @property
    def is_peer(self) -> bool:
        """Whether another engine than ours renders it."""
        return self.engine != OURS

    @property
    def identity(self) -> tuple[str, tuple[tuple[str, str], ...]]:
        """Equal for points with the same settings, whatever they are called."""
        return self.engine, tuple(sorted(self.settings.items()))


@dataclass(frozen=True)
class Series:
    """Points that differ in one thing.

    `values` maps each point's label to its settings, which come on top of `base`; `quick` names those of the short
    report.
    """

    name: str
    engine: str
    values: Mapping[str, Settings]
    base: Settings = field(default_factory=dict[str, str])
    quick: tuple[str, ...] = ()

    def points(self, *, quick: bool) -> list[Point]:
        """All points, or those of the short report."""
        return [
            Point(self.name, label, self.engine, {**self.base, **settings})
            for label, settings in self.values.items()
            if not quick or label in self.quick
        ]


def each(name: str, values: Iterable[object], label: str = "{}") -> dict[str, Settings]:
    """One point per value of the property `name`, labelled by `label` filled with the value."""
    return {label.format(value): {name: str(value)} for value in values}


def named(name: str, values: Mapping[str, object]) -> dict[str, Settings]:
    """One point per value of the property `name`, by the labels of `values`."""
    return {label: {name: str(value)} for label, value in values.items()}


def presets(folder: str) -> dict[str, Settings]:
    """One point per preset file in our presets' `folder`, with every engine setting that it makes."""
    return {path.stem: _assignments(path) for path in sorted((PRESETS / folder).glob("*.py"))}


def _assignments(path: Path) -> Settings:
    """Name and value of every `settings.NAME = VALUE` line in a preset file that concerns final renders."""
    found: dict[str, str] = {}
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if not isinstance(node, ast.Assign) or not isinstance(target := node.targets[0], ast.Attribute):
            continue
        if not target.attr.startswith("viewport_"):
            found[target.attr] = str(ast.literal_eval(node.value))
    return found


OURS = "DEEP_GBUFFER"
NO_FILES = {"save_layers": "False", "save_deep": "False", "save_snapshot": "False"}
"""What is measured is the picture, and files of the scene's own must not be written again."""

PICTURE = {**NO_FILES, "debug_view": "NONE", "time_limit": "0", "use_noise_threshold": "False"}
"""Nothing of the file's own shows something else, writes files or stops early."""

STRUCTURE = {**PICTURE, "samples": "4"}
"""What the axes other than the number of samples are measured with."""

METHOD = "indirect.method"
EXIT = "indirect.exit_surfaces"
LAYERED = each("layers", (1, 2, 4))

DENOISED = {
    **UNBIASED,
    "use_denoising": "True",
    "denoiser": "OPENIMAGEDENOISE",
    "denoising_prefilter": "FAST",
    "denoising_quality": "FAST",
}
EEVEE = {"use_raytracing": "True"}

SWEEP = (
    Series(
        "Samples",
        OURS,
        each("samples", (1, 4, 16, 64), "{} spp"),
        PICTURE,
        quick=("1 spp", "4 spp", "16 spp", "64 spp"),
    ),
    Series("Sampling preset", OURS, presets("sampling"), PICTURE),
    Series(
        "Method",
        OURS,
        named(
            METHOD,
            {
                "direct light only": IndirectMethod.NONE,
                "ambient occlusion": IndirectMethod.OCCLUSION,
                "SSAO": IndirectMethod.SSAO,
                "radiosity": IndirectMethod.RADIOSITY,
                "deep march": IndirectMethod.DEEP_MARCH,
            },
        ),
        STRUCTURE,
        quick=("direct light only", "deep march"),
    ),
    Series(
        "Indirect quality",
        OURS,
        {
            quality.value.capitalize(): {"indirect.render.preset": quality.value}
            for quality in QUALITIES
            if quality is not DEFAULT_QUALITY
        },
        STRUCTURE,
        quick=("Draft",),
    ),
    Series("Contact steps", OURS, each("indirect.render.contact_steps", (0, 8)), STRUCTURE),
    Series(
        "Bounces",
        OURS,
        {**each("indirect.bounces", (1, 2)), **named("indirect.unlimited_bounces", {"∞": True})},
        STRUCTURE,
    ),
    Series("Layers, exit surfaces", OURS, LAYERED, {**STRUCTURE, EXIT: "True"}),
    Series("Deep march, layers", OURS, LAYERED, {**STRUCTURE, METHOD: IndirectMethod.DEEP_MARCH}),
    Series(
        "Deep march, layers, exit surfaces",
        OURS,
        LAYERED,
        {**STRUCTURE, METHOD: IndirectMethod.DEEP_MARCH, EXIT: "True"},
    ),
    Series("Radiosity, layers", OURS, LAYERED, {**STRUCTURE, METHOD: IndirectMethod.RADIOSITY}),
    Series("Ambient occlusion, layers", OURS, LAYERED, {**STRUCTURE, METHOD: IndirectMethod.OCCLUSION}),
    Series("Resolution scale", OURS, each(PERCENT, (50, 75), "{} %"), STRUCTURE, quick=("50 %",)),
    Series("Layers", OURS, {**LAYERED, **each("layers", (8,))}, STRUCTURE, quick=("1",)),
    Series("Minimum separation", OURS, each("minimum_separation", (0, 0.05, 1), "{} m"), STRUCTURE),
    Series("Layer preset", OURS, presets("layers"), STRUCTURE),
    Series(
        "Variant",
        OURS,
        each("variant", ("PREPASS", "DELAY", "PREVIOUS", "PREDICT", "REPROJECT")),
        STRUCTURE,
    ),
    Series(
        "Cycles",
        "CYCLES",
        each("samples", (1, 4, 16), "{} spp"),
        REFERENCE_SETTINGS,
        quick=("1 spp", "4 spp", "16 spp"),
    ),
    Series("Cycles, denoised", "CYCLES", each("samples", (1, 4, 16), "{} spp"), DENOISED, quick=("1 spp", "4 spp")),
    Series("EEVEE", "EEVEE", each("taa_render_samples", (1, 16), "{} spp"), EEVEE, quick=("1 spp",)),
    Series("Workbench", "WORKBENCH", {"": {}}, quick=("",)),
)


def points(*, quick: bool) -> list[Point]:
    """Every point of the table; those with the same settings under two names only under the first."""
    found: dict[object, Point] = {}
    for series in SWEEP:
        for point in series.points(quick=quick):
            found.setdefault(point.identity, point)
    return list(found.values())
