# SPDX-License-Identifier: GPL-3.0-or-later
"""How far one picture's light is from another's, and a sheet that shows where."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

OFF = 0.05
"""Share of the reference by which a pixel may differ before it counts as off."""

FLOOR = 0.01
"""Share of the reference's mean below which no difference counts: where it is dark, ratios mean nothing."""

SHEET_SCALE = 4


@dataclass(frozen=True)
class Difference:
    """Of our picture from the reference, over the pixels that were compared.

    `mean`: Σ|ours − theirs| / Σ theirs over pixels and channels, so it counts each pixel by its light.
    `off`: share of pixels in one of whose channels |ours − theirs| exceeds both 5 % of theirs and 1 % of the
    reference's mean. `total`: Σ ours / Σ theirs − 1.
    """

    mean: float
    off: float
    total: float

    def __str__(self) -> str:
        return f"mean error {self.mean:.2%}, {self.off:.2%} of the pixels off, total {self.total:+.2%}"


def difference(ours: np.ndarray, theirs: np.ndarray, compared: np.ndarray) -> Difference:
    """Of two pictures (H, W, 3) where `compared` (H, W) is true; without light in the reference all is infinite."""
    mine, reference = ours[compared].astype(np.float64), theirs[compared].astype(np.float64)
    total = reference.sum()
    if total <= 0.0:
        return Difference(np.inf, np.inf, np.inf)
    error = np.abs(mine - reference)
    off = (error > np.maximum(OFF * reference, FLOOR * reference.mean())).any(axis=-1)
    return Difference(float(error.sum() / total), float(off.mean()), float(mine.sum() / total - 1.0))


def write_sheet(path: Path, ours: np.ndarray, theirs: np.ndarray) -> Path:
    """Ours | Cycles | difference, as one PNG: both at the same exposure, grey where equal, brighter where ours is.

    The difference's full range is ±10 % of the value that is shown white.
    """
    white = max(float(np.percentile(theirs, 98.0)), 1e-12)
    pictures = [_srgb(picture / white) for picture in (ours, theirs)]
    pictures.append(np.clip(0.5 + (ours.astype(np.float64) - theirs) / (0.2 * white), 0.0, 1.0))
    sheet = np.rint(255.0 * np.concatenate(pictures, axis=1)).astype(np.uint8)
    sheet = sheet.repeat(SHEET_SCALE, axis=0).repeat(SHEET_SCALE, axis=1)
    Image.fromarray(sheet).save(path)
    return path


def _srgb(linear: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1 of values that are cut to 0…1; NaN as 1."""
    values = np.clip(np.nan_to_num(linear.astype(np.float64), nan=1.0), 0.0, 1.0)
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1.0 / 2.4) - 0.055)
