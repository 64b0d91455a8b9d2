# SPDX-License-Identifier: GPL-3.0-or-later
"""Real scenes with direct light only, ours beside Cycles' without bounces: a sheet for the README, and FLIP."""

import sys
import tempfile
from pathlib import Path

from addon.report.metrics import display
from addon.report.pictures import combined
from blender_tests.bench._runs import REPOSITORY, SHARED, picture, report, table
from tooling.machine import machine
from tooling.report.pictures import flip, write_sheet

SCENES = {
    "Sponza, sun and sky": SHARED / "sponza" / "sponza.blend",
    "Living room": SHARED / "living_room" / "living_room.blend",
}
RESOLUTION = (480, 270)
OUR_SAMPLES = 256
HALF = 512
"""Samples of each of two pictures of Cycles: their mean is the reference, their difference tells its noise."""

LIMIT = 0.05
NAME = "direct_sheet"
SHEET = REPOSITORY / "scenes" / "pictures" / "direct_light.jpg"
CYCLES = {
    "max_bounces": 0,
    "use_adaptive_sampling": False,
    "use_denoising": False,
    "sample_clamp_direct": 0.0,
    "light_sampling_threshold": 0.0,
}


def main(arguments: list[str]) -> int:
    """Run the bench; exit code 1 where FLIP is above the limit in any scene."""
    if arguments:
        print(f"{NAME} takes no arguments")
        return 2
    rows, sheet, worst = [], [], 0.0
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_bench_") as folder:
        for name, blend in SCENES.items():
            if not blend.is_file():
                print(f"left out, as it is not there: {blend.name}")
                continue
            halves = [
                combined(
                    picture(blend, "CYCLES", Path(folder) / f"{seed}.exr", RESOLUTION, HALF, {**CYCLES, "seed": seed})
                )
                for seed in (0, 1)
            ]
            direct = {"indirect.method": "NONE"}
            ours = picture(blend, "DEEP_GBUFFER", Path(folder) / "ours.exr", RESOLUTION, OUR_SAMPLES, direct)
            pictures = [display(linear) for linear in (combined(ours), 0.5 * (halves[0] + halves[1]))]
            errors, mean = flip(pictures[1], pictures[0])
            noise = flip(*(display(half) for half in halves))[1]
            worst = max(worst, mean)
            rows.append([name, f"{mean:.4f}", f"{noise:.4f}"])
            captions = (f"{name}: Deep G-Buffer", "Cycles, no bounces", f"FLIP {mean:.3f}")
            sheet.append(list(zip(captions, (*pictures, errors), strict=True)))
    if not rows:
        return 0
    write_sheet(SHEET, sheet)
    text = table(["scene", "FLIP", "Cycles' noise"], rows)
    text += (
        f"\n`python3 build.py bench {NAME}`: {RESOLUTION[0]}×{RESOLUTION[1]}, {OUR_SAMPLES} samples of ours against "
        f"{2 * HALF} of Cycles without bounces, view transform Standard. Noise: between the two halves of Cycles' "
        f"samples, so twice that of their mean. Limit: {LIMIT}. Machine: {machine()}.\n"
    )
    report(NAME, "Direct light in real scenes", text)
    return 0 if worst <= LIMIT else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
