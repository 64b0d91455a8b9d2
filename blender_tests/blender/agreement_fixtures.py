# SPDX-License-Identifier: GPL-3.0-or-later
"""The same scene through Cycles and through Deep G-Buffer, as passes that can be compared pixel by pixel."""

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from agreement_measures import Difference, difference, write_sheet
from engine_fixtures import read_multilayer, use_multilayer

SMALLEST_FILTER = 0.01
"""Pixels. Both engines then look through the centre of each pixel: Cycles to within 0.02 pixel, measured."""

PASS_NAMES = {
    "DiffCol": "Diffuse Color",
    "DiffDir": "Diffuse Direct",
    "DiffInd": "Diffuse Indirect",
    "GlossCol": "Glossy Color",
    "GlossDir": "Glossy Direct",
    "Emit": "Emission",
    "Env": "Environment",
}
"""Names before Blender 5.0 -> names since."""

GEOMETRY_PASSES = ("z", "normal", "position", "diffuse_color")
DIRECT_PASSES = ("z", "diffuse_color", "diffuse_direct", "glossy_color", "glossy_direct", "emit", "environment")


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

    def reflected(self, *kinds: str) -> tuple[np.ndarray, np.ndarray]:
        """Ours and Cycles' radiance (H, W, 3) that surfaces reflect straight from lamps and world, of these kinds.

        A kind is Diffuse or Glossy; both where none is given. Blender's passes are radiance over colour.
        """
        ours, theirs = (
            np.sum([passes[f"{kind} Direct"] * passes[f"{kind} Color"] for kind in kinds or ("Diffuse", "Glossy")], 0)
            for passes in (self.ours, self.cycles)
        )
        return ours, theirs

    def difference(self, *kinds: str) -> Difference:
        """Of the reflected radiance of these kinds where both see a surface."""
        return difference(*self.reflected(*kinds), self.covered)

    def report(self, folder: Path) -> str:
        """What differs, by kind, for a test that fails; writes the pictures beside each other into `folder`."""
        sheet = write_sheet(folder / "ours_cycles_difference.png", *self.reflected())
        parts = [f"{kind.lower()} {self.difference(kind)}" for kind in ("Diffuse", "Glossy")]
        return f"{self.difference()}; {'; '.join(parts)}; see {sheet}"


def render_pair(
    scene: bpy.types.Scene,
    folder: Path,
    *,
    cycles_samples: int = 1,
    our_samples: int = 1,
    passes: tuple[str, ...] = GEOMETRY_PASSES,
) -> Pair:
    """Render with both engines through pixel centres, at the scene's resolution."""
    prepare(scene, passes)
    prepare_cycles(scene, cycles_samples)
    scene.deep_gbuffer.samples = our_samples
    return Pair(render_passes(scene, "CYCLES", folder), render_passes(scene, "DEEP_GBUFFER", folder))


def prepare(scene: bpy.types.Scene, passes: tuple[str, ...]) -> None:
    """Ask for passes, through pixel centres, of the first view layer; our light is not reflected twice."""
    for name in passes:
        setattr(scene.view_layers[0], f"use_pass_{name}", True)
    scene.render.use_compositing = scene.render.use_sequencer = False
    scene.render.filter_size = SMALLEST_FILTER
    scene.deep_gbuffer.indirect.method = "NONE"


def prepare_cycles(scene: bpy.types.Scene, samples: int) -> None:
    """Make Cycles an unbiased reference: nothing clamped, blurred, left out or stopped early."""
    cycles = scene.cycles
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = samples, False, False
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", SMALLEST_FILTER
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.light_sampling_threshold, cycles.blur_glossy, cycles.seed = 0.0, 0.0, 0


def render_passes(scene: bpy.types.Scene, engine: str, folder: Path) -> dict[str, np.ndarray]:
    """All passes (H, W, C) of one engine by Blender 5's names, row 0 at the top."""
    scene.render.engine = engine
    use_multilayer(scene)
    path = folder / f"{engine}.exr"
    scene.render.filepath = str(path)
    assert bpy.ops.render.render(write_still=True, scene=scene.name) == {"FINISHED"}
    passes = {name.rsplit(".", 1)[-1]: pixels for name, pixels in read_multilayer(path).items()}
    return {PASS_NAMES.get(name, name): pixels for name, pixels in passes.items()}
