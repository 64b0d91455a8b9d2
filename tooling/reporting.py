# SPDX-License-Identifier: GPL-3.0-or-later
"""`build.py report`: check the command line, then leave the work to `tooling.report` in the development environment."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from tooling import environments, places
from tooling.console import ToolError
from tooling.rendering import is_writable

ROUNDS = 3
QUICK_ROUNDS = 1
QUICK_RESOLUTION = (320, 180)
REFERENCE_SAMPLES = 1024
QUICK_REFERENCE_SAMPLES = 256


def report(options: Namespace) -> int:
    """Run the verb with the parsed command line; the exit code. Raises ToolError before anything is rendered where
    a file is missing or the folder cannot be written.
    """
    job = job_of(options)
    check_folder(Path(job["folder"]))
    python = environments.development_python()
    job["python"] = str(environments.blender_python(options.blender))
    paths = os.pathsep.join(filter(None, (str(places.REPOSITORY), os.environ.get("PYTHONPATH"))))
    child = subprocess.Popen(
        [str(python), "-P", "-m", "tooling.report", json.dumps(job)],
        env={**os.environ, "PYTHONPATH": paths},
        start_new_session=True,  # so that a Ctrl-C on the terminal comes once, from here
    )
    return exit_code(child)


def job_of(options: Namespace) -> dict[str, Any]:
    """What `tooling.report.run.Options` is made of, but for the Python to run Blender in.

    Raises ToolError where a scene is missing.
    """
    for name, _ in options.scenes:
        check_scene(name)
    frames = options.frames or ([options.frame] if options.frame is not None else None)
    return {
        "scenes": list(dict.fromkeys(options.scenes)),
        "folder": str(Path(options.output).resolve()),
        "quick": options.quick,
        "resolution": options.resolution or (QUICK_RESOLUTION if options.quick else None),
        "frames": frames,
        "rounds": options.rounds or (QUICK_ROUNDS if options.quick else ROUNDS),
        "reference_samples": options.reference_samples
        or (QUICK_REFERENCE_SAMPLES if options.quick else REFERENCE_SAMPLES),
        "command": shlex.join(["python3", "build.py", *sys.argv[1:]]),
    }


def check_scene(name: str) -> None:
    """Raise ToolError where `name` is no .blend file."""
    if not Path(name).is_file():
        raise ToolError(f"{name}: no such file.")
    if Path(name).suffix != ".blend":
        raise ToolError(f"{name}: a report is made of .blend files.")


def check_folder(folder: Path) -> None:
    """Make `folder`. Raises ToolError where it cannot be made or written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ToolError(f"{folder} cannot be made: {error.strerror}.") from error
    if not is_writable(folder):
        raise ToolError(f"{folder} is not a folder that can be written.")


def exit_code(child: subprocess.Popen[bytes]) -> int:
    """Wait for the child and pass interruptions on to it, so that it can finish its page; its exit code.

    On Windows a Ctrl-C reaches the child without us.
    """
    while True:
        try:
            return child.wait()
        except KeyboardInterrupt:
            _pass_on(child, signal.SIGINT)
        except SystemExit:  # what `build.py` makes of SIGTERM
            _pass_on(child, signal.SIGTERM)


def _pass_on(child: subprocess.Popen[bytes], number: signal.Signals) -> None:
    """Send a signal to a child that has not ended yet."""
    if os.name != "nt":
        child.send_signal(number)
