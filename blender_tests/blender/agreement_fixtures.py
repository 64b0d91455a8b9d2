# SPDX-License-Identifier: GPL-3.0-or-later
"""The same scene through Cycles and through Deep G-Buffer, as passes that can be compared pixel by pixel."""

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from engine_fixtures import read_multilayer, use_multilayer

SMALLEST_FILTER = 0.01
"""Pixels. Both engines then look through the centre of each pixel: Cycles to within 0.02 pixel, measured."""

PASS_NAMES = {"DiffCol": "Diffuse Color", "DiffDir": "Diffuse Direct"}
"""Names before Blender 5.0 -> names since."""


@dataclass(frozen=True)
class Pair:
    """Passes of Cycles and of ours, (H, W, C) float32 by Blender 5's names; `covered` where both see a surface."""

    cycles: dict[str, np.ndarray]
    ours: dict[str, np.ndarray]

    @property
    def coverage(self) -> tuple[np.ndarray, np.ndarray]:
        """(H, W) where each engine sees a surface: Cycles writes depth 1e10 elsewhere."""
        return self.cycles["Depth"][..., 0] < 1e9, self.ours["Depth"][..., 0] < 1e9

    @property
    def covered(self) -> np.ndarray:
        """(H, W) where both see a surface."""
        theirs, ours = self.coverage
        return theirs & ours


def render_pair(scene: bpy.types.Scene, folder: Path, *, cycles_samples: int = 1, our_samples: int = 1) -> Pair:
    """Render with both engines through pixel centres, at the scene's resolution."""
    layer = scene.view_layers[0]
    for name in ("z", "normal", "position", "diffuse_color"):
        setattr(layer, f"use_pass_{name}", True)
    scene.render.use_compositing = scene.render.use_sequencer = False
    scene.render.filter_size = SMALLEST_FILTER
    cycles = scene.cycles
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = cycles_samples, False, False
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", SMALLEST_FILTER
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    scene.deep_gbuffer.samples = our_samples
    return Pair(_render(scene, "CYCLES", folder), _render(scene, "DEEP_GBUFFER", folder))


def _render(scene: bpy.types.Scene, engine: str, folder: Path) -> dict[str, np.ndarray]:
    scene.render.engine = engine
    use_multilayer(scene)
    path = folder / f"{engine}.exr"
    scene.render.filepath = str(path)
    assert bpy.ops.render.render(write_still=True, scene=scene.name) == {"FINISHED"}
    passes = {name.rsplit(".", 1)[-1]: pixels for name, pixels in read_multilayer(path).items()}
    return {PASS_NAMES.get(name, name): pixels for name, pixels in passes.items()}
