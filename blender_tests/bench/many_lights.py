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
from blender_tests.bench._runs import SHARED, machine, report, snapshots, table

SPONZA = SHARED / "sponza" / "sponza.blend"
NAME = "many_lights"
WIDTH, HEIGHT = 640, 360
COUNTS = (1, 256)
WARM, TIMED = 4, 12
"""Samples: while the first ones are drawn, programs are compiled and every lamp gets its first shadow maps."""

POWER = 5.0
RADIUS = 0.03
LIMIT = 3.0
LIGHT_PASSES = ("depth_tiles", "light_tiles", "shadow_maps", "direct")


def lamps(scene: Scene, count: int) -> tuple[Light, ...]:
    """Lamps of 5 W and 3 cm all over the atrium, at most 6 m above its floor; the first `count` of them."""
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
        color = generator.uniform(0.5, 1.0, 3) * POWER / (4.0 * np.pi)
        emission = (float(color[0]), float(color[1]), float(color[2]))
        result.append(Light(f"lamp {index}", f"lamp {index}", LightKind.POINT, matrix, emission, radius=RADIUS))
    return tuple(result[:count])


def _corners(bounds: np.ndarray) -> np.ndarray:
    return np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def measure(device: Device) -> tuple[str, float]:
    """The table, and how many times as long a sample takes with the most lamps as with one. Runs on the GL thread."""
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_bench_") as folder:
        scene = snapshot.load(snapshots(SPONZA, [1, 1], (WIDTH, HEIGHT), Path(folder))[0]).scene
    assert scene.camera is not None
    settings = RenderSettings(WIDTH, HEIGHT, samples=WARM + TIMED)
    renderers: dict[int, Renderer] = {}
    passes: dict[int, list[dict[str, float]]] = {count: [] for count in COUNTS}
    for count in COUNTS:
        renderers[count] = Renderer(device)
        lit = replace(scene, lights=lamps(scene, count), world=World())
        renderers[count].begin(lit, scene.camera, settings)
    for index in range(WARM + TIMED):
        for count, renderer in renderers.items():
            renderer.render_sample()
            if index >= WARM:
                passes[count].append(dict(renderer.statistics().passes))
    for renderer in renderers.values():
        renderer.release()
    rows, whole = [], {}
    names = list(dict.fromkeys(name for count in COUNTS for entry in passes[count] for name in entry))
    for count in COUNTS:
        whole[count] = median(sum(entry.values()) for entry in passes[count])
        light = median(sum(entry.get(name, 0.0) for name in LIGHT_PASSES) for entry in passes[count])
        each = [f"{median(entry.get(name, 0.0) for entry in passes[count]):.1f}" for name in names]
        rows.append([str(count), f"{whole[count]:.1f}", f"{light:.1f}", *each])
    ratio = whole[COUNTS[-1]] / whole[COUNTS[0]]
    text = table(["lamps", "sample", "of which light", *names], rows)
    text += (
        f"\nMilliseconds, medians of {TIMED} samples that take turns. With {COUNTS[-1]} lamps a sample takes "
        f"{ratio:.2f}× as long as with one (limit {LIMIT:g}×).\n\n"
        f"`python3 build.py bench {NAME}`: Sponza without sun and sky at {WIDTH}×{HEIGHT}, lamps of {POWER:g} W and "
        f"{100 * RADIUS:g} cm radius. Machine: {machine()}; {device.name}.\n"
    )
    return text, ratio


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
