# SPDX-License-Identifier: GPL-3.0-or-later
"""What limits our error in real scenes: one kind of light at a time exchanged for that of Cycles' passes."""

import json
import sys
import tempfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from addon.report.metrics import display, errors
from addon.report.pictures import channels, combined
from addon.report.reference import REFERENCE_SETTINGS
from addon.scene.arrays import Float32Array
from blender_tests.bench._runs import SHARED, in_blender, report, table
from tooling import places
from tooling.machine import machine
from tooling.report.pictures import centre, flip
from tooling.report.results import Crop

NAME = "limits"
JOB = Path(__file__).resolve().parent / "_limits_job.py"
RESOLUTION = (640, 360)
SAMPLES = (1, 16)
PASS_SAMPLES = 256
"""Of Cycles, for all its passes."""

LAMP_SAMPLES = 128
"""Of Cycles, for its diffuse light straight from lamps, the world left out."""


@dataclass(frozen=True)
class Case:
    """A scene, the rectangle of it that is judged, and the FLIP that one sample must not exceed."""

    name: str
    crop: Crop | None
    target: float

    @property
    def blend(self) -> Path:
        """The file."""
        return SHARED / self.name / f"{self.name}.blend"


CASES = (Case("cornell", (360, 360), 0.085), Case("sponza", None, 0.10), Case("living_room", None, 0.14))

LAMPS = "diffuse light straight from lamps"
GATHERED = "diffuse light from the world and from other surfaces"
GLOSSY_DIRECT = "glossy reflections of lamps and world"
GLOSSY_INDIRECT = "glossy reflections of other surfaces"
TRANSMISSION = "light through glass"
BACKGROUND = "emission and the world seen directly"

SETS = {
    **{name: (name,) for name in (LAMPS, GATHERED, GLOSSY_DIRECT, GLOSSY_INDIRECT, TRANSMISSION, BACKGROUND)},
    "both that we have no pass for: of other surfaces, and through glass": (GLOSSY_INDIRECT, TRANSMISSION),
    "all glossy reflections, and glass": (GLOSSY_DIRECT, GLOSSY_INDIRECT, TRANSMISSION),
    "diffuse light straight from lamps, and their and the world's reflections": (LAMPS, GLOSSY_DIRECT),
}
"""Kinds of light that are exchanged together, by what the table calls them."""

Pieces = Mapping[str, Float32Array]
"""Radiance (H, W, 3) by kind of light; their sum is the picture."""


@dataclass(frozen=True)
class Judged:
    """How far a picture is from the reference."""

    flip: float
    rmse: float

    @classmethod
    def of(cls, picture: Float32Array, reference: Float32Array, crop: Crop | None) -> "Judged":
        """Both (H, W, 3), scene-linear, judged within `crop`."""
        shown, truth = centre(picture, crop), centre(reference, crop)
        return cls(flip(display(truth), display(shown))[1], errors(shown, truth).rmse)

    def __str__(self) -> str:
        return f"{self.flip:.3f} ({self.rmse:.3f})"


def main(arguments: list[str]) -> int:
    """Run the bench."""
    if arguments:
        print(f"{NAME} takes no arguments")
        return 2
    text = ""
    for case in CASES:
        if case.blend.is_file():
            text += measured(case)
        else:
            print(f"left out, as it is not there: {case.blend.name}")
    if text:
        report(NAME, "What limits the error", f"{text}{explained()}")
    return 0


def measured(case: Case) -> str:
    """The section of one scene."""
    reference = combined(case.blend.with_name("reference.exr"))
    theirs = pieces_of_cycles(case.blend)
    floor = Judged.of(total(theirs), reference, case.crop)
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_bench_") as folder:
        ours = [pieces_of_ours(case.blend, samples, Path(folder)) for samples in SAMPLES]
    whole = [Judged.of(total(pieces), reference, case.crop) for pieces in ours]
    rows = [["**ours as it is**", *(cell for judged in whole for cell in (f"**{judged}**", "0"))]]
    present = {name for pieces in (theirs, *ours) for name, light in pieces.items() if light.any()}
    for title, names in SETS.items():
        if not present.issuperset(names):
            continue
        row = [title]
        for pieces in ours:
            change = total({name: theirs[name] - pieces[name] for name in names})
            row.append(str(Judged.of(total(pieces) + change, reference, case.crop)))
            row.append(str(Judged.of(reference - change, reference, case.crop)))
        rows.append(row)
    header = ["FLIP (RMSE)"]
    header += [f"{count(samples)}: {what}" for samples in SAMPLES for what in ("Cycles' instead", "ours alone")]
    verdict = verdict_on(whole[0].flip, case.target)
    return (
        f"## {case.name.replace('_', ' ').title()}\n\n{table(header, rows)}\nThe sum of Cycles' passes is "
        f"{floor} from the reference: noise. FLIP {case.target:g} is the target of one sample: {verdict}.\n\n"
        f"{table(['mean radiance', *map(count, SAMPLES), 'Cycles'], means(present, ours, theirs, case.crop))}\n"
    )


def means(names: Collection[str], ours: Sequence[Pieces], theirs: Pieces, crop: Crop | None) -> list[list[str]]:
    """The mean over pixels and colours of some kinds of light, per kind: of each of ours, and of Cycles'."""
    columns = [mean_of_each(pieces, crop) for pieces in (*ours, theirs)]
    return [[name, *(f"{column[name]:.4f}" for column in columns)] for name in theirs if name in names]


