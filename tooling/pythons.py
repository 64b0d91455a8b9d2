# SPDX-License-Identifier: GPL-3.0-or-later
"""Python interpreters on this machine: on PATH, and in pyenv's and uv's own folders."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

PROBE_SECONDS = 30
PROBE = """
import sys
from importlib.util import find_spec
print(*sys.version_info[:3], int(all(map(find_spec, ("ensurepip", "venv")))))
"""


class Interpreter(NamedTuple):
    """A Python that was run and answered.

    `version`: (major, minor, micro). `has_venv`: whether it can make virtual environments with pip; Debian's cannot
    until its package python3.X-venv is installed.
    """

    path: Path
    version: tuple[int, int, int]
    has_venv: bool


def probe(path: Path) -> Interpreter | None:
    """Run the interpreter at `path`; None where it does not answer (a pyenv shim may refuse to run)."""
    try:
        answer = subprocess.run(
            [str(path), "-c", PROBE], capture_output=True, text=True, timeout=PROBE_SECONDS, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    words = answer.stdout.split()
    if len(words) != 4:
        return None
    major, minor, micro, able = (int(word) for word in words)
    return Interpreter(path, (major, minor, micro), bool(able))


def candidates(major: int, minor: int) -> Iterator[Path]:
    """Every file that may be Python `major.minor`, in the order they are preferred; not yet run."""
    named = "python.exe" if os.name == "nt" else f"python{major}.{minor}"
    path = [Path(folder) for folder in os.environ.get("PATH", "").split(os.pathsep) if folder and not _is_shims(folder)]
    if sys.version_info[:2] == (major, minor):
        yield Path(sys.executable)
    yield from (folder / named for folder in path)
    for folder, pattern in version_folders(major, minor):
        for version in sorted(folder.glob(pattern), reverse=True):
            yield version / "bin" / named
            yield version / "python.exe"
    yield from (folder / "python3" for folder in path)


def _is_shims(folder: str) -> bool:
    """Whether a folder on PATH holds pyenv's shims: slow to ask, and what they lead to is in pyenv's own folders."""
    return Path(folder).name == "shims" and ".pyenv" in Path(folder).parent.name


def version_folders(major: int, minor: int) -> Iterator[tuple[Path, str]]:
    """Folders in which pyenv and uv keep their interpreters, each with the pattern of this version's folders."""
    home = Path.home()
    roots = [os.environ.get("PYENV_ROOT"), str(home / ".pyenv")]
    yield from ((Path(root) / "versions", f"{major}.{minor}.*") for root in roots if root)
    data = os.environ.get("XDG_DATA_HOME") or str(home / ".local" / "share")
    uv = [os.environ.get("UV_PYTHON_INSTALL_DIR"), str(Path(data) / "uv" / "python")]
    if os.name == "nt":
        uv.append(str(Path(os.environ.get("APPDATA", str(home))) / "uv" / "python"))
    yield from ((Path(root), f"cpython-{major}.{minor}.*") for root in uv if root)


@cache
def find(major: int, minor: int) -> Interpreter | None:
    """A working Python `major.minor`, one that can make virtual environments if there is one, or None."""
    second_best = None
    seen: set[Path] = set()
    for path in candidates(major, minor):
        if path in seen or not path.is_file():
            continue
        seen.add(path)
        found = probe(path)
        if found is None or found.version[:2] != (major, minor):
            continue
        if found.has_venv:
            return found
        second_best = second_best or found
    return second_best
