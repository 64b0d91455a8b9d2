# SPDX-License-Identifier: GPL-3.0-or-later
"""What a job inside Blender tells the process that started it: lines of JSON on stdout, among Blender's own.

Imports nothing, and is understood by every Python that runs `build.py`.
"""

from __future__ import annotations

import json
import sys
from typing import Any

MARK = "\x1edeep-gbuffer "
"""Starts the lines that a job means for its parent."""

INTERRUPTED = 130
"""Exit code of a process that was interrupted."""


class JobError(RuntimeError):
    """A reason why a job has no picture; its text is the whole message."""


class EngineMissingError(JobError):
    """The reason is that this Blender has no such engine."""


def send(kind: str, content: object) -> None:
    """Tell the parent something."""
    sys.stdout.write(f"{MARK}{json.dumps({'kind': kind, 'content': content})}\n")
    sys.stdout.flush()


def read(line: str) -> tuple[str, Any] | None:
    """(kind, content) of a line that a job means for its parent; None for one of Blender's own."""
    _, found, message = line.partition(MARK)
    if not found:
        return None
    parsed = json.loads(message)
    return parsed["kind"], parsed["content"]
