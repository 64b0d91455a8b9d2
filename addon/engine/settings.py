# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's and our scene properties as frozen values."""

from dataclasses import dataclass
from typing import Any

from ..scene import Channel, DebugView, RenderSettings


@dataclass(frozen=True)
class FinalSettings:
    """Settings of a final render; `time_limit` in seconds, 0 for none."""

    render: RenderSettings
    time_limit: float


def _common(scene: Any) -> dict[str, Any]:
    """What the final render and the viewport share."""
    ours = scene.deep_gbuffer
    return {
        "layers": ours.layers,
        "minimum_separation": ours.minimum_separation,
        "filter_radius": scene.render.filter_size,
        "transparent_film": scene.render.film_transparent,
        "debug_view": DebugView(ours.debug_view),
        "debug_layer": min(ours.debug_layer, ours.layers) - 1,
        "seed": ours.seed,
    }


def final(
    scene: Any, width: int, height: int, channels: frozenset[Channel], samples: int | None = None
) -> FinalSettings:
    """Settings of a final render of `width` x `height` pixels that delivers `channels`.

    `samples` overrides the scene's number, for previews: they write no layers either.
    """
    ours = scene.deep_gbuffer
    render = RenderSettings(
        width=width,
        height=height,
        samples=samples or ours.samples,
        channels=channels,
        deep_output=samples is None and (ours.save_layers or ours.save_deep),
        **_common(scene),
    )
    return FinalSettings(render, ours.time_limit)


def viewport(scene: Any, width: int, height: int) -> RenderSettings:
    """Settings of a viewport of `width` x `height` pixels."""
    return RenderSettings(width=width, height=height, samples=scene.deep_gbuffer.viewport_samples, **_common(scene))
