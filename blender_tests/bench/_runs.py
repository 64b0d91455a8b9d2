# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of `build.py render` that are timed from outside, and Markdown tables of what they took."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tooling import environments

REPOSITORY = Path(__file__).resolve().parents[2]
SHARED = REPOSITORY.parent / "shared" / "scenes"
RESULTS = Path(__file__).resolve().parent / "results"
RESOLUTION = "640x360"
SAMPLES = 16


@dataclass(frozen=True)
class Run:
    """`seconds`: of the whole process. `statistics`: one object per repeat."""

    seconds: float
    statistics: list[dict[str, Any]]


def render(blend: Path, engine: str, scratch: Path, shader_cache: Path, *, repeat: int = 1) -> Run:
    """Render a .blend in a process of its own, with Mesa's shader cache in the folder `shader_cache`."""
    statistics = scratch / "statistics.json"
    command = [sys.executable, str(REPOSITORY / "build.py"), "render", str(blend), "-o", str(scratch / f"{engine}.png")]
    command += ["--engine", engine, "--resolution", RESOLUTION, "--samples", str(SAMPLES), "--repeat", str(repeat)]
    surroundings = {**os.environ, "LIBGL_ALWAYS_SOFTWARE": "1", "MESA_SHADER_CACHE_DIR": str(shader_cache)}
    start = time.perf_counter()
    subprocess.run([*command, "--stats", str(statistics)], env=surroundings, check=True)
    return Run(time.perf_counter() - start, json.loads(statistics.read_text(encoding="utf-8")))


def snapshots(blend: Path, frames: Sequence[int], resolution: tuple[int, int], scratch: Path) -> list[Path]:
    """Snapshots of consecutive frames of a .blend, written into the folder `scratch`, in order."""
    command = [sys.executable, str(REPOSITORY / "build.py"), "render", str(blend), "-o", str(scratch / blend.stem)]
    command[-1] += ".png"
    command += ["--resolution", "{}x{}".format(*resolution), "--samples", "1", "--set", "save_snapshot=True"]
    command += ["--frames", f"{frames[0]}-{frames[-1]}"]
    subprocess.run(command, env={**os.environ, "LIBGL_ALWAYS_SOFTWARE": "1"}, check=True, stdout=subprocess.DEVNULL)
    return sorted(scratch.glob(f"{blend.stem}_*_snapshot.npz"))


def picture(
    blend: Path, engine: str, output: Path, resolution: tuple[int, int], samples: int, settings: Mapping[str, object]
) -> Path:
    """Render a .blend with some of the engine's settings changed, through the file's view transform, to `output`."""
    command = [sys.executable, str(REPOSITORY / "build.py"), "render", str(blend), "-o", str(output)]
    command += ["--engine", engine, "--resolution", "{}x{}".format(*resolution), "--samples", str(samples)]
    command += [part for name, value in settings.items() for part in ("--set", f"{name}={value}")]
    surroundings = {**os.environ, "LIBGL_ALWAYS_SOFTWARE": "1"}
    subprocess.run(command, env=surroundings, check=True, stdout=subprocess.DEVNULL)
    return output


def in_blender(script: Path, *arguments: str) -> None:
    """Run a script in the newest Blender's Python, with a Blender profile of its own."""
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_bench_") as profile:
        paths = os.pathsep.join([str(REPOSITORY), str(REPOSITORY / "blender_tests" / "blender")])
        surroundings = {
            **os.environ,
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "BLENDER_USER_RESOURCES": profile,
            "PYTHONPATH": paths,
        }
        command = [str(environments.blender_python()), "-P", str(script), *arguments]
        subprocess.run(command, env=surroundings, check=True)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def report(name: str, title: str, text: str) -> None:
    """Print a result and write it to results/NAME.md."""
    document = f"# {title}\n\n{text}"
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{name}.md").write_text(document, encoding="utf-8")
    print(document)
