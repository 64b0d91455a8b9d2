# SPDX-License-Identifier: GPL-3.0-or-later
"""Time, memory and error of ways to build the layers, as a viewport builds them: one sample a frame, frame after frame.

The ways take turns within every frame, so that a machine's noise hits all alike.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from statistics import fmean, median
from typing import TypeVar

import numpy as np

from addon.render import Device, Renderer
from addon.scene import Layering, Moment, RenderSettings, Sequence, Variant
from addon.scene.arrays import Float32Array
from blender_tests.bench._clips import Clip
from blender_tests.bench._errors import Errors, Reference, errors

K = TypeVar("K")

GEOMETRY_PASSES = ("oracle", "gbuffer")
"""What makes the layers."""


@dataclass(frozen=True)
class Way:
    """One way to build layers."""

    layers: int
    separation: float
    variant: Variant = Variant.TWO_PASS
    layering: Layering = Layering.FASTEST

    @property
    def history(self) -> int:
        """Frames to draw before one that counts: programs are compiled then, and the variant has its history."""
        return 2 if self.variant in (Variant.PREVIOUS, Variant.PREDICT, Variant.REPROJECT) else 1


@dataclass
class Figures:
    """What was measured in every frame: milliseconds of the geometry stage, and of `Renderer.begin`; the errors.

    `bytes`: video memory of the targets that the geometry stage writes.
    """

    stage: list[float] = field(default_factory=list[float])
    begin: list[float] = field(default_factory=list[float])
    errors: list[Errors] = field(default_factory=list[Errors])
    bytes: int = 0

    @property
    def time(self) -> float:
        """Median milliseconds of the geometry stage."""
        return median(self.stage)

    def relative_to(self, other: "Figures", *, with_begin: bool = False) -> float:
        """Median over the frames of this geometry stage's time as a multiple of the other's in the same frame.

        `with_begin` counts what every frame needs before it as well: uploads, extrapolation, the plan.
        """
        mine, theirs = (
            [stage + with_begin * begin for stage, begin in zip(figures.stage, figures.begin, strict=True)]
            for figures in (self, other)
        )
        return median(first / second for first, second in zip(mine, theirs, strict=True))

    @property
    def error(self) -> Errors:
        """Shares are means over the frames, the occlusion's error is a root mean square."""
        return Errors(
            fmean(item.violating for item in self.errors),
            fmean(item.differing for item in self.errors),
            fmean(item.missed for item in self.errors),
            fmean(item.occlusion**2 for item in self.errors) ** 0.5,
        )


class Bench:
    """A renderer per way, by name; those of a name are used again for later ways. Lives on the GL thread."""

    def __init__(self, device: Device, width: int, height: int) -> None:
        self._device = device
        self._settings = RenderSettings(width, height, samples=1, filter_radius=0.0, deep_output=True)
        self._renderers: dict[object, Renderer] = {}

    def measure(self, clip: Clip, ways: Mapping[K, Way], frames: int, *, compare: bool = True) -> dict[K, Figures]:
        """Render the first frames of the clip in all ways, in turns: those that only build history, and `frames` more.

        Errors are against the first way; there are none without `compare`.
        """
        warm = max(way.history for way in ways.values())
        figures = {name: Figures() for name in ways}
        for index in range(warm + frames):
            reference: Reference | None = None
            for name, way in ways.items():
                if index < warm - way.history:
                    continue
                known = sequence(clip, index, warm - way.history, way.variant)
                taken = figures[name] if index >= warm else Figures()
                renderer = self._draw(clip.moments[index], known, name, way, taken)
                if index < warm or not compare:
                    continue
                depths = _depths(renderer, way)
                if reference is None:
                    reference = Reference(depths, renderer.read_layer(0).normal, clip.moments[index].camera)
                figures[name].errors.append(errors(depths, reference, way.separation))
        return figures

    def release(self) -> None:
        """Free everything."""
        for renderer in self._renderers.values():
            renderer.release()
        self._renderers.clear()

    def _draw(self, moment: Moment, known: Sequence, name: object, way: Way, figures: Figures) -> Renderer:
        """Draw one frame and take its times; the renderer that holds its layers."""
        if name not in self._renderers:
            self._renderers[name] = Renderer(self._device)
        renderer = self._renderers[name]
        settings = replace(
            self._settings,
            layers=way.layers,
            minimum_separation=way.separation,
            variant=way.variant,
            layering=way.layering,
        )
        start = time.perf_counter()
        renderer.begin(moment.scene, moment.camera, settings, known)
        figures.begin.append(1e3 * (time.perf_counter() - start))
        renderer.render_sample()
        statistics = renderer.statistics()
        figures.stage.append(sum(spent for name, spent in statistics.passes if name in GEOMETRY_PASSES))
        figures.bytes = sum(size for name, size in statistics.bytes.items() if _of_geometry_stage(name))
        return renderer


def sequence(clip: Clip, index: int, first: int, variant: Variant) -> Sequence:
    """What a viewport that began with frame `first` of the clip knows at frame `index`.

    Those are the frames before it and, as it lags by one for Delay, the next.
    """
    return Sequence(
        previous=clip.moments[index - 1] if index > first else None,
        earlier=clip.moments[index - 2] if index > first + 1 else None,
        following=clip.moments[index + 1] if variant is Variant.DELAY else None,
        continuous=True,
    )


def _depths(renderer: Renderer, way: Way) -> Float32Array:
    """View depths (n, H, W) of the layers that were drawn last."""
    return np.stack([renderer.read_layer(layer).depth for layer in range(way.layers)])


def _of_geometry_stage(target: str) -> bool:
    return target.startswith(("gbuffer.", "oracle", "depth"))
