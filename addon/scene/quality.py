# SPDX-License-Identifier: GPL-3.0-or-later
"""Quality of indirect light: error against time, as a few named sets of numbers."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class Quality(StrEnum):
    """From fast and noisy to slow and close to the truth."""

    DRAFT = "DRAFT"
    MEDIUM = "MEDIUM"
    HIGH = "HIGH"
    ULTRA = "ULTRA"


@dataclass(frozen=True)
class QualityNumbers:
    """Those numbers of `IndirectSettings` that trade error for time, with their names and units there."""

    rays: int
    divisor: int
    taps: int
    march_steps: int
    contact_steps: int
    cells: int
    cell_rays: int


QUALITIES: Mapping[Quality, QualityNumbers] = {
    Quality.DRAFT: QualityNumbers(rays=4, divisor=4, taps=9, march_steps=16, contact_steps=0, cells=48, cell_rays=16),
    Quality.MEDIUM: QualityNumbers(rays=8, divisor=2, taps=19, march_steps=32, contact_steps=4, cells=64, cell_rays=32),
    Quality.HIGH: QualityNumbers(rays=16, divisor=2, taps=32, march_steps=48, contact_steps=4, cells=96, cell_rays=64),
    Quality.ULTRA: QualityNumbers(
        rays=32, divisor=1, taps=64, march_steps=64, contact_steps=8, cells=128, cell_rays=128
    ),
}
"""The one table of them."""

DEFAULT_QUALITY = Quality.MEDIUM
"""Of renders and of viewports."""
