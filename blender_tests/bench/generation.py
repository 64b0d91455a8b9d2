# SPDX-License-Identifier: GPL-3.0-or-later
"""What every variant of deep G-buffer generation costs and gets wrong, against Two-Pass and against one layer."""

import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from addon.render import Device, gl_thread, stop_gl_thread
from addon.scene import Layering, Variant
from blender_tests.bench._clips import Clip, hall_clips, large_clip, real_clips
from blender_tests.bench._generation_tables import (
    LAYERS,
    METHODS,
    ONE_LAYER,
    ONE_PASS,
    SEPARATIONS,
    SHOWN_SEPARATION,
    LayeringRow,
    Measured,
    document,
    points,
)
from blender_tests.bench._measuring import Bench, Way
from blender_tests.bench._plot import plot
from blender_tests.bench._runs import RESULTS, report
from tooling.machine import machine

WIDTH, HEIGHT = 640, 360
NAME, TITLE = "generation", "Generating the deep G-buffer"
TIMED_FRAMES = {2: 3, 4: 2}
"""Per number of layers; two are the default."""
LAYERING_FRAMES = 2
"""Timed for the layering methods."""


def measure_variants(bench: Bench, clip: Clip, separations: Sequence[float]) -> Measured:
    """Every variant with every number of layers and Δz."""
    measured: Measured = {}
    for layers in LAYERS:
        for separation in separations:
            ways = {variant.value: Way(layers, separation, variant) for variant in Variant}
            ways[ONE_LAYER] = Way(1, separation)
            measured[layers, separation] = bench.measure(clip, ways, TIMED_FRAMES[layers])
    return measured


def measure_layering(bench: Bench, clip: Clip) -> list[LayeringRow]:
    """The one-pass variants by either method."""
    rows: list[LayeringRow] = []
    for layers in LAYERS:
        ways = {(Variant.TWO_PASS, Layering.FASTEST): Way(layers, SHOWN_SEPARATION)}
        for variant in ONE_PASS:
            ways |= {(variant, method): Way(layers, SHOWN_SEPARATION, variant, method) for method in METHODS}
        # Drivers may round differently behind a geometry shader, in layer 0 too: nothing is compared.
        figures = bench.measure(clip, ways, LAYERING_FRAMES, compare=False)
        two_pass = figures[Variant.TWO_PASS, Layering.FASTEST]
        for method in METHODS:
            ratios = tuple(figures[variant, method].relative_to(two_pass) for variant in ONE_PASS)
            rows.append(LayeringRow(clip.name, layers, method, two_pass.time, ratios))
    return rows


def measure(device: Device) -> str:
    """Everything, as Markdown; draws the plot. Runs on the GL thread."""
    array_clips = hall_clips(WIDTH, HEIGHT)
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_bench_") as folder:
        shared_clips, missing = real_clips(WIDTH, HEIGHT, Path(folder))
    results: dict[str, Measured] = {}
    plan = [(clip, SEPARATIONS) for clip in array_clips] + [(clip, (SHOWN_SEPARATION,)) for clip in shared_clips]
    for clip, separations in plan:
        print(f"{clip.name} …", flush=True)
        bench = Bench(device, WIDTH, HEIGHT)
        results[clip.name] = measure_variants(bench, clip, separations)
        bench.release()
    layering: list[LayeringRow] = []
    for clip in (array_clips[1], large_clip(WIDTH, HEIGHT), *shared_clips[:1]):
        print(f"{clip.name}, layering methods …", flush=True)
        bench = Bench(device, WIDTH, HEIGHT)
        layering += measure_layering(bench, clip)
        bench.release()
    RESULTS.mkdir(exist_ok=True)
    plot(points(results), RESULTS / f"{NAME}.png", f"{TITLE}, Δz = {SHOWN_SEPARATION:g} m")
    notes = (
        f"`python3 build.py bench {NAME}`: {WIDTH}×{HEIGHT}, as a viewport draws, one sample a frame; medians and "
        f"means over {TIMED_FRAMES[2]} frames ({TIMED_FRAMES[4]} with four layers), in which all variants take turns.\n"
        f"Machine: {machine()}; {device.name}.\n"
    )
    if missing:
        notes += f"Left out, because they are not in ../shared/scenes: {', '.join(missing)}.\n"
    return document(notes, [*array_clips, *shared_clips], results, layering)


def main(arguments: list[str]) -> int:
    """Run the bench."""
    if arguments:
        print(f"{NAME} takes no arguments")
        return 2
    os.environ["LIBGL_ALWAYS_SOFTWARE"] = "1"  # on a graphics card the ratios would be other ones
    try:
        report(NAME, TITLE, gl_thread().submit(measure).result())
    finally:
        stop_gl_thread()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
