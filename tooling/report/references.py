# SPDX-License-Identifier: GPL-3.0-or-later
"""What pictures are judged by: a reference beside the .blend, else one that Cycles renders in parts kept in the cache.

A part has a seed of its own and is in the cache the moment it is done, so whatever interrupts a reference, the parts
that it has are not rendered again; a reference of more samples takes over those of one of fewer.
"""

import hashlib
import json
import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from addon.output import write_channels
from addon.report.metrics import display
from addon.report.pictures import combined
from addon.report.reference import REFERENCE_SETTINGS, noise_of, noise_of_mean
from addon.scene.arrays import Float32Array
from tooling import environments, places
from tooling.console import ToolError
from tooling.report import blender
from tooling.report.pictures import centre, flip
from tooling.report.results import Reference, Subject

GIVEN = "reference.exr"
"""A picture of this name beside the .blend is taken where it fits."""

PART_SAMPLES = 64
CHECK_SAMPLES = 32
"""Samples of each of the two pictures that a given reference's noise is estimated by."""

TOO_NOISY = 2.0
"""Noise of a given reference, over that of those pictures' mean, that says it is of something else: a quarter of the
samples."""


def provide(subject: Subject, samples: int, version: str, report_progress: blender.Tell) -> Reference:
    """What `subject` is judged by, with an estimate of its noise: `reference.exr` beside the .blend where that has the
    subject's resolution and the subject is the file's own frame, else Cycles with at least `samples` per pixel.

    `version`: Blender's, as `blender.look` tells it. Raises ToolError where Cycles cannot render what is not in the
    cache, or a file cannot be read or written.
    """
    try:
        if _is_given(subject, version):
            return _given(subject, version, report_progress)
        return _rendered(subject, samples, version, report_progress)
    except (ToolError, OSError, ValueError) as error:
        raise ToolError(f"{subject.name} has no reference: {error}") from error


@dataclass(frozen=True)
class Parts:
    """Pictures of one frame that differ in nothing but Cycles' seed, which counts from 0. `samples`: of each.

    The cache knows them by the content of the .blend, not by what that links to.
    """

    subject: Subject
    frame: int
    samples: int
    version: str

    @property
    def settings(self) -> dict[str, str]:
        """Cycles' settings for all of them."""
        return {**REFERENCE_SETTINGS, "samples": str(self.samples)}

    @property
    def folder(self) -> Path:
        """Where the cache keeps them."""
        content = hashlib.sha256(self.subject.blend.read_bytes()).digest()
        rendered = (self.frame, *self.subject.resolution, self.version, sorted(self.settings.items()))
        return places.cache_directory() / "references" / places.key(content, json.dumps(rendered))

    def provide(self, count: int, report_progress: blender.Tell) -> list[Path]:
        """The first `count` of them, plain RGB EXR files; those that are missing are rendered now.

        Raises ToolError where Cycles cannot, OSError where one cannot be written.
        """
        folder = self.folder
        paths = {str(seed): folder / f"part_{seed:04d}.exr" for seed in range(count)}
        missing = [seed for seed, path in paths.items() if not path.is_file()]
        done = count - len(missing)

        def tell(text: str) -> None:
            report_progress(f"reference, frame {self.frame}, part {done + 1} of {count} · {text}")

        def keep(render: blender.Render, rendered: blender.Rendered) -> None:
            nonlocal done
            write_picture(paths[render.name], combined(rendered.pictures[self.frame]))
            done += 1

        if missing:
            renders = [blender.Render(seed, "CYCLES", {**self.settings, "seed": seed}) for seed in missing]
            with tempfile.TemporaryDirectory(prefix="deep_gbuffer_") as scratch:
                blender.render(
                    _python(self.version),
                    self.subject.blend,
                    [self.frame],
                    self.subject.resolution,
                    renders,
                    Path(scratch),
                    tell,
                    keep,
                )
        return list(paths.values())


def _is_given(subject: Subject, version: str) -> bool:
    """Whether there is a reference beside the .blend that shows what is to be judged."""
    path = subject.blend.with_name(GIVEN)
    if not path.is_file() or len(subject.frames) != 1:
        return False
    height, width, _ = combined(path).shape
    return (width, height) == subject.resolution and (
        blender.look(_python(version), subject.blend).frame == subject.frames[0]
    )


def _given(subject: Subject, version: str, report_progress: blender.Tell) -> Reference:
    """The reference beside the .blend.

    Its noise as FLIP is that of the mean of two pictures by Cycles, times how much less noise it has than they in RMSE;
    unknown where this Blender has no Cycles. Raises ToolError where it is further from the two than noise explains.
    """
    path = subject.blend.with_name(GIVEN)
    source = f"{GIVEN} beside {subject.blend.name}"
    try:
        parts = Parts(subject, subject.frames[0], CHECK_SAMPLES, version).provide(2, report_progress)
    except blender.NoEngineError:
        return Reference(source, None, math.nan, math.nan, (path,))
    first, second = (centre(combined(each), subject.crop) for each in parts)
    noise = noise_of(centre(combined(path), subject.crop), first, second)
    noise_of_both = noise_of_mean(first, second)
    if noise > TOO_NOISY * noise_of_both:
        raise ToolError(
            f"{source} does not show this file as Cycles renders it now, or has more noise than "
            f"{CHECK_SAMPLES // 2} samples; without it Cycles renders one."
        )
    share = noise / noise_of_both if noise_of_both else 0.0
    return Reference(source, None, noise, share * _apart(first, second), (path,))


def _rendered(subject: Subject, samples: int, version: str, report_progress: blender.Tell) -> Reference:
    """The mean of two halves of as many parts each, by Cycles; their noise is the mean over the frames."""
    each = min(PART_SAMPLES, -(-samples // 2))
    count = 2 * -(-samples // (2 * each))
    pictures: list[Path] = []
    noises: list[tuple[float, float]] = []
    for frame in subject.frames:
        parts = Parts(subject, frame, each, version).provide(count, report_progress)
        even, odd = mean(parts[::2]), mean(parts[1::2])
        pictures.append(parts[0].with_name(f"mean_{count:04d}.exr"))
        if not pictures[-1].is_file():
            write_picture(pictures[-1], (even + odd) / np.float32(2.0))
        halves = centre(even, subject.crop), centre(odd, subject.crop)
        noises.append((noise_of_mean(*halves), _apart(*halves)))
    noise_rmse, noise_flip = (float(np.mean(each)) for each in zip(*noises, strict=True))
    return Reference(f"Cycles of Blender {version}", each * count, noise_rmse, noise_flip, tuple(pictures))


def _apart(first: Float32Array, second: Float32Array) -> float:
    """An estimate of how far the mean of two independent pictures is from the truth in FLIP: half of their distance."""
    return flip(display(first), display(second))[1] / 2.0


def mean(paths: Sequence[Path]) -> Float32Array:
    """The mean of pictures of one size. Raises OSError and ValueError as `combined`."""
    total = sum((combined(path).astype(np.float64) for path in paths[1:]), combined(paths[0]).astype(np.float64))
    return (total / len(paths)).astype(np.float32)


def write_picture(path: Path, picture: Float32Array) -> None:
    """Write scene-linear RGB (H, W, 3) as an EXR file that is never half; makes the folder. Raises OSError."""
    write_channels(path, {letter: picture[::-1, :, index] for index, letter in enumerate("RGB")})


def _python(version: str) -> Path:
    """The interpreter with Blender `version`. Raises ToolError where it cannot be set up."""
    return environments.blender_python(".".join(version.split(".")[:2]))
