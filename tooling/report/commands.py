# SPDX-License-Identifier: GPL-3.0-or-later
"""The command that renders one point of a report again."""

import re
import shlex

from addon.report.engines import ENGINES
from addon.report.sweep import PERCENT, Point
from tooling.report.results import Subject

REPEATS = 3
"""Renders in one process: the first is cold, the others are warm."""


def repeat(subject: Subject, point: Point, blender: str) -> str:
    """A line for a POSIX shell that renders and times `point` of `subject` again, in Blender `blender` ("5.2.1", say).

    A resolution in percent becomes pixels, and a number of samples becomes `--samples`, whatever the engine calls it.
    """
    settings = dict(point.settings)
    width, height = (_scaled(extent, settings.get(PERCENT, "100")) for extent in subject.resolution)
    settings.pop(PERCENT, None)
    samples = settings.pop(ENGINES[point.engine].samples, None)
    words = ["python3", "build.py", "render", str(subject.blend), "--engine", point.engine]
    words += ["--resolution", f"{width}x{height}"]
    words += ["--samples", samples] if samples and samples.isdigit() else []
    words += [part for name, value in settings.items() for part in ("--set", f"{name}={value}")]
    first, last = subject.frames[0], subject.frames[-1]
    words += ["--frame", str(first)] if first == last else ["--frames", f"{first}-{last}"]
    version = re.match(r"\d+\.\d+", blender)
    words += ["--blender", version[0]] if version else []
    words += ["--repeat", str(REPEATS), "--stats", "seconds.json", "-o", "picture.exr"]
    return shlex.join(words)


def _scaled(extent: int, percent: str) -> int:
    """Pixels that Blender renders of `extent` at a resolution percentage."""
    return extent * int(percent) // 100
