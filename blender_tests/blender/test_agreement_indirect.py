# SPDX-License-Identifier: GPL-3.0-or-later
"""All diffuse light, reflected up to n times before, ours against Cycles' at as many bounces: room, lamp, glow, sky.

Light straight from the world is Cycles' Diffuse Direct and part of our Diffuse Indirect: only their sum is compared.
"""

import math
from collections.abc import Callable
from pathlib import Path

import bpy
import flip_evaluator
import numpy as np
import pytest
from agreement_cases import gradient
from agreement_fixtures import prepare, prepare_cycles, render_passes
from agreement_measures import difference, write_sheet
from agreement_scenes import box, camera, empty_scene, lamp, material, node, plane
from engine_fixtures import registered_fixture  # noqa: F401

from addon.report.metrics import display

PASSES = ("z", "diffuse_color", "diffuse_direct", "diffuse_indirect")
CYCLES_SAMPLES = 128
OUR_SAMPLES = 32
SAMPLES_OF_SURFACES = 96
"""Ours where an emissive surface is sampled as a light: all pixels see it at the same few points."""

SIZE = 48
BLOCK = 8
"""Pixels a side of the squares whose means are compared: noise in them is an eighth of that in pixels."""

BIAS = 0.05
"""Share of the light by which ours may be off beyond noise: cells are flat and have one radiance each."""

MOST_NOISE = 0.04
"""More would tell nothing."""

pytestmark = pytest.mark.usefixtures("registered")


def matte(name: str, red: float, green: float, blue: float, **values: object) -> bpy.types.Material:
    """Lambert's surface."""
    base = {"Base Color": (red, green, blue, 1.0), "Roughness": 1.0, "Specular IOR Level": 0.0}
    return material(name, {**base, **values})


def room(*, ceiling: bool) -> bpy.types.Scene:
    """A room of 2 m with a red and a green wall and two boxes in it; its camera looks in through the missing wall."""
    scene = empty_scene(SIZE, SIZE)
    scene.world = None
    white = matte("White", 0.7, 0.7, 0.7)
    quarter = math.radians(90.0)
    plane(2.0, white, (0, 0, 0))
    plane(2.0, white, (0, 1, 1), (quarter, 0, 0))
    plane(2.0, matte("Red", 0.6, 0.06, 0.05), (-1, 0, 1), (0, quarter, 0))
    plane(2.0, matte("Green", 0.1, 0.45, 0.08), (1, 0, 1), (0, -quarter, 0))
    if ceiling:
        plane(2.0, white, (0, 0, 2), (2 * quarter, 0, 0))
    box(0.6, white, (0.4, -0.2, 0.3), turn=0.3)
    box(0.5, white, (-0.4, 0.35, 0.25), turn=-0.3).scale = (1.0, 1.0, 2.0)
    camera(scene, (0.0, -4.2, 1.0), (0.0, 0.0, 1.0), lens=55.0)
    return scene


def with_area_light() -> bpy.types.Scene:
    """The room under a lamp in its ceiling."""
    scene = room(ceiling=True)
    lamp(scene, "AREA", (0.0, 0.0, 1.98), (0.0, 0.0, 0.0), shape="SQUARE", size=0.5, energy=20.0)
    return scene


def with_glow(sampling: str) -> bpy.types.Scene:
    """The room lit by a strip before its wall that shines, which is sampled as a light or left to be found."""
    scene = room(ceiling=True)
    shining = {"Emission Color": (1.0, 0.8, 0.5, 1.0), "Emission Strength": 6.0}
    glow = matte("Glow", 0.0, 0.0, 0.0, **shining)
    glow.cycles.emission_sampling = sampling
    plane(1.0, glow, (-0.85, 0.2, 1.4), (0.0, math.radians(90.0), 0.0)).scale = (0.5, 1.4, 1.0)
    return scene


def courtyard() -> bpy.types.Scene:
    """The room without its ceiling under a sky that is bright and blue on one side."""
    scene = room(ceiling=False)
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    gradient(scene.world.node_tree, node(scene.world.node_tree, "BACKGROUND"))
    return scene


SCENES: dict[str, Callable[[], bpy.types.Scene]] = {
    "area light": with_area_light,
    "glow that is sampled": lambda: with_glow("AUTO"),
    "glow that is found": lambda: with_glow("NONE"),
    "sky": courtyard,
}


