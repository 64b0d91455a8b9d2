# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs in processes of their own: start one, act on what it tells, end it when we are interrupted."""

from __future__ import annotations

import os
import subprocess
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from addon.report.messages import INTERRUPTED, read
from tooling.console import TAIL_LINES, ToolError, stop

Take = Callable[[str, Any], None]
"""Acts on one message of a job: its kind and its content."""


def run(
    command: Sequence[str],
    scratch: Path,
    take: Take,
    has_all: Callable[[], bool],
    environment: Mapping[str, str] | None = None,
) -> None:
    """Run a job to its end; its temporary files and its Blender profile are inside the folder `scratch`.

    Raises ToolError with the job's own sentence where it sent an "error", and with the end of what Blender said where
    it failed without one or ended before `has_all()`; KeyboardInterrupt where the job was interrupted. Whatever is
    raised meanwhile, KeyboardInterrupt among it, ends the job first.
    """
    profile = scratch / "profile"
    profile.mkdir(exist_ok=True)
    own = {"BLENDER_USER_RESOURCES": str(profile), "TMPDIR": str(scratch), "TEMP": str(scratch)}
    child = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env={**os.environ, **own, **(environment or {})},
        start_new_session=True,
    )
    tail: deque[str] = deque(maxlen=TAIL_LINES)
    problem = None
    try:
        for line in child.stdout or ():
            message = read(line)
            if message is None:
                if line.strip():
                    tail.append(line)
            elif message[0] == "error":
                problem = message[1]
            else:
                take(*message)
        child.wait()
    finally:
        stop(child)
    if child.returncode == INTERRUPTED:
        raise KeyboardInterrupt
    if problem is not None:
        raise ToolError(problem)
    if child.returncode != 0 or not has_all():
        ending = f"signal {-child.returncode}" if child.returncode < 0 else f"exit code {child.returncode}"
        raise ToolError(f"Blender ended without a picture ({ending}); it last said:\n{''.join(tail)}".rstrip())
