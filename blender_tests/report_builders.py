# SPDX-License-Identifier: GPL-3.0-or-later
"""Made-up reports for tests of what is made of them."""

from dataclasses import replace
from pathlib import Path

from PIL import Image

from addon.report.metrics import Errors
from addon.report.sweep import Point, points
from tooling.report.results import Judgement, Measurement, Reference, Report, Run, SceneReport, Subject

SIZE = (48, 27)


def errors(**changes):
    """Some errors."""
    return replace(Errors(0.02, 0.03, 30.0, (-0.01, 0.002, 0.0), 0.5, 0), **changes)


def picture(path: Path, color: tuple[int, int, int], size: tuple[int, int] = SIZE) -> Path:
    """A PNG of one colour."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", size, color).save(path)
    return path


def measurement(
    point=None, folder=Path("nowhere"), *, warm=(0.5, 0.6, 0.55), cold=1.5, flip=0.1, digest=None, flicker=None, **more
):
    """A point measured in one process."""
    point = point or Point("Samples", "4 spp", "DEEP_GBUFFER", {"samples": "4"})
    judged = Judgement(
        errors=more.pop("errors", errors()),
        flip=flip,
        flicker=flicker,
        digest=digest or f"{point.identity}",
        picture=folder / "picture.png",
        heat=folder / "heat.png",
    )
    return Measurement(point, (Run(cold, tuple(warm)),), judged, **more)


def scene(measurements, name="box", **changes):
    """A scene with these measurements."""
    subject = Subject(name, Path(f"scenes/{name}.blend"), (1,), SIZE, None)
    reference = Reference("Cycles, 256 samples", 256, 0.004, 0.01, (Path("nowhere/reference.exr"),))
    return replace(SceneReport(subject, reference, tuple(measurements)), **changes)


def report(*scenes, **changes):
    """A report on these scenes."""
    command = "python3 build.py report scenes/box.blend -o reports"
    return replace(
        Report(scenes, command, "Some Processor, 2 cores, Linux", "5.2.1", "0123abc", "2026-11-22", quick=False),
        **changes,
    )


def swept(folder: Path = Path("nowhere"), *, quick: bool = True) -> list[Measurement]:
    """Every point of the table, measured: the slower, the better, and settings that change nothing the same picture."""
    found = []
    for index, point in enumerate(points(quick=quick)):
        samples = int(point.settings.get("samples", point.settings.get("taa_render_samples", "1")))
        scale = 1.0 if point.settings.get("resolution_percentage", "100") == "100" else 2.0
        family = {"DEEP_GBUFFER": 0.3, "CYCLES": 0.25, "EEVEE": 0.55, "WORKBENCH": 0.7}[point.engine]
        gain = 0.25 if point.settings.get("use_denoising") != "True" else 0.45
        flip = family * scale**0.3 * samples**-gain
        seconds = (0.05 + 0.04 * samples) * {"EEVEE": 30.0, "CYCLES": 5.0}.get(point.engine, 1.0) * (1 + 0.01 * index)
        found.append(
            measurement(
                point,
                folder,
                warm=(seconds, 1.2 * seconds, 0.95 * seconds),
                cold=3.0 * seconds,
                flip=flip,
                digest=f"{point.engine} {flip}",
                errors=errors(rmse=0.4 * flip, relative_mse=flip**2),
                left_out=(("layer 2", "nothing reads it"),) if "layers" in point.settings else (),
            )
        )
    return found
