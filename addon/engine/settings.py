# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's and our scene properties as frozen values."""

from dataclasses import dataclass, fields
from enum import StrEnum
from math import ceil
from typing import Any

from ..scene import Channel, DebugView, IndirectMethod, IndirectSettings, RenderSettings, ShadingModel, Variant
from ..scene.quality import QualityNumbers


class SeparationUnit(StrEnum):
    """What the minimum separation is measured in: metres, or the nearer layer's view depth."""

    DISTANCE = "DISTANCE"
    RELATIVE = "RELATIVE"


class GuardBandUnit(StrEnum):
    """What the guard band is measured in: pixels, or percent of the picture's longer side."""

    PIXELS = "PIXELS"
    PERCENT = "PERCENT"


@dataclass(frozen=True)
class FinalSettings:
    """Settings of a final render; `time_limit` in seconds, `noise_threshold` as of `noise_left`, 0 for none."""

    render: RenderSettings
    time_limit: float = 0.0
    noise_threshold: float = 0.0


def final(
    scene: Any, width: int, height: int, channels: frozenset[Channel], samples: int | None = None
) -> FinalSettings:
    """Settings of a final render of `width` x `height` pixels that delivers `channels`.

    `samples` overrides the scene's number, for previews: they write no layers either.
    """
    ours = scene.deep_gbuffer
    writes_files = samples is None
    writes_layers = writes_files and ours.save_layers
    deep_output = writes_layers or (writes_files and ours.save_deep)
    render = RenderSettings(
        width=width,
        height=height,
        samples=samples or ours.samples,
        channels=channels,
        deep_output=deep_output,
        motion_vectors=writes_layers and ours.save_motion,
        exit_surfaces=deep_output and ours.save_exit,
        indirect=indirect(ours.indirect, ours.indirect.render),
        **_common(scene, width, height),
    )
    return FinalSettings(render, ours.time_limit, ours.noise_threshold if ours.use_noise_threshold else 0.0)


def viewport(scene: Any, width: int, height: int) -> RenderSettings:
    """Settings of a viewport of `width` x `height` pixels."""
    ours = scene.deep_gbuffer
    return RenderSettings(
        width=width,
        height=height,
        samples=ours.viewport_samples,
        indirect=indirect(ours.indirect, ours.indirect.viewport),
        **_common(scene, width, height),
    )


def indirect(group: Any, quality: Any) -> IndirectSettings:
    """What `Scene.deep_gbuffer.indirect` says, with the numbers of its render's or its viewport's `quality`."""
    return IndirectSettings(
        method=IndirectMethod(group.method),
        bounces=None if group.unlimited_bounces else group.bounces,
        radius=group.radius,
        march_distance=group.march_distance,
        exit_surfaces=group.exit_surfaces,
        cell_size=group.cell_size,
        grid_memory=int(group.grid_memory),
        spatial_filter=group.spatial_filter,
        temporal_filter=group.temporal_filter,
        paper_composite=group.paper_composite,
        **{field.name: int(getattr(quality, field.name)) for field in fields(QualityNumbers)},
    )


def _common(scene: Any, width: int, height: int) -> dict[str, Any]:
    """What the final render and the viewport share."""
    ours = scene.deep_gbuffer
    relative = ours.separation_unit == SeparationUnit.RELATIVE
    return {
        "layers": ours.layers,
        "minimum_separation": ours.relative_separation if relative else ours.minimum_separation,
        "relative_separation": relative,
        "variant": Variant(ours.variant),
        "guard_band": _guard_band(ours, width, height),
        "filter_radius": scene.render.filter_size,
        "transparent_film": scene.render.film_transparent,
        "debug_view": DebugView(ours.debug_view),
        "debug_layer": min(ours.debug_layer, ours.layers) - 1,
        "seed": ours.seed,
        "shading_model": ShadingModel(ours.shading_model),
        "shadow_map_size": int(ours.shadow_map_size),
        "shadow_memory": int(ours.shadow_memory),
        "shadow_updates": ours.shadow_updates,
        "world_directions": ours.world_directions,
        "light_threshold": ours.light_threshold,
    }


def _guard_band(ours: Any, width: int, height: int) -> int:
    """Pixels a side around a picture of `width` x `height` pixels."""
    if not ours.use_guard_band:
        return 0
    if ours.guard_band_unit == GuardBandUnit.PIXELS:
        return ours.guard_band_pixels
    return ceil(max(width, height) * ours.guard_band_percent / 100.0)
