# SPDX-License-Identifier: GPL-3.0-or-later
"""How much Sponza flickers under a slow pan and a moving sun: ours, EEVEE and Cycles, by the report's own measure."""

import json
import math
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from addon.render import Device, Renderer, gl_thread, stop_gl_thread
from addon.report.sweep import DENOISED, EEVEE, METHOD, OURS, PICTURE, Point, Settings
from addon.scene import Channel, IndirectMethod, IndirectSettings, Moment, RenderSettings, snapshot
from addon.scene import Sequence as Frames
from addon.scene.arrays import Float32Array
from blender_tests.bench._clips import shared
from blender_tests.bench._runs import SHARED, in_blender, report, snapshots, table
from tooling import environments, places
from tooling.machine import machine
from tooling.report.instruments import BlenderInstruments
from tooling.report.interfaces import Options
from tooling.report.judging import reference_flicker
from tooling.report.references import write_picture
from tooling.report.results import Reference, Subject
from tooling.report.run import make
from tooling.report.tables import Row, rows_of

NAME = "flicker"
JOB = Path(__file__).resolve().parent / "_flicker_job.py"
SPONZA = SHARED / "sponza" / "sponza.blend"
FOLDER = places.cache_directory() / "reports" / NAME
FILE = "report.json"
RESOLUTION = (320, 180)
FRAMES = tuple(range(1, 7))
PIXELS, DEPTH = 2.0, 8.0
"""The pan: what is `DEPTH` metres away moves by so many pixels a frame."""

WIDTH_AT_A_METRE = 36.0 / 23.458
"""Of what Sponza's camera sees: sensor over focal length."""

TURN = 0.5
"""Degrees a frame, of the sun."""

REFERENCE_SAMPLES = 32
REST = 8
"""Pictures of the first frame that a viewport draws before the clip plays."""

DIRECT, MARCH_GRID, UNFILTERED = "Direct light only", "March + Grid (default)", "March + Grid, no filters"
MARCHES = ("Deep March, 1 layer", "Deep March, 2 layers")
RADIOSITIES = ("Radiosity, 1 layer", "Radiosity, 2 layers")
ONE_LAYER = (MARCHES[0], RADIOSITIES[0])
"""Our screen-space results that March + Grid must not flicker as much as."""

FEW, MANY = 1, 16
"""Samples of ours and of EEVEE."""

WITH_MANY = (MARCH_GRID, *ONE_LAYER)
"""Ours that are rendered with many samples, too: they take long."""

CYCLES_SAMPLES = (1, 4)
CYCLES, EEVEE_NAME = "Cycles, denoised", "EEVEE"
VIEWPORTS = {
    "March + Grid, as a viewport plays it": True,
    "the same without temporal filter": False,
}
"""Whether the temporal filter is on, by name: it works in viewports only."""


def _layered(method: IndirectMethod, layers: int) -> Settings:
    return {METHOD: method.value, "layers": str(layers)}


METHODS: Mapping[str, Settings] = {
    DIRECT: {METHOD: IndirectMethod.NONE.value},
    MARCH_GRID: {},
    UNFILTERED: {"indirect.spatial_filter": "False", "indirect.temporal_filter": "False"},
    **{name: _layered(IndirectMethod.DEEP_MARCH, layers) for layers, name in enumerate(MARCHES, 1)},
    **{name: _layered(IndirectMethod.RADIOSITY, layers) for layers, name in enumerate(RADIOSITIES, 1)},
}
"""Ours, by name."""


def _ours(name: str, samples: int) -> Point:
    return Point(name, f"{samples} spp", OURS, {**PICTURE, "samples": str(samples), **METHODS[name]})


def _eevee(samples: int) -> Point:
    return Point(EEVEE_NAME, f"{samples} spp", "EEVEE", {"taa_render_samples": str(samples), **EEVEE})


def _cycles(samples: int) -> Point:
    return Point(CYCLES, f"{samples} spp", "CYCLES", {**DENOISED, "samples": str(samples)})


POINTS = (
    *(_ours(name, FEW) for name in METHODS),
    *(_ours(name, MANY) for name in WITH_MANY),
    *(_eevee(samples) for samples in (FEW, MANY)),
    *(_cycles(samples) for samples in CYCLES_SAMPLES),
)


