# SPDX-License-Identifier: GPL-3.0-or-later
"""`build.py check`: formatting, lint, types, import contracts, shader variants."""

from __future__ import annotations

import subprocess
from argparse import Namespace
from pathlib import Path

from tooling import environments, places, system_packages
from tooling.console import say

IMPORT_LINTER = "import sys; from importlinter.cli import lint_imports_command; sys.exit(lint_imports_command())"


def commands(python: Path) -> dict[str, list[str]]:
    """Every check by name: its command, run in the checkout with the development environment's `python`."""
    tool = [str(python), "-m"]
    return {
        "format": [*tool, "ruff", "format", "--check", "."],
        "lint": [*tool, "ruff", "check", "."],
        "types": [*tool, "pyright", "--pythonpath", str(python)],
        "imports": [str(python), "-c", IMPORT_LINTER],
        "shaders": [str(python), "-P", str(places.REPOSITORY / "tooling" / "shader_variants.py")],
    }


def check(_options: Namespace) -> int:
    """Run every check, also after one has failed; exit code 1 where any failed. Raises ToolError from set-up."""
    python = environments.development_python()
    system_packages.provide(system_packages.SHADER_COMPILER)
    failed: list[str] = []
    for name, command in commands(python).items():
        say(f"== {name}")
        if subprocess.run(command, cwd=places.REPOSITORY, check=False).returncode:
            failed.append(name)
    say(f"check failed: {', '.join(failed)}" if failed else "check passed")
    return 1 if failed else 0
