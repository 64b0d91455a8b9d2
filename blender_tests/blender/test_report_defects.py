# SPDX-License-Identifier: GPL-3.0-or-later
"""Defects that are made in a real scene move the metrics that they should, and no others."""

import math
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.report.engines import assign
from addon.report.metrics import LUMINANCE
from addon.report.pictures import channels, combined
from addon.report.sweep import points
from blender_tests.blender.engine_fixtures import registered_fixture, use_multilayer  # noqa: F401 - a fixture
from tooling.report.judging import judge
from tooling.report.references import write_picture
from tooling.report.results import Judgement, Reference, Subject

SIZE = (160, 90)
FRAMES = (1, 2)
PIXEL = 1.0 / SIZE[0]
"""Of the camera's shift, in x."""
NOISE = 0.01
SEEN = 0.5
"""What moves a metric: half of what 1 % of noise does, or half a percent of the mean light."""
PERCENTILE_99_9 = 3.0902
"""Of the standard normal distribution."""

PICTURE = {"rmse": 1, "relative_mse": 1, "psnr": -1, "flip": 1}
"""Metrics of anything that is not equal, and whether they grow."""
MOVES = {
    "rendered again": {},
    "one light halved": {**PICTURE, "bias": -1},
    "noise of 1 %": {**PICTURE, "flicker": 1},
    "shifted by one pixel": {**PICTURE, "fireflies": 1},
    "one light halved in the second frame": {**PICTURE, "bias": -1, "flicker": 1},
}


@dataclass(frozen=True)
class Case:
    """Frames of a scene that moves across the picture, as they should be, with each defect, and how each is judged.

    `flicker`: of the frames without a defect; every other error of theirs is 0. `seen`: by how much each metric must
    change to have moved.
    """

    good: list[Path]
    judged: dict[str, dict[str, float]]
    flicker: float
    seen: dict[str, float]


def open_cornell(size: tuple[int, int]) -> bpy.types.Scene:
    """Our Cornell box, to be rendered by our engine with direct light only."""
    root = Path(__file__).resolve().parents[2]
    bpy.ops.wm.open_mainfile(filepath=str(root / "scenes" / "cornell_box.blend"))
    scene = bpy.context.scene
    scene.render.engine = "DEEP_GBUFFER"
    scene.deep_gbuffer.indirect.method = "NONE"
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    use_multilayer(scene)
    return scene


def pan(scene: bpy.types.Scene, start: int) -> None:
    """Shift the picture by one pixel a frame; by `start` pixels at frame 0."""
    camera = scene.camera.data
    camera.driver_remove("shift_x")
    camera.driver_add("shift_x").driver.expression = f"(frame + {start}) * {PIXEL}"


def render(scene: bpy.types.Scene, folder: Path, name: str, frames=FRAMES) -> list[Path]:
    """One EXR per frame."""
    paths = [folder / f"{name}{frame}.exr" for frame in frames]
    for path, frame in zip(paths, frames, strict=True):
        scene.frame_set(frame)
        scene.render.filepath = str(path)
        assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    return paths


def write(path: Path, picture: np.ndarray) -> Path:
    write_picture(path, picture)
    return path


def noisy(folder: Path, pictures: list[Path], share: float) -> list[Path]:
    """The pictures with independent normal noise, a share of each value."""
    generator = np.random.default_rng(5)
    noisier = []
    for path in pictures:
        picture = combined(path)
        picture *= 1.0 + share * generator.standard_normal(picture.shape).astype(np.float32)
        noisier.append(write(folder / f"noise_{share}_{path.name}", picture))
    return noisier


def reference_of(pictures: list[Path]) -> Reference:
    return Reference("our own picture", None, 0.0, 0.0, tuple(pictures))


def metrics_of(judgement: Judgement) -> dict[str, float]:
    """Every metric by name; of the bias, the channel that is farthest from 0."""
    errors = judgement.errors
    return {
        "rmse": errors.rmse,
        "relative_mse": errors.relative_mse,
        "psnr": errors.psnr,
        "bias": max(errors.bias, key=abs),
        "fireflies": errors.fireflies,
        "invalid": errors.invalid,
        "flip": judgement.flip,
        "flicker": judgement.flicker or 0.0,
    }


def just_seen(half_noise: dict[str, float], pictures: list[Path]) -> dict[str, float]:
    """By how much each metric must change to have moved.

    Noise leaves the mean as it is, and the brightest of 1000 pixels is brighter by 3.09 of its deviations at most
    (4: with what chance adds), so bias and fireflies go by the picture's own mean and its brightest pixel.
    """
    light = np.stack([combined(path) for path in pictures])
    return {
        **{name: value for name, value in half_noise.items() if name in {*PICTURE, "flicker"}},
        "bias": SEEN * NOISE * float(light.mean()),
        "fireflies": math.ceil(PERCENTILE_99_9) * NOISE * float((light @ LUMINANCE).max()),
        "invalid": 0.5,
    }


def layer_files(scene: bpy.types.Scene, folder: Path, layers: int) -> list[Path]:
    """One layer file per frame, with motion vectors."""
    ours = scene.deep_gbuffer
    ours.layers, ours.save_layers, ours.save_motion = layers, True, True
    ours.layers_path = str(folder / f"{layers}_#")
    render(scene, folder, "unused")
    ours.save_layers = False
    return [folder / f"{layers}_{frame}_layers.exr" for frame in FRAMES]


