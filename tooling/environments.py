# SPDX-License-Identifier: GPL-3.0-or-later
"""Virtual environments with pinned, hashed packages, made on first use and kept in the cache."""

from __future__ import annotations

import os
import platform
import re
from pathlib import Path
from typing import NamedTuple

from tooling import places, pythons, system_packages
from tooling.console import ToolError, run_long


class Blender(NamedTuple):
    """A Blender release that exists as a Python module; `version` also names its lock file."""

    version: str
    python: tuple[int, int]

    @property
    def python_text(self) -> str:
        """Its Python version, as people write it."""
        return f"{self.python[0]}.{self.python[1]}"


BLENDERS = (Blender("5.2", (3, 13)), Blender("4.5", (3, 11)))  # newest first
MODERN_PYTHONS = ((3, 11), (3, 13), (3, 12), (3, 14))


def executable(environment: Path) -> Path:
    """The interpreter of a virtual environment."""
    return environment / "Scripts" / "python.exe" if os.name == "nt" else environment / "bin" / "python"


def available() -> list[Blender]:
    """The Blender releases whose Python is on this machine, newest first."""
    return [blender for blender in BLENDERS if pythons.find(*blender.python)]


def missing_python(blenders: list[Blender]) -> str:
    """One line: which Python is missing for these releases, and how to get it."""
    versions = " or ".join(blender.python_text for blender in blenders)
    releases = " or ".join(blender.version for blender in blenders)
    return (
        f"Blender {releases} needs Python {versions}, which was not found here: "
        f"`uv python install {blenders[0].python_text}` provides one (uv: `pip install uv`)."
    )


def blender_python(version: str | None = None) -> Path:
    """The interpreter in which `import bpy` gives Blender `version` (None: the newest that can be had), set up.

    Raises ToolError where its Python or a system library is missing and cannot be installed.
    """
    wanted = [blender for blender in BLENDERS if version in {None, blender.version}]
    for blender in wanted:
        name = f"blender-{blender.version}"
        if _is_whole(_place(name, blender.python)) or pythons.find(*blender.python):
            system_packages.provide(system_packages.BLENDER_LIBRARIES)
            return _provide(name, blender.python)
    raise ToolError(missing_python(wanted))


def development_python() -> Path:
    """The interpreter with linters, type stubs and matplotlib, set up. Raises ToolError without a Python."""
    return _any_python("development")


def runtime_python() -> Path:
    """An interpreter with what the extension bundles, and pip to download it. Raises ToolError without a Python."""
    return _any_python("runtime")


def _any_python(name: str) -> Path:
    """Interpreter of the environment `name`, which works with every Python in MODERN_PYTHONS."""
    for version in MODERN_PYTHONS:
        if _is_whole(_place(name, version)) or pythons.find(*version):
            return _provide(name, version)
    raise ToolError(
        f"The {name} environment needs Python 3.11 or newer, which was not found here: "
        "`uv python install 3.13` provides one (uv: `pip install uv`)."
    )


def _lock_file(name: str) -> Path:
    return places.REQUIREMENTS / f"{name}.txt"


def _place(name: str, python: tuple[int, int]) -> Path:
    """The environment's folder, which is there once it has been made: for one lock file and one Python."""
    identity = places.key(_lock_file(name).read_bytes(), f"{python[0]}.{python[1]}", platform.machine())
    return places.cache_directory() / "environments" / f"{name}-{identity}"


def _is_whole(environment: Path) -> bool:
    """Whether the environment was made and the Python that it leans on is still where it was; asks no Python."""
    try:
        text = (environment / "pyvenv.cfg").read_text(encoding="utf-8")
    except OSError:
        return False
    home = re.search(r"(?m)^home = (.+)$", text)
    return home is not None and Path(home[1].strip()).is_dir() and executable(environment).exists()


def _provide(name: str, python: tuple[int, int]) -> Path:
    """Interpreter of the environment for the lock file `name`.txt. Environments are never changed, only made anew."""

    def make(folder: Path) -> None:
        interpreter = pythons.find(*python)
        if interpreter is None:
            raise ToolError(f"Python {python[0]}.{python[1]} went away while {name} was set up.")
        _create(folder, interpreter)
        command = [executable(folder), "-m", "pip", "install", "--disable-pip-version-check", "--no-input"]
        command += ["--no-deps", "--only-binary", ":all:", "--require-hashes", "-r", _lock_file(name)]
        run_long(command, f"Setting up the {name} environment (once)")

    return executable(places.cached(f"environments/{_place(name, python).name}", _is_whole, make))


def _create(folder: Path, interpreter: pythons.Interpreter) -> None:
    """Make an empty virtual environment with pip; on Debian install the package that can, first."""
    if not interpreter.has_venv:
        package = f"python{interpreter.version[0]}.{interpreter.version[1]}-venv"
        if not system_packages.can_install():
            raise ToolError(
                f"{interpreter.path} cannot make virtual environments: install with `sudo apt-get install {package}`."
            )
        system_packages.install([package])
    run_long([interpreter.path, "-m", "venv", folder], "Making a virtual environment")
