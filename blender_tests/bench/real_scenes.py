# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the time goes on real scenes: the engine's own statistics, cold and warm, at 640×360."""

import sys
import tempfile
from pathlib import Path
from typing import Any

from blender_tests.bench._runs import REPOSITORY, RESOLUTION, SAMPLES, SHARED, render, report, table

SCENES = (
    SHARED / "sponza" / "sponza.blend",
    SHARED / "living_room" / "living_room.blend",
    REPOSITORY / "scenes" / "colonnade.blend",
)
TIMES = ("sync_s", "upload_s", "first_picture_s", "sample_s", "total_s")
REPEATS = 3


def row(name: str, state: str, entry: dict[str, Any]) -> list[str]:
    """One line of the table."""
    milliseconds = [f"{1000.0 * entry[key]:.0f}" for key in TIMES]
    megabytes = sum(entry["bytes"].values()) / 2**20
    counts = [f"{entry[key]:,}" for key in ("triangles", "draws", "instances")]
    return [name, state, *milliseconds, *counts, f"{megabytes:.0f}"]


def main(arguments: list[str]) -> int:
    """Run the bench."""
    if arguments:
        print("real_scenes takes no arguments")
        return 2
    rows = []
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_bench_") as folder:
        for blend in SCENES:
            if not blend.is_file():
                print(f"left out, as it is not there: {blend.name}")
                continue
            scratch = Path(folder)
            run = render(blend, "DEEP_GBUFFER", scratch, scratch / f"{blend.stem} shaders", repeat=REPEATS)
            rows.append(row(blend.stem, "cold", run.statistics[0]))
            rows.append(row(blend.stem, "warm", run.statistics[-1]))
    header = [
        "scene",
        "",
        "sync",
        "upload",
        "first picture",
        "sample",
        "total",
        "triangles",
        "draws",
        "instances",
        "MiB",
    ]
    text = table(header, rows)
    text += f"\nMilliseconds; {RESOLUTION}, {SAMPLES} samples; cold: empty shader cache, warm: repeat {REPEATS}.\n"
    report("real_scenes", "Real scenes", text)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
