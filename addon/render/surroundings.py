# SPDX-License-Identifier: GPL-3.0-or-later
"""Which other frames a view's pictures need, seen through cameras with the guard band."""

from collections.abc import Hashable
from dataclasses import dataclass

from ..scene import Camera, Moment, RenderSettings, Sequence, Variant
from ..scene.extrapolation import extrapolated
from ..scene.history import is_cut
from .plan import Plan, guarded


@dataclass(frozen=True)
class Surroundings:
    """The frames around a view; each is what the field of the same name in `Frame` says."""

    view: Camera
    previous: Moment | None
    history: Moment | None
    ahead: Moment | None


def surroundings(current: Moment, sequence: Sequence, plan: Plan, settings: RenderSettings) -> Surroundings:
    """The frames around `current` that its plan makes use of. Those of `sequence` see the same picture without guard
    band."""

    def widened(moment: Moment) -> Moment:
        return Moment(moment.scene, guarded(moment.camera, settings, plan.guard_band))

    now = widened(current)
    previous = widened(sequence.previous) if sequence.previous else None
    earlier = widened(sequence.earlier) if sequence.earlier else previous
    history = ahead = None
    if not sequence.continuous and previous and earlier and not is_cut(previous, now):
        if plan.variant in (Variant.PREVIOUS, Variant.REPROJECT):
            history = previous
        elif plan.variant is Variant.PREDICT:
            history = extrapolated(earlier, previous)
    if plan.look_ahead and plan.variant is Variant.PREDICT:
        ahead = extrapolated(previous, now) if previous and not is_cut(previous, now) else now
    elif plan.look_ahead and sequence.continuous and sequence.following:
        ahead = widened(sequence.following)
    return Surroundings(now.camera, previous, history, ahead)


def oracle_depends_on(settings: RenderSettings, plan: Plan) -> Hashable:
    """What the oracle's layout and contents depend on besides scene and camera."""
    return (
        plan.variant,
        plan.layers,
        plan.guard_band,
        settings.width,
        settings.height,
        settings.minimum_separation,
        settings.relative_separation,
        settings.alpha_threshold,
        settings.layering,
    )