def mean_of_each(pieces: Pieces, crop: Crop | None) -> dict[str, float]:
    """The mean over pixels and colours within `crop`, by kind of light."""
    return {name: float(centre(light, crop).mean()) for name, light in pieces.items()}


def verdict_on(found: float, target: float) -> str:
    """Whether a FLIP is what it should be at most, and by how much it is not."""
    return f"missed by {found - target:.3f}" if found > target else "met"


def count(samples: int) -> str:
    """`1 sample`, `16 samples`."""
    return f"{samples} sample{'s' if samples > 1 else ''}"


def total(pieces: Pieces) -> Float32Array:
    """The sum of some kinds of light."""
    return np.stack(list(pieces.values())).sum(axis=0)


def pieces_of_cycles(blend: Path) -> Pieces:
    """What Cycles finds; from the cache of references where that has it."""
    everything = cached_passes(blend, {"samples": str(PASS_SAMPLES)}, lamps_only=False)
    direct = cached_passes(blend, {"samples": str(LAMP_SAMPLES), "max_bounces": "0"}, lamps_only=True)
    lamps = direct["Diffuse Direct"]
    return {
        **pieces(everything),
        LAMPS: lamps,
        GATHERED: pieces(everything)[LAMPS] + pieces(everything)[GATHERED] - lamps,
    }


def pieces_of_ours(blend: Path, samples: int, folder: Path) -> Pieces:
    """What our engine finds with its default settings; it gathers the world's diffuse light, so that is no lamps'."""
    picture = folder / f"ours_{samples}.exr"
    render(blend, "DEEP_GBUFFER", {"samples": str(samples)}, lamps_only=False, picture=picture)
    return pieces(light_passes(picture))


def pieces(passes: Mapping[str, Float32Array]) -> dict[str, Float32Array]:
    """Kinds of light of an engine whose diffuse direct pass has lamps only."""
    return {
        LAMPS: passes["Diffuse Direct"],
        GATHERED: passes["Diffuse Indirect"],
        GLOSSY_DIRECT: passes["Glossy Direct"],
        GLOSSY_INDIRECT: passes["Glossy Indirect"],
        TRANSMISSION: passes["Transmission Direct"] + passes["Transmission Indirect"],
        BACKGROUND: passes["Emission"] + passes["Environment"],
    }


def cached_passes(blend: Path, settings: Mapping[str, str], *, lamps_only: bool) -> dict[str, Float32Array]:
    """`light_passes` of what Cycles renders with some settings, only where the cache of references lacks it."""
    wanted = {**REFERENCE_SETTINGS, "seed": "1", **settings}
    made = json.dumps([RESOLUTION, lamps_only, sorted(wanted.items())])
    path = places.cache_directory() / "references" / places.key(blend.read_bytes(), made) / "passes.exr"
    if not path.is_file():
        with places.replacing(path) as draft:
            render(blend, "CYCLES", wanted, lamps_only=lamps_only, picture=draft)
    return light_passes(path)


def render(blend: Path, engine: str, settings: Mapping[str, str], *, lamps_only: bool, picture: Path) -> None:
    """Write a multi-layer EXR with all passes of light to `picture`."""
    job = {"file": str(blend.resolve()), "resolution": RESOLUTION, "engine": engine, "settings": dict(settings)}
    in_blender(JOB, json.dumps({**job, "lamps_only": lamps_only, "picture": str(picture)}))


def light_passes(picture: Path) -> dict[str, Float32Array]:
    """Radiance (H, W, 3) by Blender's name of the pass, multiplied by its colour; black where an engine has no pass."""
    found = channels(picture)
    black = np.zeros((RESOLUTION[1], RESOLUTION[0], 3), np.float32)

    def pixels(name: str) -> Float32Array:
        planes = [[plane for key, plane in found.items() if key.endswith(f".{name}.{letter}")] for letter in "RGB"]
        return np.stack([plane for (plane,) in planes], axis=-1) if all(planes) else black

    kinds = [f"{kind} {way}" for kind in ("Diffuse", "Glossy", "Transmission") for way in ("Direct", "Indirect")]
    light = {name: pixels(name) * pixels(f"{name.split()[0]} Color") for name in kinds}
    return {**light, "Emission": pixels("Emission"), "Environment": pixels("Environment")}


def explained() -> str:
    """How to read the tables, and how they were made."""
    return (
        "Kinds of light that a scene has none of are left out. *Cycles' instead*: our picture with this kind of light "
        "exchanged for Cycles', so what is left without its error. *Ours alone*: the reference with this kind of light "
        "exchanged for ours, so what its error costs where all else is right. Errors of several kinds add up, or "
        "cancel, and FLIP is not linear: neither column sums to the whole.\n\n"
        f"`python3 build.py bench {NAME}`: {RESOLUTION[0]}×{RESOLUTION[1]}, default settings, cornell judged in its "
        f"360×360 centre; Cycles' passes with {PASS_SAMPLES} samples, its lamps' diffuse light by a render of its own "
        f"without bounces and world, {LAMP_SAMPLES} samples. Machine: {machine()}.\n"
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
