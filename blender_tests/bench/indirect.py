# SPDX-License-Identifier: GPL-3.0-or-later
"""What indirect light costs per pass, cold and warm, and how much light leaks through a thin wall; March + Grid."""

import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np

from addon.render import Device, Renderer, gl_thread, stop_gl_thread
from addon.render.casters import batch_bounds
from addon.scene import Camera, Channel, IndirectMethod, IndirectSettings, Moment, RenderSettings, Scene, snapshot
from addon.scene import Sequence as Frames
from addon.scene.versions import new_version
from blender_tests import builders, indirect_scenes
from blender_tests.bench._runs import SHARED, report, snapshots, table
from tooling.machine import machine

NAME = "indirect"
WIDTH, HEIGHT = 640, 360
SCENES = (
    SHARED / "cornell" / "cornell.blend",
    SHARED / "sponza" / "sponza.blend",
    SHARED / "living_room" / "living_room.blend",
)
ROUNDS = 3
STEP = 0.02
"""Of the scene's size: how far light and camera move from one picture to the next."""

SETTINGS = RenderSettings(WIDTH, HEIGHT, samples=1, indirect=IndirectSettings(IndirectMethod.MARCH_GRID))
CELLS_IN_WALL = (0.0, 0.1, 0.5)
"""Thicknesses of the wall that light must not pass, in cells."""

Step = Callable[[Moment, float], Moment]


def moved_light(moment: Moment, distance: float) -> Moment:
    """Every lamp turned and moved a little, sideways."""
    lights = []
    for light in moment.scene.lights:
        matrix = builders.translation(x=distance) @ light.world_from_light
        angle = 0.02
        turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
        matrix[:3, :3] = matrix[:3, :3] @ turn
        lights.append(replace(light, world_from_light=matrix))
    return Moment(replace(moment.scene, lights=tuple(lights)), moment.camera)


def moved_camera(moment: Moment, distance: float) -> Moment:
    """The camera moved sideways."""
    matrix = moment.camera.world_from_camera.copy()
    matrix[:3, 3] += distance * matrix[:3, 0]
    return Moment(moment.scene, replace(moment.camera, world_from_camera=matrix))


def moved_object(moment: Moment, distance: float) -> Moment:
    """The smallest object moved sideways that is not smaller than such a step."""
    sizes = {
        batch.key: float(np.ptp(batch_bounds(moment.scene.meshes[batch.mesh], batch), axis=0).max())
        for batch in moment.scene.batches
    }
    key = min((key for key in sizes if sizes[key] >= distance), key=lambda key: (sizes[key], key))
    batches = tuple(
        replace(batch, matrices=builders.translation(x=distance) @ batch.matrices, version=new_version())
        if batch.key == key
        else batch
        for batch in moment.scene.batches
    )
    return Moment(replace(moment.scene, batches=batches), moment.camera)


def at_rest(moment: Moment, _distance: float) -> Moment:
    """As it is."""
    return moment


STATES: dict[str, Step] = {
    "at rest": at_rest,
    "moving light": moved_light,
    "moving camera": moved_camera,
    "moving object": moved_object,
}


def size_of(scene: Scene) -> float:
    """Half the longest side of the box around what is in it, m."""
    corners = np.concatenate(
        [
            scene.meshes[batch.mesh].bounds @ matrix[:3, :3].T + matrix[:3, 3]
            for batch in scene.batches
            for matrix in batch.matrices
        ]
    )
    return 0.5 * float((corners.max(axis=0) - corners.min(axis=0)).max())


def shown(renderer: Renderer, moment: Moment, before: Moment | None) -> dict[str, float]:
    """Milliseconds per pass of one picture, as a viewport draws it."""
    renderer.begin(moment.scene, moment.camera, SETTINGS, Frames(previous=before, continuous=True))
    renderer.render_sample()
    return dict(renderer.statistics().passes)