@dataclass(frozen=True)
class Clip:
    """A file to be made of Sponza: `step`, metres a frame; `turn`, degrees a frame."""

    name: str
    title: str
    step: float
    turn: float

    def provide(self) -> Subject:
        """What is measured; its file is made where it is not in the cache."""
        job = {"file": str(SPONZA), "frames": len(FRAMES), "step": self.step, "turn": self.turn}
        identity = places.key(SPONZA.read_bytes(), JOB.read_bytes(), json.dumps(job))
        path = FOLDER / identity / f"{self.name}.blend"
        if not path.is_file():
            with places.replacing(path) as draft:
                in_blender(JOB, json.dumps({**job, "output": str(draft)}))
        return Subject(self.name, path, FRAMES, RESOLUTION, None)


CLIPS = (
    Clip("slow_pan", "slow pan", PIXELS * DEPTH * WIDTH_AT_A_METRE / RESOLUTION[0], 0.0),
    Clip("moving_sun", "moving sun", 0.0, TURN),
)


@dataclass(frozen=True)
class Found:
    """What was found of a clip: each point's row by its series and label, each viewport's flicker by its name, and the
    reference's own.
    """

    clip: Clip
    rows: Mapping[tuple[str, str], Row]
    viewports: Mapping[str, float]
    reference: float


def main(arguments: list[str]) -> int:
    """Run the bench; exit code 1 where something could not be measured."""
    if arguments:
        print(f"{NAME} takes no arguments")
        return 2
    if not SPONZA.is_file():
        print(f"left out, as it is not there: {SPONZA.name}")
        return 0
    os.environ["LIBGL_ALWAYS_SOFTWARE"] = "1"
    subjects = [clip.provide() for clip in CLIPS]
    options = Options(
        scenes=tuple((subject.blend, None) for subject in subjects),
        folder=FOLDER,
        quick=False,
        resolution=RESOLUTION,
        frames=FRAMES,
        rounds=1,
        command=f"python3 build.py bench {NAME}",
    )
    instruments = BlenderInstruments(environments.blender_python(), 0.0, REFERENCE_SAMPLES)
    if problems := make(options, POINTS, instruments):
        print("\n".join(["what could not be measured:", *problems]))
        return 1
    try:
        viewports = [played(subject, instruments) for subject in subjects]
    finally:
        stop_gl_thread()
    report(NAME, "Flicker", document((FOLDER / FILE).read_text(encoding="utf-8"), viewports))
    return 0


def played(subject: Subject, instruments: BlenderInstruments) -> dict[str, float]:
    """Flicker of what our viewport shows, one sample a frame, by the names of `VIEWPORTS`."""
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_bench_") as folder:
        scratch = Path(folder)
        moments = moments_of(snapshots(subject.blend, subject.frames, subject.resolution, scratch))
        layers = instruments.layers(subject, scratch, lambda _text: None)
        found: dict[str, float] = {}
        for name, blends in VIEWPORTS.items():
            pictures = gl_thread().submit(lambda device, blends=blends: shown(device, moments, blends)).result()
            paths = tuple(scratch / f"{frame}.exr" for frame in subject.frames)
            for path, picture in zip(paths, pictures, strict=True):
                write_picture(path, picture)
            flicker = reference_flicker(Reference(name, FEW, math.nan, math.nan, paths), subject, layers)
            found[name] = math.nan if flicker is None else flicker
        return found


def moments_of(paths: Sequence[Path]) -> list[Moment]:
    """Consecutive snapshots; what does not change is the same object in all."""
    moments: list[Moment] = []
    for path in paths:
        loaded = snapshot.load(path).scene
        scene = shared(loaded, moments[-1].scene) if moments else loaded
        assert scene.camera is not None, "Sponza has a camera"
        moments.append(Moment(scene, scene.camera))
    return moments


def shown(device: Device, moments: Sequence[Moment], blends: bool) -> list[Float32Array]:
    """What a viewport shows of each moment, after it was at rest at the first; `blends`: the temporal filter.

    Scene-linear RGB (H, W, 3), rows from the top. On the GL thread.
    """
    indirect = replace(IndirectSettings(IndirectMethod.MARCH_GRID), temporal_filter=blends)
    settings = RenderSettings(*RESOLUTION, samples=1, indirect=indirect)
    renderer, pictures = Renderer(device), []
    before: Moment | None = None
    for now in [moments[0]] * REST + list(moments):
        renderer.begin(now.scene, now.camera, settings, Frames(previous=before, continuous=True))
        renderer.render_sample()
        pictures.append(renderer.read(Channel.COMBINED)[::-1, :, :3].copy())
        before = now
    renderer.release()
    return pictures[REST:]


