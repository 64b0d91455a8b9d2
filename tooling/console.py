# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person sees while a verb runs, and long child processes that can be interrupted."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

TAIL_LINES = 25
HEARTBEAT_SECONDS = 10.0
GRACE_SECONDS = 5.0


class ToolError(RuntimeError):
    """Something a person has to put right; its text is the whole message."""


def say(text: str) -> None:
    """Print one line at once."""
    print(text, flush=True)


def warn(text: str) -> None:
    """Print one line on stderr at once."""
    print(text, file=sys.stderr, flush=True)


class Progress:
    """One line of progress: rewritten in place on a terminal, otherwise a new line every ten seconds."""

    def __init__(self, label: str) -> None:
        """`label` starts every line."""
        self._label = label
        self._started = self._shown = time.monotonic()
        self._terminal = sys.stderr.isatty()
        self._open = False

    def show(self, text: str) -> None:
        """Show `text` now on a terminal, else only when the last line is ten seconds old."""
        now = time.monotonic()
        if self._terminal:
            sys.stderr.write(f"\r\x1b[K{self._label}: {text}"[:160])
            sys.stderr.flush()
            self._open = True
        elif now - self._shown >= HEARTBEAT_SECONDS:
            warn(f"{self._label}: {text} ({now - self._started:.0f} s)")
            self._shown = now

    def clear(self) -> None:
        """Take the line away so that other output starts on an empty one."""
        if self._open:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
            self._open = False


def stop(child: subprocess.Popen[str]) -> None:
    """End a child that runs in its own session: SIGINT, then after a grace period SIGTERM and SIGKILL to its group."""
    signals = [signal.SIGTERM] if os.name == "nt" else [signal.SIGINT, signal.SIGTERM, signal.SIGKILL]
    for number in signals:
        if child.poll() is not None:
            return
        if os.name == "nt":
            child.terminate()
        elif number == signal.SIGINT:
            child.send_signal(number)
        else:
            os.killpg(child.pid, number)
        try:
            child.wait(GRACE_SECONDS)
        except subprocess.TimeoutExpired:
            continue


def run_long(
    argv: Sequence[str | Path], label: str, environment: Mapping[str, str] | None = None, folder: Path | None = None
) -> None:
    """Run a command whose output matters only when it fails, with a heartbeat.

    Raises ToolError with the end of the output when the command fails.
    """
    say(f"{label} …")
    started = time.monotonic()
    progress = Progress(label)
    with tempfile.TemporaryFile("w+", errors="replace") as log:
        child = subprocess.Popen(
            [str(part) for part in argv],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            text=True,
            env=None if environment is None else {**os.environ, **environment},
            cwd=folder,
            start_new_session=True,
        )
        try:
            while child.poll() is None:
                try:
                    child.wait(1.0)
                except subprocess.TimeoutExpired:
                    progress.show(f"{time.monotonic() - started:.0f} s")
        finally:
            stop(child)
            progress.clear()
        if child.returncode != 0:
            log.seek(0)
            tail = "".join(log.readlines()[-TAIL_LINES:])
            raise ToolError(f"{label} failed: `{' '.join(str(part) for part in argv)}` gave:\n{tail}")
    say(f"{label}: done in {time.monotonic() - started:.0f} s")
