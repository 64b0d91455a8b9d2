# SPDX-License-Identifier: GPL-3.0-or-later
"""`build.py test` and `bench`: pytest inside the Blender environments, what needs no Blender in the development one."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO

from tooling import blender_window, environments, places
from tooling.console import ToolError, say, warn

NO_TESTS = 5
BENCHES = places.TESTS / "bench"
# os._exit: Blender 4.5 may wait for ever at exit once it had a GL context of its own.
PYTEST = """
import json, os, pathlib, sys, pytest

class Counts:
    def pytest_terminal_summary(self, terminalreporter):
        counts = {outcome: len(reports) for outcome, reports in terminalreporter.stats.items()}
        pathlib.Path(sys.argv[1]).write_text(json.dumps(counts), encoding="utf-8")

code = int(pytest.main(sys.argv[2:], plugins=[Counts()]))
sys.stdout.flush()
sys.stderr.flush()
os._exit(code)
"""


@dataclass(frozen=True)
class Outcome:
    """What came out of one run of pytest: its exit code and how many tests passed, failed and were skipped."""

    code: int
    passed: int = 0
    failed: int = 0
    skipped: int = 0


def test(options: Namespace) -> int:
    """Run the chosen tests in each Blender version; exit code 1 where any failed, could not start, or none ran."""
    kinds = options.only or options.kinds
    outcomes: dict[str, Outcome] = {}
    missing: list[str] = []
    inside = [kind for kind in kinds if kind not in {"gui", "report"} and has_tests(places.TESTS / kind)]
    if inside:
        here = versions(options.blender, missing)
        providers = {f"Blender {version}": partial(environments.blender_python, version) for version in here}
        outcomes |= run_together(providers, inside, options.arguments)
    if "report" in kinds and has_tests(places.TESTS / "report"):
        outcomes["report"] = run_in(environments.development_python, "report", ["report"], options.arguments)
    if "gui" in kinds and has_tests(places.TESTS / "gui"):
        reason = no_window()
        if reason:
            missing.append(f"The window tests did not run: {reason}")
        else:
            outcomes["window"] = run_in(environments.blender_python, "window", ["gui"], options.arguments)
    for line in missing:
        warn(f"NOT TESTED: {line}")
    failed = [name for name, outcome in outcomes.items() if outcome.code not in {0, NO_TESTS}]
    if failed:
        warn(f"test failed in: {', '.join(failed)}")
    say(summary(list(outcomes.values())))
    return 1 if failed or all(outcome.code == NO_TESTS for outcome in outcomes.values()) else 0


def summary(outcomes: list[Outcome]) -> str:
    """One line with the counts of all runs."""
    passed, failed, skipped = (
        sum(getattr(outcome, name) for outcome in outcomes) for name in ("passed", "failed", "skipped")
    )
    return f"{passed} passed, {failed} failed, {skipped} skipped"


def no_window() -> str:
    """Why there is no window Blender to test in; empty when there is one, made now if need be."""
    try:
        return "" if blender_window.provide() else blender_window.why_not()
    except ToolError as error:
        return f"making it failed. {error}"


def run_in(provide: Callable[[], Path], label: str, kinds: Iterable[str], arguments: list[str]) -> Outcome:
    """Run the tests in the interpreter that `provide` sets up; one that cannot be set up counts as a failure."""
    return run_together({label: provide}, kinds, arguments)[label]


def run_together(
    providers: Mapping[str, Callable[[], Path]], kinds: Iterable[str], arguments: list[str]
) -> dict[str, Outcome]:
    """Run the tests in several interpreters, by label, at the same time: much of a suite uses one core only.

    What the first prints is seen at once, that of the others when those before them are over. Interpreters are set up
    one after another; one that cannot be counts as a failure.
    """
    outcomes: dict[str, Outcome] = {}
    runs: list[tuple[str, Future[Outcome], IO[bytes] | None]] = []
    with ThreadPoolExecutor(max_workers=len(providers) or 1) as pool, ExitStack() as files:
        pythons: dict[str, Path] = {}
        for label, provide in providers.items():
            try:
                pythons[label] = provide()
            except ToolError as error:
                warn(f"error: {error}")
                outcomes[label] = Outcome(1, failed=1)
        for label, python in pythons.items():
            held = files.enter_context(tempfile.TemporaryFile()) if runs else None
            runs.append((label, pool.submit(run_pytest, python, kinds, arguments, held), held))
        for label, run, held in runs:
            say(f"== tests: {label} ({', '.join(kinds)})")
            outcomes[label] = run.result()
            if held is not None:
                held.seek(0)
                sys.stdout.write(held.read().decode(errors="replace"))
                sys.stdout.flush()
    return outcomes


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


def run_pytest(python: Path, kinds: Iterable[str], arguments: list[str], output: IO[bytes] | None) -> Outcome:
    """Run these kinds of tests with pytest, on the software rasteriser and with a scratch Blender profile.

    `output`: a file that gets what it prints, in place of the terminal.
    """
    folders = [str(places.TESTS / kind) for kind in kinds]
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_test_") as scratch:
        counts = Path(scratch) / "counts.json"
        surroundings = {**os.environ, "LIBGL_ALWAYS_SOFTWARE": "1", "BLENDER_USER_RESOURCES": scratch}
        command = [str(python), "-P", "-c", PYTEST, str(counts), *folders, *arguments]
        errors = None if output is None else subprocess.STDOUT
        run = subprocess.run(
            command, cwd=places.REPOSITORY, env=surroundings, stdout=output, stderr=errors, check=False
        )
        code = run.returncode
        return outcome_of(code, json.loads(counts.read_text(encoding="utf-8")) if counts.is_file() else {})


def outcome_of(code: int, counts: dict[str, int]) -> Outcome:
    """The outcome for pytest's exit code and counts by its names; a run that failed without a failed test counts one.

    Errors count as failed, unexpected passes as passed, expected failures as skipped.
    """
    passed, failed, skipped = (
        counts.get(first, 0) + counts.get(second, 0)
        for first, second in (("passed", "xpassed"), ("failed", "error"), ("skipped", "xfailed"))
    )
    is_bad = code not in {0, NO_TESTS}
    return Outcome(code, passed, max(failed, 1) if is_bad else failed, skipped)


def bench(options: Namespace) -> int:
    """Run the named bench, or all of them, without Blender; exit code 1 where one failed."""
    known = {path.stem: path for path in sorted(BENCHES.glob("[!_]*.py"))}
    if not known or options.name not in {None, *known}:
        raise ToolError(f"No such bench; there is {', '.join(known) or 'none yet'}.")
    python = environments.development_python()
    failed: list[str] = []
    for name in [options.name] if options.name else known:
        say(f"== bench: {name}")
        surroundings = {**os.environ, "PYTHONPATH": str(places.REPOSITORY)}
        if subprocess.run([str(python), str(known[name])], env=surroundings, check=False).returncode:
            failed.append(name)
    if failed:
        warn(f"bench failed: {', '.join(failed)}")
    return 1 if failed else 0
