# SPDX-License-Identifier: GPL-3.0-or-later
"""What 256 small lamps in Sponza cost per sample against one, in one run."""

import os
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np

from addon.render import Device, Renderer, gl_thread, stop_gl_thread
from addon.scene import Light, LightKind, RenderSettings, Scene, World, snapshot
from blender_tests.bench._runs import SHARED, report, snapshots, table
from tooling.machine import machine

SPONZA = SHARED / "sponza" / "sponza.blend"
NAME = "many_lights"
WIDTH, HEIGHT = 640, 360
COUNTS = (1, 256)
WARM, TIMED = 4, 12
"""Samples: while the first ones are drawn, programs are compiled and every lamp gets its first shadow maps."""

SMALL, STRONGER = 1.0, 5.0
"""Watts, as Blender means them: a candle's light, and five times as much, which is judged by no limit."""

RADIUS = 0.03
LIMIT = 3.0
LIGHT_PASSES = ("depth_tiles", "light_tiles", "shadow_maps", "direct")


def lamps(scene: Scene, count: int, power: float) -> tuple[Light, ...]:
    """Lamps of so many watts all over the atrium, at most 6 m above its floor; the first `count` of them."""
    generator = np.random.default_rng(0)
    boxes = [
        (corners @ matrix[:3, :3].T + matrix[:3, 3])
        for batch in scene.batches
        for matrix in batch.matrices
        for corners in [_corners(scene.meshes[batch.mesh].bounds)]
    ]
    low, high = np.concatenate(boxes).min(axis=0), np.concatenate(boxes).max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    result = []
    for index in range(max(COUNTS)):
        matrix = np.eye(4)
        matrix[:2, 3] = middle[:2] + 0.8 * half[:2] * generator.uniform(-1.0, 1.0, 2)
        matrix[2, 3] = low[2] + generator.uniform(0.5, 6.0)
        color = generator.uniform(0.5, 1.0, 3) * power / (4.0 * np.pi)
        emission = (float(color[0]), float(color[1]), float(color[2]))
        result.append(Light(f"lamp {index}", f"lamp {index}", LightKind.POINT, matrix, emission, radius=RADIUS))
    return tuple(result[:count])


def _corners(bounds: np.ndarray) -> np.ndarray:
    return np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def times(device: Device, scene: Scene, power: float) -> dict[int, list[dict[str, float]]]:
    """Milliseconds per pass of samples that take turns, by the number of lamps."""
    assert scene.camera is not None
    settings = RenderSettings(WIDTH, HEIGHT, samples=WARM + TIMED)
    renderers = {count: Renderer(device) for count in COUNTS}
    passes: dict[int, list[dict[str, float]]] = {count: [] for count in COUNTS}
    for count, renderer in renderers.items():
        lit = replace(scene, lights=lamps(scene, count, power), world=World())
        renderer.begin(lit, scene.camera, settings)
    for index in range(WARM + TIMED):
        for count, renderer in renderers.items():
            renderer.render_sample()
            if index >= WARM:
                passes[count].append(dict(renderer.statistics().passes))
    for renderer in renderers.values():
        renderer.release()
    return passes


def measure(device: Device) -> tuple[str, float]:
    """The tables, and how many times as long a sample takes with many small lamps as with one. On the GL thread."""
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_bench_") as folder:
        scene = snapshot.load(snapshots(SPONZA, [1, 1], (WIDTH, HEIGHT), Path(folder))[0]).scene
    text, ratios = "", {}
    for power in (SMALL, STRONGER):
        passes = times(device, scene, power)
        names = list(dict.fromkeys(name for count in COUNTS for entry in passes[count] for name in entry))
        whole = {count: median(sum(entry.values()) for entry in passes[count]) for count in COUNTS}
        rows = []
        for count in COUNTS:
            light = median(sum(entry.get(name, 0.0) for name in LIGHT_PASSES) for entry in passes[count])
            each = [f"{median(entry.get(name, 0.0) for entry in passes[count]):.1f}" for name in names]
            rows.append([str(count), f"{whole[count]:.1f}", f"{light:.1f}", *each])
        ratios[power] = whole[COUNTS[-1]] / whole[COUNTS[0]]
        text += f"## Lamps of {power:g} W: {ratios[power]:.2f}× the time of one\n\n"
        text += table(["lamps", "sample", "of which light", *names], rows) + "\n"
    text += (
        f"Milliseconds, medians of {TIMED} samples that take turns; limit for lamps of {SMALL:g} W: {LIMIT:g}×.\n\n"
        f"`python3 build.py bench {NAME}`: Sponza without sun and sky at {WIDTH}×{HEIGHT}, lamps of {100 * RADIUS:g} cm"
        f" radius, light threshold as by default. Machine: {machine()}; {device.name}.\n"
    )
    return text, ratios[SMALL]


def main(arguments: list[str]) -> int:
    """Run the bench; exit code 1 where many lamps cost more than the limit."""
    if arguments:
        print(f"{NAME} takes no arguments")
        return 2
    if not SPONZA.is_file():
        print(f"left out, as it is not there: {SPONZA.name}")
        return 0
    os.environ["LIBGL_ALWAYS_SOFTWARE"] = "1"
    try:
        text, ratio = gl_thread().submit(measure).result()
    finally:
        stop_gl_thread()
    report(NAME, "Many lights", text)
    return 0 if ratio <= LIMIT else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
