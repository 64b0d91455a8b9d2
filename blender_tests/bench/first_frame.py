# SPDX-License-Identifier: GPL-3.0-or-later
"""From nothing to a picture: Cornell at 640×360 with 16 samples, process start included, against EEVEE."""

import statistics
import sys
import tempfile
from pathlib import Path

from blender_tests.bench._runs import REPOSITORY, RESOLUTION, SAMPLES, render, report, table
from tooling.machine import machine

SCENE = REPOSITORY / "scenes" / "cornell_box.blend"
ENGINES = ("DEEP_GBUFFER", "EEVEE")
STATES = ("empty", "filled by the run before")
ROUNDS = 3
TARGET = 5.0


def main(arguments: list[str]) -> int:
    """Run the bench; exit code 1 where EEVEE takes less than TARGET times as long in any state of the shader cache."""
    if arguments:
        print("first_frame takes no arguments")
        return 2
    seconds: dict[tuple[str, str], list[float]] = {(engine, state): [] for engine in ENGINES for state in STATES}
    for _ in range(ROUNDS):
        with tempfile.TemporaryDirectory(prefix="deep_gbuffer_bench_") as folder:
            scratch = Path(folder)
            for engine, state in ((engine, state) for state in STATES for engine in ENGINES):
                run = render(SCENE, engine, scratch, scratch / f"{engine} shaders")
                seconds[engine, state].append(run.seconds)
    rows, ratios = [], []
    for state in STATES:
        ours, eevee = (statistics.median(seconds[engine, state]) for engine in ENGINES)
        ratios.append(eevee / ours)
        rows.append([state, f"{ours:.2f} s", f"{eevee:.2f} s", f"{ratios[-1]:.1f}×"])
    text = table(["driver's shader cache", "Deep G-Buffer", "EEVEE", "ratio"], rows)
    text += (
        f"\nWall time of `build.py render`, process start included: {RESOLUTION}, {SAMPLES} samples, "
        f"median of {ROUNDS} alternating runs; target: {TARGET:.0f}× or more in every row. Machine: {machine()}.\n"
    )
    report("first_frame", "First frame", text)
    return 0 if min(ratios) >= TARGET else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
