# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene rendered by our engine and by Cycles, in a Blender of its own: the process, its messages, what it made.

Imports nothing of Blender: who starts it says how Blender is started.
"""

import contextlib
import json
import os
import queue
import re
import shutil
import signal
import subprocess
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .messages import INTERRUPTED, read
from .reference import REFERENCE_SETTINGS
from .sweep import NO_FILES

JOB = Path(__file__).with_name("job.py")
OURS, FIRST, SECOND = "ours", "first half", "second half"
SHARES = {OURS: 0.2, FIRST: 0.4, SECOND: 0.4}
"""The renders in their order, and how much of the progress each is."""

TITLES = {OURS: "Deep G-Buffer", FIRST: "Cycles, first half", SECOND: "Cycles, second half"}
GRACE_SECONDS = 2.0
TAIL_LINES = 5
_COUNTED = re.compile(r"Sample (\d+)/(\d+)")


class ComparisonError(RuntimeError):
    """Why there is no comparison; its text is the whole message."""


@dataclass(frozen=True)
class Request:
    """What to compare: the scene named `scene` of `file` as it is set, at `resolution` (width, height).

    `samples`: of Cycles, in each of two halves. `package`: our add-on's name as a module. `blender`: command line that
    starts a Blender, up to the script that it runs. `folder`: for everything that is written; removed by `cancel`.
    """

    blender: Sequence[str]
    file: Path
    scene: str
    resolution: tuple[int, int]
    samples: int
    package: str
    folder: Path


@dataclass(frozen=True)
class Render:
    """A picture that was made: a multi-layer EXR, and the seconds it took."""

    picture: Path
    seconds: float


@dataclass(frozen=True)
class Progress:
    """How far a comparison is: 0…1, and what it does, in words."""

    fraction: float = 0.0
    text: str = "Starting Blender"


@dataclass
class _Made:
    """What the messages about one render said."""

    picture: Path | None = None
    seconds: float | None = None


class Comparison:
    """A Blender that renders for a comparison. `poll` often; `cancel` in the end, whatever became of it.

    `progress`: what `poll` saw last.
    """

    def __init__(self, request: Request) -> None:
        """Start it. Raises ComparisonError where the system cannot."""
        self.request = request
        self.progress = Progress()
        self._lines: queue.Queue[str] = queue.Queue()
        self._tail: deque[str] = deque(maxlen=TAIL_LINES)
        self._made = {name: _Made() for name in SHARES}
        self._reason = ""
        surroundings = {name: str(request.folder) for name in ("TMPDIR", "TEMP", "TMP")}
        surroundings["PYTHONPATH"] = python_path(request.package)
        try:
            self._child = subprocess.Popen(
                [*request.blender, str(JOB), "--", json.dumps(job(request))],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                encoding="utf-8",
                errors="replace",
                env={**os.environ, **surroundings},
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        except OSError as error:
            raise ComparisonError(f"Blender could not be started a second time: {error}") from error
        self._reader = threading.Thread(target=self._follow, name="Comparison", daemon=True)
        self._reader.start()

    def poll(self) -> bool:
        """Take in what was said since the last call, without waiting; whether it is still running.

        Raises ComparisonError where a render failed: the others are not waited for.
        """
        ended = not self._reader.is_alive()
        while True:
            try:
                self._take(self._lines.get_nowait())
            except queue.Empty:
                break
        if self._reason:
            raise ComparisonError(self._reason)
        return not ended

    def result(self) -> dict[str, Render]:
        """The renders by OURS, FIRST and SECOND, once `poll` is False. Raises ComparisonError where one is missing."""
        code = self._child.wait()
        if code == INTERRUPTED:
            raise ComparisonError("The Blender that renders was interrupted.")
        renders = {
            name: Render(made.picture, made.seconds)
            for name, made in self._made.items()
            if made.picture is not None and made.seconds is not None
        }
        if code != 0 or renders.keys() != SHARES.keys():
            said = f"It last said: {' '.join(self._tail)}" if self._tail else "It said nothing."
            raise ComparisonError(
                f"The second Blender, which renders in the background, ended too early (exit code {code}); the scene "
                f"is as it was. {said}"
            )
        return renders

    def cancel(self) -> None:
        """End the process where it still runs, wait for its end, and remove the folder."""
        if self._child.poll() is None:
            if os.name == "nt":
                self._child.terminate()
            else:
                self._child.send_signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._child.wait(GRACE_SECONDS)
            self._child.kill()
        self._child.wait()
        self._reader.join()
        shutil.rmtree(self.request.folder, ignore_errors=True)

    def _follow(self) -> None:
        """Queue every line until the process closes its output; runs on a thread."""
        assert self._child.stdout is not None
        with self._child.stdout as lines:
            for line in lines:
                self._lines.put(line)

    def _take(self, line: str) -> None:
        """Note what a line says."""
        message = read(line)
        if message is None:
            if line.strip():
                self._tail.append(line.strip())
            return
        kind, content = message
        if kind == "progress":
            self._advance(content["name"], content["text"])
        elif kind == "picture":
            self._made[content["name"]].picture = Path(content["path"])
        elif kind == "done":
            self._made[content["name"]].seconds = content["cold_s"]
        elif kind == "failed":
            self._reason = f"{TITLES[content['name']]} could not render: {content['reason']}"
        elif kind == "error":
            self._reason = str(content)

    def _advance(self, name: str, text: str) -> None:
        """Note how far the render `name` is by its engine's own status `text`; never backwards."""
        order = list(SHARES)
        before = sum(SHARES[other] for other in order[: order.index(name)])
        counted = _COUNTED.search(text)
        part = int(counted[1]) / max(1, int(counted[2])) if counted else 0.0
        fraction = max(self.progress.fraction, before + SHARES[name] * min(1.0, part))
        self.progress = Progress(fraction, f"{TITLES[name]}: {counted[0] if counted else 'Preparing'}")


def python_path(package: str) -> str:
    """$PYTHONPATH with which a Python that has Blender as a module finds our add-on, named `package`, as we did."""
    place = Path(__file__).resolve().parents[package.count(".") + 2]
    return os.pathsep.join(filter(None, (str(place), os.environ.get("PYTHONPATH"))))


def job(request: Request) -> dict[str, Any]:
    """What `job.py` is told: one render of ours as the scene is set, and two of Cycles, with seeds of their own."""
    halves = [
        {
            "name": name,
            "engine": "CYCLES",
            "settings": {**REFERENCE_SETTINGS, "samples": str(request.samples), "seed": str(seed)},
            "warm_seconds": 0.0,
        }
        for seed, name in enumerate((FIRST, SECOND))
    ]
    return {
        "file": str(request.file),
        "scene": request.scene,
        "frames": None,
        "resolution": list(request.resolution),
        "folder": str(request.folder),
        "package": request.package,
        "renders": [{"name": OURS, "engine": "DEEP_GBUFFER", "settings": NO_FILES, "warm_seconds": 0.0}, *halves],
    }
