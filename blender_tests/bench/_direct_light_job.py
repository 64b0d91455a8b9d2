# SPDX-License-Identifier: GPL-3.0-or-later
"""Every case of direct light through both engines; runs in Blender. Arguments: the file for the figures, width, height.

The figures are JSON, an object per case; they are written after each case, so that what there is can be read.
"""

import json
import os
import sys
import tempfile
import time
from pathlib import Path

from agreement_cases import LIGHTS, NOISY, WORLDS, Case
from agreement_fixtures import DIRECT_PASSES, Pair, prepare, prepare_cycles, render_passes
from agreement_measures import difference
from agreement_scenes import METAL, PLASTIC
from agreement_torture import TORTURE

import addon

OUR_SAMPLES = 256
CYCLES_SAMPLES, NOISY_SAMPLES = 256, 512
GLOSSY = ("point, sphere", "rectangle", "sun, wide", "world, panorama")


def cases() -> dict[str, Case]:
    """What is measured, by the name that the table gives it."""
    known = LIGHTS | WORLDS
    glossy = {
        f"{name}, on {surface}": lambda *size, build=known[name], values=values: build(*size, ground=values)
        for name in GLOSSY
        for surface, values in (("metal", METAL), ("plastic", PLASTIC))
    }
    return known | glossy | TORTURE


def measured(build: Case, samples: int, size: tuple[int, int], folder: Path) -> dict[str, float]:
    """One case: how far we are from Cycles, how exactly Cycles is known, and the seconds taken.

    Cycles' picture is the mean of two with half of the samples each. Half their difference is as large as its error.
    """
    scene = build(*size)
    prepare(scene, DIRECT_PASSES)
    prepare_cycles(scene, samples // 2)
    scene.deep_gbuffer.samples = OUR_SAMPLES
    started = time.perf_counter()
    halves = []
    for seed in (0, 1):
        scene.cycles.seed = seed
        halves.append(render_passes(scene, "CYCLES", folder))
    theirs = {name: 0.5 * (halves[0][name] + halves[1][name]) for name in halves[0]}
    between = time.perf_counter()
    pair = Pair(theirs, render_passes(scene, "DEEP_GBUFFER", folder))
    ended = time.perf_counter()
    found, diffuse, glossy = pair.difference(), pair.difference("Diffuse"), pair.difference("Glossy")
    half = Pair(theirs, halves[0])
    noise = difference(*half.reflected(), half.covered)
    return {
        **{"mean": found.mean, "off": found.off, "total": found.total, "diffuse": diffuse.mean, "glossy": glossy.mean},
        **{"noise": noise.mean, "noise_off": noise.off, "cycles_s": between - started, "our_s": ended - between},
    }


def main(output: str, width: str, height: str) -> None:
    """Measure all cases."""
    addon.register()
    figures: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_bench_") as folder:
        for name, build in cases().items():
            samples = NOISY_SAMPLES if name.startswith(NOISY) else CYCLES_SAMPLES
            figures[name] = measured(build, samples, (int(width), int(height)), Path(folder))
            figures[name]["own_limits"] = name in TORTURE
            print(f"{name}: {figures[name]}", flush=True)
            Path(output).write_text(json.dumps(figures), encoding="utf-8")
    addon.unregister()


if __name__ == "__main__":
    main(*sys.argv[1:])
    sys.stdout.flush()
    os._exit(0)  # Blender 4.5 may wait for ever at exit once it had a GL context of its own
