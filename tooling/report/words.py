# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene's section says besides figures, the same on the page and in Markdown."""

from collections.abc import Sequence

from tooling.report.columns import number
from tooling.report.results import SceneReport
from tooling.report.summary import is_ours
from tooling.report.tables import Row

SOFTWARE = ("llvmpipe", "softpipe", "swrast")
"""What OpenGL calls Mesa's drivers that draw on the processor."""
SAME_PICTURES = (
    "Points with the same picture differ in settings that change nothing in this scene; the list of skipped work says "
    "why."
)


def machine(told: str) -> str:
    """The machine, of which `told` names the OpenGL device too, with what it means where that is the processor."""
    if not any(driver in told.lower() for driver in SOFTWARE):
        return told
    return (
        f"{told} (OpenGL on the processor, no graphics card: on one, EEVEE, Workbench and Deep G-Buffer take other "
        "times)"
    )


def subject(scene: SceneReport) -> str:
    """What was rendered."""
    measured = scene.subject
    frames = (
        f"frame {measured.frames[0]}"
        if len(measured.frames) == 1
        else f"frames {measured.frames[0]} to {measured.frames[-1]}"
    )
    text = "{}, {}, {}×{} pixels".format(measured.blend.name, frames, *measured.resolution)
    if measured.crop is not None:
        text += ", of which the {}×{} in the centre are judged".format(*measured.crop)
    return f"{text}."


def reference(scene: SceneReport) -> str:
    """What the pictures are judged by, and how far it can be trusted."""
    judge = scene.reference
    samples = f", {judge.samples:,} samples per pixel" if judge.samples else ""
    noise = (
        f"Its own remaining noise is estimated at FLIP {number(judge.noise_flip, 2)} and RMSE "
        f"{number(judge.noise_rmse, 2)}: errors below that mean nothing."
        if judge.is_noise_known
        else "Its own remaining noise is not known, as it takes Cycles to estimate it."
    )
    text = f"Reference: {judge.source.rstrip('.')}{samples}. {noise}"
    if scene.reference_flicker is not None:
        text += f" Its own flicker is {number(scene.reference_flicker, 2)}."
    return text


def rounds(scene: SceneReport) -> str:
    """How often points were measured."""
    processes = [len(each.runs) for each in scene.measurements]
    renders = [sum(len(run.warm) for run in each.runs) for each in scene.measurements]
    return (
        f"Each point was rendered in {_range(processes)} new {_plural('process', 'processes', max(processes))}, "
        f"{_range(renders)} {_plural('time', 'times', max(renders))} warm. Seconds are per frame."
    )


def _range(counts: Sequence[int]) -> str:
    """`2`, or `2 to 5` where counts differ."""
    return f"{min(counts)}" if min(counts) == max(counts) else f"{min(counts)} to {max(counts)}"


def _plural(one: str, many: str, count: int) -> str:
    """The word for so many."""
    return one if count == 1 else many


def left_out(found: Sequence[Row]) -> list[tuple[str, list[str]]]:
    """For whom something was left out (all points of our engine, or names of some), and what and why, as sentences."""
    ours = [row.name for row in found if is_ours(row)]
    whose: dict[str, list[str]] = {}
    for row in found:
        for reason in row.left_out:
            whose.setdefault(reason, []).append(row.name)
    groups: dict[str, list[str]] = {}
    for reason, names in whose.items():
        groups.setdefault("All points" if names == ours else ", ".join(names), []).append(reason)
    return list(groups.items())


def own_left_out(row: Row, found: Sequence[Row]) -> list[str]:
    """What was left out for a point with the same picture as another, and not for that other."""
    others = next((other.left_out for other in found if other.name == row.same_picture_as), row.left_out)
    return [reason for reason in row.left_out if reason not in others]