def times(device: Device, moment: Moment) -> dict[str, dict[str, float]]:
    """Milliseconds per pass by state: medians. Programs are compiled before."""
    step = STEP * size_of(moment.scene)
    found: dict[str, list[dict[str, float]]] = {name: [] for name in ("cold", *STATES)}
    for attempt in range(ROUNDS + 1):
        renderer = Renderer(device)
        cold = shown(renderer, moment, None)
        if attempt:
            found["cold"].append(cold)
        for name, move in STATES.items():
            before = moment
            for _ in range(2):
                now = move(before, step)
                entry = shown(renderer, now, before)
                before = now
            if attempt:
                found[name].append(entry)
        renderer.release()
    return {
        name: {key: median(entry.get(key, 0.0) for entry in entries) for key in entries[0]}
        for name, entries in found.items()
    }


def leak(device: Device, thickness: float) -> float:
    """Light that passes a wall `thickness` cells thick, as a share of what is in front of it."""
    cell, white = 0.125, builders.material(base_color=(0.7, 0.7, 0.7))
    wall = indirect_scenes.wall("wall", thickness * cell)
    lamp = builders.light(position=(0.5, 0.0, 0.0), emission=(1.0, 1.0, 1.0))
    scene = indirect_scenes.of((builders.box("room"), white), (wall, white), lights=(lamp,))
    indirect = replace(SETTINGS.indirect, cell_size=cell, bounces=None)
    settings = replace(
        SETTINGS, width=64, height=64, samples=16, indirect=indirect, channels=frozenset({Channel.DIFFUSE_INDIRECT})
    )
    renderer = Renderer(device)
    light = []
    for x in (-0.5, 0.5):
        camera = indirect_scenes.looking((x, -0.8, 0.1), (x, 0.8, -0.1))
        renderer.begin(scene, camera, settings)
        for _ in range(settings.samples):
            renderer.render_sample()
        light.append(float(renderer.read(Channel.DIFFUSE_INDIRECT).mean()))
    renderer.release()
    return light[0] / light[1]


def measure(device: Device, scratch: Path) -> str:
    """The tables. On the GL thread."""
    text = ""
    for blend in SCENES:
        if not blend.is_file():
            print(f"left out, as it is not there: {blend.name}")
            continue
        scene = snapshot.load(snapshots(blend, [1, 1], (WIDTH, HEIGHT), scratch)[0]).scene
        assert isinstance(scene.camera, Camera)
        found = times(device, Moment(scene, scene.camera))
        names = list(dict.fromkeys(name for entry in found.values() for name in entry))
        rows = [
            [state, f"{sum(entry.values()):.0f}", *(f"{entry.get(name, 0.0):.0f}" for name in names)]
            for state, entry in found.items()
        ]
        text += f"## {blend.stem.replace('_', ' ').title()}\n\n{table(['', 'sample', *names], rows)}\n"
    rows = [[f"{thickness:g}", f"{leak(device, thickness):.2%}"] for thickness in CELLS_IN_WALL]
    text += f"## Light through a wall\n\n{table(['thickness, cells', 'share of the light before it'], rows)}\n"
    return text + (
        f"Milliseconds of one sample, medians of {ROUNDS}. Cold: a new view, programs compiled; the others: the next "
        "picture of a viewport in which nothing, every lamp, the camera or a small object moved. `radiance_grid` is "
        "all that the grid costs: filling, its direct light, its bounces.\n\n"
        f"`python3 build.py bench {NAME}`: {WIDTH}×{HEIGHT}, default settings. Machine: {machine()}; {device.name}.\n"
    )


def main(arguments: list[str]) -> int:
    """Run the bench."""
    if arguments:
        print(f"{NAME} takes no arguments")
        return 2
    os.environ["LIBGL_ALWAYS_SOFTWARE"] = "1"
    try:
        with tempfile.TemporaryDirectory(prefix="deep_gbuffer_bench_") as folder:
            text = gl_thread().submit(lambda device: measure(device, Path(folder))).result()
    finally:
        stop_gl_thread()
    report(NAME, "Indirect light", text)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
