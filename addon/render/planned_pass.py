# SPDX-License-Identifier: GPL-3.0-or-later
"""What a plan is made of."""

from dataclasses import dataclass

from .layout import TargetSpec


@dataclass(frozen=True)
class PlannedPass:
    """A pass that runs: target names it reads, targets it writes, its shader defines."""

    name: str
    reads: tuple[str, ...] = ()
    writes: tuple[TargetSpec, ...] = ()
    defines: frozenset[str] = frozenset()


@dataclass(frozen=True)
class LeftOut:
    """Something the scene or the settings do not need, and why."""

    name: str
    reason: str
