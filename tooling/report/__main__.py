# SPDX-License-Identifier: GPL-3.0-or-later
"""`build.py report`, from where its command line is checked and the environments are there: options as JSON."""

import json
import signal
import sys
from pathlib import Path
from types import FrameType
from typing import Any

from addon.report import sweep
from addon.report.messages import INTERRUPTED
from tooling.console import ToolError, warn
from tooling.report.instruments import BlenderInstruments
from tooling.report.interfaces import Options
from tooling.report.run import make

WARM_SECONDS = 4.0
QUICK_WARM_SECONDS = 1.0


def options_of(job: dict[str, Any]) -> Options:
    """The options in a job of `tooling.reporting`."""
    return Options(
        scenes=tuple((Path(path), crop and (crop[0], crop[1])) for path, crop in job["scenes"]),
        folder=Path(job["folder"]),
        quick=job["quick"],
        resolution=job["resolution"] and (job["resolution"][0], job["resolution"][1]),
        frames=job["frames"] and tuple(job["frames"]),
        rounds=job["rounds"],
        command=job["command"],
    )


def main(job: dict[str, Any]) -> int:
    """Make the report of a job; the exit code: 1 where something could not be measured."""
    options = options_of(job)
    warm_seconds = QUICK_WARM_SECONDS if options.quick else WARM_SECONDS
    instruments = BlenderInstruments(Path(job["python"]), warm_seconds, job["reference_samples"])
    problems = make(options, sweep.points(quick=options.quick), instruments)
    if problems:
        warn(f"error: {len(problems)} of what was asked for could not be measured:")
        for problem in problems:
            warn(f"  {problem}")
    return 1 if problems else 0


def interrupt(_number: int, _frame: FrameType | None) -> None:
    """SIGTERM ends a report as SIGINT does."""
    raise KeyboardInterrupt


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, interrupt)
    try:
        sys.exit(main(json.loads(sys.argv[1])))
    except ToolError as error:
        warn(f"error: {error}")
        sys.exit(1)
    except KeyboardInterrupt:
        warn("interrupted; start it again to go on")
        sys.exit(INTERRUPTED)