def measured(folder: Path, layers: list[Path], good: list[Path], defects: dict[str, list[Path]]) -> Case:
    """Judge frames with defects by good ones, and see how far metrics move without a defect and with half the noise."""
    subject = Subject("Cornell box", folder / "cornell_box.blend", FRAMES, SIZE, None)
    every = {**defects, "nothing": good, "half the noise": noisy(folder, good, SEEN * NOISE)}
    judged = {
        name: metrics_of(judge(pictures, reference_of(good), subject, layers, folder, name))
        for name, pictures in every.items()
    }
    half, nothing = judged.pop("half the noise"), judged.pop("nothing")
    return Case(good, judged, nothing["flicker"], just_seen(half, good))


@pytest.fixture(scope="module", name="case")
def case_fixture(registered, tmp_path_factory) -> Case:
    folder = tmp_path_factory.mktemp("defects")
    scene = open_cornell(SIZE)
    pan(scene, 0)
    good = render(scene, folder, "good")
    layers = layer_files(scene, folder, 1)
    pan(scene, 1)
    shifted = render(scene, folder, "shifted")
    pan(scene, 0)
    again = render(scene, folder, "again")
    scene.objects["Lamp"].data.energy *= 0.5
    halved = render(scene, folder, "halved")
    defects = {
        "rendered again": again,
        "one light halved": halved,
        "noise of 1 %": noisy(folder, good, NOISE),
        "shifted by one pixel": shifted,
        "one light halved in the second frame": [good[0], halved[1]],
    }
    return measured(folder, layers, good, defects)


def moved(case: Case, metric: str, value: float) -> int:
    """1 where the metric grew, −1 where it fell, 0 where the change is too small to be seen."""
    if metric == "psnr":  # infinite without a defect, so it can only fall: below what is just seen
        return -int(value < case.seen["psnr"])
    change = value - (case.flicker if metric == "flicker" else 0.0)
    return int(math.copysign(abs(change) > case.seen[metric], change))


METRICS = ("rmse", "relative_mse", "psnr", "bias", "fireflies", "invalid", "flip", "flicker")


@pytest.mark.parametrize("defect", MOVES)
@pytest.mark.parametrize("metric", METRICS)
def test_a_defect_moves_the_metrics_that_it_should(case, defect, metric):
    value = case.judged[defect][metric]
    expected = MOVES[defect].get(metric, 0)
    assert moved(case, metric, value) == expected, f"{value}; seen from {case.seen[metric]}"


def test_how_far_a_halved_light_and_noise_move_their_metrics(case):
    """Light is linear: half of it is missing. Noise of a share s has a root mean square of s times the picture's."""
    light = np.stack([combined(path) for path in case.good]).astype(np.float64)
    power = math.sqrt(np.mean(light * light))
    assert case.judged["one light halved"]["rmse"] == pytest.approx(0.5 * power, rel=1e-3)
    assert case.judged["one light halved"]["bias"] == pytest.approx(-0.5 * light.mean(axis=(0, 1, 2)).max(), rel=1e-3)
    uncertain = 6.0 / math.sqrt(2.0) * math.sqrt(np.sum(light**4)) / np.sum(light**2)
    assert case.judged["noise of 1 %"]["rmse"] == pytest.approx(NOISE * power, rel=uncertain)


def test_the_second_layer_dropped_darkens_what_sees_it(registered, tmp_path):
    """Nothing of the picture reads layer 2 yet: the light of all layers together stands in for what will."""
    scene = open_cornell(SIZE)
    pan(scene, 0)
    files = {layers: layer_files(scene, tmp_path, layers) for layers in (2, 1)}
    seen = {
        layers: [write(tmp_path / f"all_{path.name}", light_of_layers(path)) for path in paths]
        for layers, paths in files.items()
    }
    case = measured(tmp_path, files[2], seen[2], {"dropped": seen[1]})
    found = {metric: moved(case, metric, case.judged["dropped"][metric]) for metric in METRICS}
    assert found == {**dict.fromkeys(METRICS, 0), **PICTURE, "bias": -1}


def light_of_layers(path: Path) -> np.ndarray:
    """Radiance (H, W, 3) of all layers of a layer file together."""
    found = channels(path)
    layers = {name.split(".")[0] for name in found}
    return sum(np.stack([found[f"{layer}.Radiance.{letter}"] for letter in "RGB"], axis=-1) for layer in layers)


def test_the_table_of_peers_comes_out_again(shared_scenes, tmp_path):
    """Cycles with one sample and the fast denoiser on the Cornell box that others made: FLIP within 0.01."""
    folder = shared_scenes / "cornell"
    header, row = (
        next(line for line in (shared_scenes / "README.md").read_text(encoding="utf-8").splitlines() if start in line)
        for start in ("| | cornell |", "| Cycles 1 spp + fast denoiser |")
    )
    column = [cell.strip() for cell in header.split("|")].index("cornell")
    listed = float(row.split("|")[column].split(",")[1])

    bpy.ops.wm.open_mainfile(filepath=str(folder / "cornell.blend"))
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 640, 360, 100
    use_multilayer(scene)
    point = next(each for each in points(quick=True) if each.series == "Cycles, denoised" and each.label == "1 spp")
    for name, text in point.settings.items():
        assign(scene.cycles, name, text)
    (path,) = render(scene, tmp_path, "cycles", (scene.frame_current,))
    subject = Subject("cornell", folder / "cornell.blend", (scene.frame_current,), (640, 360), (360, 360))
    found = judge([path], reference_of([folder / "reference.exr"]), subject, None, tmp_path, "cycles")
    assert found.flip == pytest.approx(listed, abs=0.01)
