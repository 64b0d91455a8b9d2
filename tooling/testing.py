# SPDX-License-Identifier: GPL-3.0-or-later
"""`build.py test` and `bench`: pytest and the benches inside the Blender environments."""

from __future__ import annotations

import os
import subprocess
import tempfile
from argparse import Namespace
from collections.abc import Iterable
from pathlib import Path

from tooling import blender_window, environments, places
from tooling.console import ToolError, say, warn

KINDS = ("unit", "gl", "blender", "gui", "stability")
BY_DEFAULT = KINDS
NO_TESTS = 5
BENCHES = places.TESTS / "bench"
# os._exit: Blender 4.5 may wait for ever at exit once it had a GL context of its own.
PYTEST = """
import os, sys, pytest
code = int(pytest.main(sys.argv[1:]))
sys.stdout.flush()
sys.stderr.flush()
os._exit(code)
"""


def test(options: Namespace) -> int:
    """Run the chosen tests in each Blender version; exit code 1 where any failed or none ran."""
    kinds = options.only or BY_DEFAULT
    codes: dict[str, int] = {}
    missing: list[str] = []
    inside = [kind for kind in kinds if kind != "gui" and has_tests(places.TESTS / kind)]
    if inside:
        for version in versions(options.blender, missing):
            python = environments.blender_python(version)
            codes[f"Blender {version}"] = run_pytest(python, f"Blender {version}", inside, options.arguments)
    if "gui" in kinds and has_tests(places.TESTS / "gui"):
        if blender_window.provide():
            codes["window"] = run_pytest(environments.blender_python(), "window", ["gui"], options.arguments)
        else:
            missing.append("The window tests did not run: " + blender_window.why_not())
    for line in missing:
        warn(f"NOT TESTED: {line}")
    failed = [name for name, code in codes.items() if code not in {0, NO_TESTS}]
    if failed:
        warn(f"test failed in: {', '.join(failed)}")
    return 1 if failed or all(code == NO_TESTS for code in codes.values()) else 0


def has_tests(folder: Path) -> bool:
    """Whether the folder has a test module."""
    return any(folder.glob("test_*.py"))


def versions(chosen: str | None, missing: list[str]) -> list[str]:
    """The Blender versions to test: the chosen one, else all whose Python is here; says in `missing` which is not.

    Raises ToolError where none is here.
    """
    if chosen:
        return [chosen]
    here = environments.available()
    absent = [blender for blender in environments.BLENDERS if blender not in here]
    if not here:
        raise ToolError(environments.missing_python(absent))
    missing += [environments.missing_python([blender]) for blender in absent]
    return [blender.version for blender in here]


def run_pytest(python: Path, label: str, kinds: Iterable[str], arguments: list[str]) -> int:
    """Pytest's exit code for these kinds of tests, on the software rasteriser and with a scratch Blender profile."""
    say(f"== tests: {label} ({', '.join(kinds)})")
    folders = [str(places.TESTS / kind) for kind in kinds]
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_test_") as scratch:
        surroundings = {**os.environ, "LIBGL_ALWAYS_SOFTWARE": "1", "BLENDER_USER_RESOURCES": scratch}
        command = [str(python), "-P", "-c", PYTEST, *folders, *arguments]
        return subprocess.run(command, cwd=places.REPOSITORY, env=surroundings, check=False).returncode


def bench(options: Namespace) -> int:
    """Run the named bench, or all of them, in the newest Blender; exit code 1 where one failed."""
    known = {path.stem: path for path in sorted(BENCHES.glob("[!_]*.py"))}
    if not known or options.name not in {None, *known}:
        raise ToolError(f"No such bench; there is {', '.join(known) or 'none yet'}.")
    python = environments.blender_python()
    failed: list[str] = []
    for name in [options.name] if options.name else known:
        say(f"== bench: {name}")
        surroundings = {**os.environ, "PYTHONPATH": str(places.REPOSITORY)}
        if subprocess.run([str(python), str(known[name])], env=surroundings, check=False).returncode:
            failed.append(name)
    if failed:
        warn(f"bench failed: {', '.join(failed)}")
    return 1 if failed else 0
