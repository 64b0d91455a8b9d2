# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light under every kind of lamp and world against Cycles, at 320×180 and 256 samples of ours."""

import json
import sys
import tempfile
from math import inf
from pathlib import Path

from blender_tests.bench._runs import in_blender, report, table
from tooling.machine import machine

WIDTH, HEIGHT = 320, 180
NAME = "direct_light"
MEAN_LIMIT, OFF_LIMIT = 0.01, 0.02
JOB = Path(__file__).resolve().parent / "_direct_light_job.py"
HEADER = ("case", "mean error", "pixels off", "total", "diffuse", "glossy", "Cycles' noise", "its pixels off")


def row(name: str, entry: dict[str, float]) -> list[str]:
    """One line of the table; what misses a limit is bold, a kind of light that is not there a dash."""
    limits = {"mean": MEAN_LIMIT, "off": OFF_LIMIT}
    shares = [f"{entry[key]:.2%}" if entry[key] <= limit else f"**{entry[key]:.2%}**" for key, limit in limits.items()]
    kinds = [f"{entry[key]:.2%}" if entry[key] < inf else "–" for key in ("diffuse", "glossy")]
    return [name, *shares, f"{entry['total']:+.2%}", *kinds, *(f"{entry[key]:.2%}" for key in ("noise", "noise_off"))]


def main(arguments: list[str]) -> int:
    """Run the bench; exit code 1 where a case misses a limit."""
    if arguments:
        print(f"{NAME} takes no arguments")
        return 2
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_bench_") as folder:
        output = Path(folder) / "figures.json"
        in_blender(JOB, str(output), str(WIDTH), str(HEIGHT))
        figures = json.loads(output.read_text(encoding="utf-8"))
    judged = {name: entry for name, entry in figures.items() if not entry["own_limits"]}
    missed = [name for name, entry in judged.items() if not (entry["mean"] <= MEAN_LIMIT and entry["off"] <= OFF_LIMIT)]
    text = table(HEADER, [row(name, entry) for name, entry in figures.items()])
    text += (
        f"\n`python3 build.py bench {NAME}`: {WIDTH}×{HEIGHT}, 256 samples of ours; diffuse and glossy light straight "
        "from lamps and world, with shadows. Mean error: Σ|ours − Cycles| / Σ Cycles. Pixels off: a channel differs "
        f"by more than 5 % and by more than 1 % of the picture's mean. Limits: {MEAN_LIMIT:.0%} and {OFF_LIMIT:.0%}, "
        f"missed in {len(missed)} of {len(judged)} cases (bold). The last {len(figures) - len(judged)}, where shadow "
        "maps fail, have limits of their own in test_shadow_torture.py. Noise: of Cycles' picture, from its halves. "
        f"Machine: {machine()}.\n"
    )
    report(NAME, "Direct light against Cycles", text)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