def document(text: str, viewports: Sequence[Mapping[str, float]]) -> str:
    """The result, of the report's JSON and of each clip's viewports."""
    scenes = zip(CLIPS, rows_of(text), json.loads(text)["scenes"], viewports, strict=True)
    found = [
        Found(clip, {(row.series, row.label): row for row in rows}, shown_there, scene["reference_flicker"])
        for clip, rows, scene, shown_there in scenes
    ]
    return f"{figures(found)}\n{''.join(verdicts(each) for each in found)}\n{explained()}"


def figures(found: Sequence[Found]) -> str:
    """Flicker and FLIP of every point in every clip, as Markdown."""
    header = ["", "samples"]
    header += [f"{each.clip.title}: {what}" for each in found for what in ("flicker", "FLIP")]
    body: list[list[str]] = []
    for point in POINTS:
        name = f"**{point.series}**" if point.series == MARCH_GRID else point.series
        cells = [cell for each in found for cell in _cells(each, point)]
        body.append([name, point.label.removesuffix(" spp"), *cells])
    bare = {(name, FEW): [each.viewports[name] for each in found] for name in VIEWPORTS}
    bare["Cycles, not denoised, that FLIP is the distance to", REFERENCE_SAMPLES] = [each.reference for each in found]
    for (name, samples), flickers in bare.items():
        cells = [cell for flicker in flickers for cell in (f"{flicker:.5f}", "–")]
        body.append([name, str(samples), *cells])
    return table(header, body)


def _cells(found: Found, point: Point) -> list[str]:
    """Flicker and FLIP of a point."""
    row = found.rows[point.series, point.label]
    return [f"{row.flicker:.5f}", f"{row.flip:.3f}"]


def verdicts(found: Found) -> str:
    """Whether ours flickers less than EEVEE and than one layer, with as many samples, as a Markdown list."""
    own = {(f"{MARCH_GRID}, {samples} spp", samples): _flicker(found, MARCH_GRID, samples) for samples in (FEW, MANY)}
    own[next(iter(VIEWPORTS)), FEW] = next(iter(found.viewports.values()))
    lines = ""
    for (name, samples), flicker in own.items():
        answers = [_below("EEVEE's", flicker, {f"{samples} spp": _flicker(found, EEVEE_NAME, samples)})]
        answers.append(
            _below("one layer's", flicker, {each: _flicker(found, each, samples) for each in ONE_LAYER}),
        )
        lines += f"- {found.clip.title}, {name}, {flicker:.5f}: {'; '.join(answers)}\n"
    return lines


def _flicker(found: Found, series: str, samples: int) -> float:
    """Of one point. Raises KeyError where it is missing."""
    return found.rows[series, f"{samples} spp"].flicker


def _below(whose: str, own: float, others: Mapping[str, float]) -> str:
    """`below EEVEE's: yes (…)`: whether a figure is below each of the others."""
    answers = (f"{'yes' if own < other else 'no'} ({name}: {other:.5f})" for name, other in others.items())
    return f"below {whose}: {', '.join(answers)}"


def explained() -> str:
    """What was measured, and how."""
    width, height = RESOLUTION
    return (
        "*Flicker* is the report's own: root mean square change of the displayed picture (Standard) from frame to "
        "frame along our motion vectors, over the same pixels for all rows; lower is better. *FLIP* is the mean "
        f"distance to Cycles with {REFERENCE_SAMPLES} samples, noise of its own included: a picture that is wrong can "
        "be steady, and one without contrast is. Every engine renders the frames of a final animation afresh with its "
        "own default seed; a viewport goes on from the picture before, here from rest at the first frame.\n\n"
        f"Slow pan: the camera moves to its left by {PIXELS:g} px a frame at {DEPTH:g} m. Moving sun: it turns about "
        f"the vertical by {TURN:g}° a frame. {len(FRAMES)} frames of {SPONZA.name} each, {width}×{height}.\n\n"
        f"`python3 build.py bench {NAME}`. Machine: {machine()}.\n"
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
