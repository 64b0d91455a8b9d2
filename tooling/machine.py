# SPDX-License-Identifier: GPL-3.0-or-later
"""What measurements are made on, and with which state of the checkout, in words."""

from __future__ import annotations

import os
import platform
import subprocess
from pathlib import Path

from tooling import places

SOURCES = ("addon", "shaders", "tooling", "build.py")


def machine() -> str:
    """The processor's model, the cores this process may use, and the operating system."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    model = platform.processor()
    described = Path("/proc/cpuinfo")
    if described.is_file():
        lines = (line.partition(":") for line in described.read_text(encoding="utf-8").splitlines())
        model = next((value.strip() for key, _, value in lines if key.strip() == "model name"), model)
    return f"{model or platform.machine()}, {cores} cores, {platform.system()}"


def commit() -> str:
    """The checkout's commit, with "+ changes" where its sources differ from it; "unknown" without git."""
    try:
        name = _git("rev-parse", "--short=12", "HEAD")
        changed = _git("status", "--porcelain", "--", *SOURCES)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return f"{name} + changes" if changed else name


def _git(*arguments: str) -> str:
    """What a git command about the checkout answers. Raises CalledProcessError where the checkout is no repository."""
    command = ["git", "-C", str(places.REPOSITORY), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