def diffuse_light(scene: bpy.types.Scene, engine: str, folder: Path, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(radiance (H, W, 3) that is reflected diffusely, where (H, W) a surface is seen) of one engine."""
    scene.cycles.seed = scene.deep_gbuffer.seed = seed
    passes = render_passes(scene, engine, folder)
    light = (passes["Diffuse Direct"] + passes["Diffuse Indirect"]) * passes["Diffuse Color"]
    return light[..., :3], passes["Depth"][..., 0] < 1e9


def means(picture: np.ndarray) -> np.ndarray:
    """(H/8, W/8, ...) means of squares."""
    height, width = (side // BLOCK for side in picture.shape[:2])
    return picture.reshape(height, BLOCK, width, BLOCK, *picture.shape[2:]).mean(axis=(1, 3))


@pytest.mark.parametrize(("name", "bounces"), [*((name, 4) for name in SCENES), ("area light", 1)])
def test_reflected_light_is_cycles(name: str, bounces: int, tmp_path: Path) -> None:
    """In squares of 8 pixels, but for the bias that is stated and the noise of both: of each engine two pictures with
    other random numbers, which differ by twice as much as their mean does from what more samples would give."""
    scene = SCENES[name]()
    prepare(scene, PASSES)
    prepare_cycles(scene, CYCLES_SAMPLES // 2)
    cycles, indirect = scene.cycles, scene.deep_gbuffer.indirect
    cycles.max_bounces = cycles.diffuse_bounces = bounces
    indirect.method, indirect.bounces = "MARCH_GRID", bounces
    scene.deep_gbuffer.samples = SAMPLES_OF_SURFACES if name == "glow that is sampled" else OUR_SAMPLES
    (one, there), (two, _) = (diffuse_light(scene, "CYCLES", tmp_path, seed) for seed in (0, 1))
    (mine, here), (again, _) = (diffuse_light(scene, "DEEP_GBUFFER", tmp_path, seed) for seed in (0, 1))
    covered = there & here
    theirs, ours = (
        np.where(covered[..., None], 0.5 * (first + second), 0.0) for first, second in ((one, two), (mine, again))
    )
    full = np.ones(means(covered).shape, np.bool_)
    assert covered.mean() > 0.7
    assert theirs.mean() > 0.01, "the scene must be lit"
    noises = [difference(means(a), means(b), full).mean / 2.0 for a, b in ((one, two), (mine, again))]
    noise = sum(noises)
    found = difference(means(ours), means(theirs), full)
    sheet = write_sheet(tmp_path / "ours_cycles_difference.png", ours, theirs)
    assert noise < MOST_NOISE, f"too noisy to tell: {noises}"
    assert found.mean <= noise + BIAS, f"{found}; noise {noise:.2%}; see {sheet}"
    assert abs(found.total) <= noise + 0.5 * BIAS, f"{found}; noise {noise:.2%}; see {sheet}"


def test_bounces_add_what_cycles_adds(tmp_path: Path) -> None:
    """Light of one bounce and of six: their ratio is Cycles'."""
    scene = with_area_light()
    prepare(scene, PASSES)
    prepare_cycles(scene, CYCLES_SAMPLES)
    scene.deep_gbuffer.samples, scene.deep_gbuffer.indirect.method = OUR_SAMPLES, "MARCH_GRID"
    sums = {}
    for engine in ("CYCLES", "DEEP_GBUFFER"):
        for bounces in (1, 6):
            scene.cycles.max_bounces = scene.cycles.diffuse_bounces = bounces
            scene.deep_gbuffer.indirect.bounces = bounces
            sums[engine, bounces] = diffuse_light(scene, engine, tmp_path, 0)[0].sum()
    ours, theirs = (sums[engine, 6] / sums[engine, 1] for engine in ("DEEP_GBUFFER", "CYCLES"))
    assert theirs > 1.1
    assert ours == pytest.approx(theirs, rel=0.02)


def test_where_cells_lie_is_not_seen(tmp_path: Path) -> None:
    """Everything, the camera included, moved by half a cell on each axis: FLIP below .01, as the project asks."""
    cell = 0.1
    scene = with_area_light()
    prepare(scene, PASSES)
    indirect = scene.deep_gbuffer.indirect
    indirect.method, indirect.cell_size, scene.deep_gbuffer.samples = "MARCH_GRID", cell, 4 * OUR_SAMPLES
    pictures = []
    for moved in (0.0, 0.5 * cell):
        for thing in scene.objects:
            thing.location = tuple(axis + moved for axis in thing.location)
        linear = render_passes(scene, "DEEP_GBUFFER", tmp_path)["Combined"][..., :3]
        pictures.append(display(linear))
    _, mean, _ = flip_evaluator.evaluate(*pictures, "LDR")
    assert mean < 0.01
