# SPDX-License-Identifier: GPL-3.0-or-later
"""What the last final render of each scene cost, as one JSON object per render."""

import statistics as mathematics
from dataclasses import dataclass, field
from typing import Any

import bpy

from ..render import RenderStatistics

ENGINE = "DEEP_GBUFFER"

_last: dict[str, dict[str, Any]] = {}


@dataclass
class Measured:
    """One view layer's render. Times in seconds from the start of that layer's render.

    `ended_by`: the limit that ended it, "" where it was cancelled.
    """

    sync_s: float = 0.0
    first_picture_s: float = 0.0
    total_s: float = 0.0
    sample_times: list[float] = field(default_factory=list[float])
    ended_by: str = ""
    warnings: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    renderer: RenderStatistics | None = None

    @property
    def sample_s(self) -> float:
        """Median seconds of a warm sample: the first one warms up, and counts only when it is alone."""
        times = self.sample_times[1:] or self.sample_times
        return mathematics.median(times) if times else 0.0


def last(scene_name: str) -> dict[str, Any] | None:
    """The statistics of the last final render of that scene, or None: keys and units of `as_object`."""
    return _last.get(scene_name)


def record(scene_name: str, layers: list[Measured]) -> None:
    """Keep the statistics of a frame whose view layers, in order of rendering, are `layers`."""
    _last[scene_name] = as_object(layers)


def forget(scene_name: str) -> None:
    """Forget that scene's: another render of it begins, and may fail."""
    _last.pop(scene_name, None)


def clear() -> None:
    """Forget everything."""
    _last.clear()


def as_object(layers: list[Measured]) -> dict[str, Any]:
    """One JSON object for a frame.

    Seconds: `sync_s`, `upload_s`, `total_s` (sums over view layers), `first_picture_s` (until the first sample of
    the first layer is in Blender's result), `sample_s` (median warm sample of all layers).
    `samples` per layer, and the limit they were `ended_by` in the last one, "" where it was cancelled.
    `passes` [{name, ms}]; `left_out` [{name, reason}]; `triangles`, `draws`, `instances` and
    `bytes` {target: n} of the layer that has most of them; `warnings` [text]; `files` [path] of the layer
    output; `engine`, `device`, `blender`.
    """
    rendered = [layer.renderer for layer in layers if layer.renderer is not None]
    passes: dict[str, float] = {}
    left_out: dict[str, str] = {}
    for renderer in rendered:
        for name, milliseconds in renderer.passes:
            passes[name] = passes.get(name, 0.0) + milliseconds
        left_out |= dict(renderer.left_out)
    return {
        "sync_s": sum(layer.sync_s for layer in layers),
        "upload_s": sum(renderer.upload_s for renderer in rendered),
        "first_picture_s": layers[0].first_picture_s if layers else 0.0,
        "sample_s": mathematics.median([layer.sample_s for layer in layers]) if layers else 0.0,
        "total_s": sum(layer.total_s for layer in layers),
        "samples": max((len(layer.sample_times) for layer in layers), default=0),
        "ended_by": layers[-1].ended_by if layers else "",
        "passes": [{"name": name, "ms": milliseconds} for name, milliseconds in passes.items()],
        "left_out": [{"name": name, "reason": reason} for name, reason in left_out.items() if name not in passes],
        "triangles": max((renderer.triangles for renderer in rendered), default=0),
        "draws": max((renderer.draws for renderer in rendered), default=0),
        "instances": max((renderer.instances for renderer in rendered), default=0),
        "bytes": dict(max((renderer.bytes for renderer in rendered), key=lambda item: sum(item.values()), default={})),
        "warnings": list(dict.fromkeys(text for layer in layers for text in layer.warnings)),
        "files": [path for layer in layers for path in layer.files],
        "engine": ENGINE,
        "device": rendered[-1].device if rendered else "",
        "blender": bpy.app.version_string,
    }
