# SPDX-License-Identifier: GPL-3.0-or-later
"""A point's pictures against the reference's: numbers, and the first frame as PNG files."""

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from addon.report import metrics
from addon.report.flicker import flicker
from addon.report.metrics import Errors, decibels, display
from addon.report.pictures import channels, combined
from addon.scene.arrays import Float32Array
from tooling.report.pictures import centre, enlarged, flip, write_png
from tooling.report.results import Crop, Judgement, Reference, Subject

NOTHING = 1e10
"""View depth in a layer file where nothing is seen."""


def judge(
    pictures: Sequence[Path],
    reference: Reference,
    subject: Subject,
    layers: Sequence[Path] | None,
    folder: Path,
    name: str,
) -> Judgement:
    """Judge one EXR picture per frame of `subject` within its crop; smaller pictures are enlarged bilinearly first.

    `layers`: a layer file of ours per frame at the subject's resolution, with motion vectors; None: no flicker is told.
    Writes `folder`/NAME.png and NAME_flip.png. Raises OSError where a file cannot be read or written, and ValueError
    where pictures are missing or do not fit; both name what is wrong.
    """
    if not len(pictures) == len(reference.pictures) == len(subject.frames):
        raise ValueError(
            f"{name}: {len(pictures)} pictures and {len(reference.pictures)} of the reference for "
            f"{len(subject.frames)} frames"
        )
    seen: list[Float32Array] = []
    errors: list[Errors] = []
    flips: list[float] = []
    digest = hashlib.sha256()
    shown_path, heat_path = folder / f"{name}.png", folder / f"{name}_flip.png"
    for path, truth_path in zip(pictures, reference.pictures, strict=True):
        picture = combined(path)
        digest.update(f"{picture.shape}".encode() + picture.tobytes())
        judged = centre(enlarged(picture, subject.resolution), subject.crop)
        truth = centre(combined(truth_path), subject.crop)
        errors.append(metrics.errors(judged, truth))
        heat, mean = flip(display(truth), display(judged))
        if not seen:
            write_png(shown_path, display(judged))
            write_png(heat_path, heat)
        flips.append(mean)
        seen.append(display(judged))
    return Judgement(
        errors=_mean(errors),
        flip=float(np.mean(flips)),
        flicker=_flicker(seen, layers, subject.crop),
        digest=digest.hexdigest(),
        picture=shown_path,
        heat=heat_path,
    )


def reference_flicker(reference: Reference, subject: Subject, layers: Sequence[Path]) -> float | None:
    """The reference's own flicker, as in `judge`. Raises OSError and ValueError as that."""
    seen = [display(centre(combined(picture), subject.crop)) for picture in reference.pictures]
    return _flicker(seen, layers, subject.crop)


def _flicker(seen: Sequence[Float32Array], layers: Sequence[Path] | None, crop: Crop | None) -> float | None:
    """Flicker of displayed pictures, by the first layer of our layer files; None for a single frame."""
    if layers is None or len(seen) < 2:
        return None
    depths, motions = zip(*_surfaces(layers, crop), strict=True)
    return flicker(seen, depths, motions)


def _surfaces(layers: Iterable[Path], crop: Crop | None) -> Iterator[tuple[Float32Array, Float32Array]]:
    """View depth (H, W), +inf where nothing is seen, and motion (H, W, 2) of each file's nearest surfaces."""
    for path in layers:
        found = channels(path)
        try:
            depth = found["layer0.Depth.Z"]
            motion = np.stack([found["layer0.Motion.X"], found["layer0.Motion.Y"]], axis=-1)
        except KeyError as error:
            raise ValueError(f"{path} has no channel {error}") from error
        depth = np.where(depth < NOTHING, depth, np.float32(np.inf))
        yield centre(depth, crop), centre(motion, crop)


def _mean(errors: Sequence[Errors]) -> Errors:
    """Of all frames together: squares are averaged before root and logarithm, `invalid` is the sum."""
    shown_mse = np.mean([10.0 ** (-each.psnr / 10.0) for each in errors])
    return Errors(
        rmse=float(np.sqrt(np.mean([each.rmse**2 for each in errors]))),
        relative_mse=float(np.mean([each.relative_mse for each in errors])),
        psnr=decibels(float(shown_mse)),
        bias=(
            float(np.mean([each.bias[0] for each in errors])),
            float(np.mean([each.bias[1] for each in errors])),
            float(np.mean([each.bias[2] for each in errors])),
        ),
        fireflies=float(np.mean([each.fireflies for each in errors])),
        invalid=sum(each.invalid for each in errors),
    )
