# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene's figures say, in sentences."""

from collections.abc import Callable, Sequence

from addon.report.sweep import OURS
from tooling.report.columns import number, seconds
from tooling.report.results import SceneReport
from tooling.report.tables import Row

BUDGETS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
"""Seconds that a person might wait."""


def is_ours(row: Row) -> bool:
    """Whether our engine rendered it."""
    return row.engine == OURS


def is_denoised_cycles(row: Row) -> bool:
    """Whether it is the peer to beat: Cycles with its denoiser."""
    return row.engine == "CYCLES" and row.settings.get("use_denoising") == "True"


def best_within(rows: Sequence[Row], budget: float) -> Row | None:
    """The row with the lowest FLIP of those that take at most `budget` warm seconds; None where none is so fast."""
    return min((row for row in rows if row.warm_s <= budget), key=lambda row: row.flip, default=None)


def fastest(rows: Sequence[Row]) -> Row | None:
    """The row with the fewest warm seconds; None where nothing was timed."""
    return min((row for row in rows if row.warm_renders), key=lambda row: row.warm_s, default=None)


def sentences(rows: Sequence[Row], scene: SceneReport) -> list[str]:
    """What to know about the scene before one looks at its plots; empty where nothing was measured."""
    if not rows:
        return []
    parts = [_at_a_budget(rows), _against_the_peer(rows), _below_noise(rows, scene.reference.noise_flip)]
    return [part for part in (*parts, _same_pictures(rows)) if part]


def _at_a_budget(rows: Sequence[Row]) -> str:
    """Who is best after a second, or after the first budget that both sides can keep."""
    sides: tuple[Callable[[Row], bool], ...] = (is_ours, lambda row: not is_ours(row))
    ours, peers = ([row for row in rows if side(row)] for side in sides)
    fair = [budget for budget in BUDGETS if best_within(ours, budget) and best_within(peers, budget)]
    budget = next((budget for budget in fair if budget >= 1.0), fair[0] if fair else None)
    if budget is None:
        return ""
    (first, leads), (second, follows) = sorted(
        [(best_within(ours, budget), "Deep G-Buffer"), (best_within(peers, budget), "the other engines")],
        key=lambda side: side[0].flip if side[0] else 0.0,
    )
    if first is None or second is None:
        return ""
    return (
        f"Within {budget:g} s the lowest FLIP is {number(first.flip)}, by {leads} ({_point(first)}); "
        f"the best of {follows} is {number(second.flip)} ({_point(second)})."
    )


def _against_the_peer(rows: Sequence[Row]) -> str:
    """What our engine has when the fastest denoised Cycles is done."""
    peer = fastest([row for row in rows if is_denoised_cycles(row)])
    if peer is None:
        return ""
    told = f"Cycles with its denoiser has its first picture after {seconds(peer.warm_s)} s, FLIP {number(peer.flip)}"
    ours = best_within([row for row in rows if is_ours(row)], peer.warm_s)
    if ours is None:
        return f"{told}; no point of Deep G-Buffer is that fast."
    return f"{told}; in that time Deep G-Buffer reaches {number(ours.flip)} ({_point(ours)})."


def _below_noise(rows: Sequence[Row], noise: float) -> str:
    """Warns where figures are finer than the reference."""
    count = sum(row.flip < noise for row in rows)
    if not count:
        return ""
    noun = "point has" if count == 1 else "points have"
    return f"{count} {noun} a FLIP below the reference's own noise ({number(noise)}): there it cannot tell them apart."


def _same_pictures(rows: Sequence[Row]) -> str:
    """How many points are the same picture again."""
    count = sum(bool(row.same_picture_as) for row in rows)
    if not count:
        return ""
    verb = "point is" if count == 1 else "points are"
    return f"{count} of {len(rows)} {verb} bit for bit the picture of another."


def _point(row: Row) -> str:
    """A point with its time."""
    return f"{row.name}, {seconds(row.warm_s)} s"
