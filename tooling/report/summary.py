# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene's figures say, in sentences."""

import math
from collections.abc import Callable, Sequence

from addon.report.engines import ENGINES
from addon.report.sweep import OURS
from tooling.report.columns import number, seconds, signed
from tooling.report.results import SceneReport
from tooling.report.tables import Row

BUDGETS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
"""Seconds that a person might wait."""
SAMPLES = "Samples"
"""The series of our engine whose points differ in nothing but the number of samples."""
FLAT = 0.9
"""More samples change little where they leave at least this part of FLIP."""
BIASED = 0.5
"""From this part of RMSE on, bias is a large part of it."""


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
    parts = [
        _at_a_budget(rows),
        _against_the_peer(rows),
        _flattening(rows),
        _below_noise(rows, scene.reference.noise_flip),
        _same_pictures(rows),
    ]
    return [part for part in parts if part]


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
    told = f"The fastest denoised Cycles takes {seconds(peer.warm_s)} s warm, FLIP {number(peer.flip)}"
    ours = best_within([row for row in rows if is_ours(row)], peer.warm_s)
    if ours is None:
        return f"{told}; no point of Deep G-Buffer is that fast."
    ratio = f", {number(ours.flip / peer.flip, 2)} times as much" if peer.flip > 0.0 else ""
    return f"{told}; in that time Deep G-Buffer reaches {number(ours.flip)}{ratio} ({_point(ours)})."


def bias_share(row: Row) -> float:
    """How much of RMSE is bias: the root mean square of the channels' biases over RMSE, NaN where there is no error.

    From 0 to 1: RMSE² is the mean over channels of bias² + the variance of the error over the picture. At a half, a
    quarter of the squared error is one and the same offset everywhere.
    """
    bias = math.hypot(row.bias_red, row.bias_green, row.bias_blue) / math.sqrt(3.0)
    return bias / row.rmse if row.rmse > 0.0 else math.nan


def _flattening(rows: Sequence[Row]) -> str:
    """Why more samples do not help, where that is so.

    Where the most samples of our series leave at least `FLAT` of the fewest's FLIP, and bias is at least `BIASED` of
    their RMSE (`bias_share`); noise cannot be what is left there.
    """
    series = [row for row in rows if is_ours(row) and row.series == SAMPLES]
    counts = {int(row.settings["samples"]): row for row in series if row.settings.get("samples", "").isdigit()}
    if len(counts) < 2:
        return ""
    few, many = min(counts), max(counts)
    first, last = counts[few], counts[many]
    if not (last.flip >= FLAT * first.flip and bias_share(last) >= BIASED):
        return ""
    bias = zip(("red", "green", "blue"), (last.bias_red, last.bias_green, last.bias_blue), strict=True)
    return (
        f"From {few} to {many} samples Deep G-Buffer's FLIP {_course(first.flip, last.flip)}: a large "
        f"part of what is left is bias ({', '.join(f'{name} {signed(value)}' for name, value in bias)}), which more "
        "samples do not remove."
    )


def _course(first: float, last: float) -> str:
    """How a figure goes from `first` to `last`."""
    if number(first) == number(last):
        return f"stays {number(last)}"
    return f"{'rises' if last > first else 'falls only'} from {number(first)} to {number(last)}"


def _below_noise(rows: Sequence[Row], noise: float) -> str:
    """Warns where figures are finer than the reference."""
    count = sum(row.flip < noise for row in rows)
    if not count:
        return ""
    noun = "point has" if count == 1 else "points have"
    return f"{count} {noun} a FLIP below the reference's own noise ({number(noise)}): there it cannot tell them apart."


def _same_pictures(rows: Sequence[Row]) -> str:
    """How many points are the same picture again, and how far times of one picture differ."""
    count = sum(bool(row.same_picture_as) for row in rows)
    if not count:
        return ""
    verb = "point is" if count == 1 else "points are"
    return f"{count} of {len(rows)} {verb} bit for bit the picture of another.{_same_times(rows)}"


def _same_times(rows: Sequence[Row]) -> str:
    """Warm seconds of the largest group of points with bit for bit the same picture and equally many samples.

    Points that were not timed do not count; of equally large groups the first. "" where no group has two points.
    """
    groups: dict[tuple[str, str | None], list[float]] = {}
    for row in rows:
        if row.warm_renders:
            samples = row.settings.get(ENGINES[row.engine].samples)
            groups.setdefault((row.same_picture_as or row.name, samples), []).append(row.warm_s)
    times = max(groups.values(), key=len, default=[])
    if len(times) < 2:
        return ""
    return (
        f" {len(times)} points with one picture and equally many samples took {seconds(min(times))} to "
        f"{seconds(max(times))} s: differences in time as small as that say little about settings."
    )


def _point(row: Row) -> str:
    """A point with its time."""
    return f"{row.name}, {seconds(row.warm_s)} s"
