# SPDX-License-Identifier: GPL-3.0-or-later
"""What to render, as one frozen value: equal settings and scene give equal pictures."""

from dataclasses import dataclass
from enum import StrEnum


class Channel(StrEnum):
    """Images the film can deliver; the engine's table of passes maps them to Blender's names.

    COMBINED: RGBA premultiplied radiance, mean over samples. DEPTH: view depth (m) of sample 0, 1e10 where empty.
    NORMAL: world-space shading normal, mean. POSITION: world-space position (m), sample 0.
    DIFFUSE_COLOR: diffuse albedo, mean. OBJECT_INDEX: pass index of sample 0.
    """

    COMBINED = "COMBINED"
    DEPTH = "DEPTH"
    NORMAL = "NORMAL"
    POSITION = "POSITION"
    DIFFUSE_COLOR = "DIFFUSE_COLOR"
    OBJECT_INDEX = "OBJECT_INDEX"


class DebugView(StrEnum):
    """What the picture shows instead of the composite: one channel of the deep G-buffer."""

    NONE = "NONE"
    DEPTH = "DEPTH"
    NORMAL = "NORMAL"
    ALBEDO = "ALBEDO"
    METALLIC = "METALLIC"
    ROUGHNESS = "ROUGHNESS"
    EMISSION = "EMISSION"
    OBJECT_INDEX = "OBJECT_INDEX"
    DIRECT = "DIRECT"


MAXIMUM_LAYERS = 8


@dataclass(frozen=True)
class RenderSettings:
    """Settings of one view.

    `width`, `height`: pixels. `samples`: how many the film accumulates.
    `layers` 1…8 and `minimum_separation` (Δz ≥ 0, m): of the deep G-buffer.
    `filter_radius`: radius of the Blackman–Harris pixel filter, pixels (Blender's Filter Size).
    `channels`: images besides COMBINED that somebody will read. `deep_output`: whether somebody reads the layers
    themselves (multi-layer or deep EXR). `debug_view` of layer `debug_layer` (0-based) replaces the composite.
    `transparent_film`: background alpha 0. `alpha_threshold`: surfaces with less alpha are not there.
    `seed` shifts every sampling pattern.
    """

    width: int
    height: int
    samples: int = 16
    layers: int = 2
    minimum_separation: float = 0.5
    filter_radius: float = 1.5
    channels: frozenset[Channel] = frozenset()
    deep_output: bool = False
    debug_view: DebugView = DebugView.NONE
    debug_layer: int = 0
    transparent_film: bool = False
    alpha_threshold: float = 0.5
    seed: int = 0
