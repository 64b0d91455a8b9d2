# SPDX-License-Identifier: GPL-3.0-or-later
"""`build.py test`: the last line counts all runs, the exit code says whether any failed, gaps are named."""

import sys
from argparse import Namespace

import pytest

from tooling import blender_window, environments, places, testing
from tooling.console import ToolError
from tooling.testing import Outcome

PASSING = "def test_one():\n    pass\n"
MIXED = """
import pytest
def test_one(): pass
def test_two(): assert False
@pytest.mark.skip
def test_three(): pass
@pytest.mark.xfail
def test_four(): assert False
@pytest.fixture
def broken(): raise ValueError
def test_five(broken): pass
"""


@pytest.fixture
def tests_in(tmp_path, monkeypatch):
    """A function that makes this folder of tests the checkout's; they run in this Python instead of another Blender."""
    monkeypatch.setattr(places, "TESTS", tmp_path)
    monkeypatch.setattr(places, "REPOSITORY", tmp_path)
    monkeypatch.setattr(environments, "blender_python", lambda _version=None: sys.executable)
    monkeypatch.setattr(environments, "development_python", lambda: sys.executable)
    monkeypatch.setattr(blender_window, "provide", lambda: None)
    monkeypatch.setattr(blender_window, "why_not", lambda: "no window here.")

    def write(**kinds):
        for kind, text in kinds.items():
            (tmp_path / kind).mkdir()
            (tmp_path / kind / f"test_{kind}.py").write_text(text, encoding="utf-8")

    return write


def run():
    """The verb, in one Blender version; its exit code."""
    return testing.test(Namespace(only=None, kinds=("unit", "gui", "report"), blender="5.2", arguments=[]))


def last_line(capfd):
    """The last line on stdout, and everything on stderr."""
    captured = capfd.readouterr()
    return captured.out.splitlines()[-1], captured.err


def test_passing_tests_are_counted(tests_in, capfd):
    tests_in(unit=PASSING, report=PASSING)
    assert run() == 0
    assert last_line(capfd) == ("2 passed, 0 failed, 0 skipped", "")


def test_failures_and_errors_count_as_failed(tests_in, capfd):
    tests_in(unit=MIXED)
    assert run() == 1
    line, errors = last_line(capfd)
    assert line == "1 passed, 2 failed, 2 skipped"
    assert "test failed in: Blender 5.2" in errors


def test_a_run_that_dies_counts_as_failed(tests_in, capfd):
    tests_in(unit="import os\nos._exit(7)\n")
    assert run() == 1
    assert last_line(capfd)[0] == "0 passed, 1 failed, 0 skipped"


def test_no_test_at_all_is_a_failure(tests_in, capfd):
    tests_in(unit="")
    assert run() == 1
    assert last_line(capfd)[0] == "0 passed, 0 failed, 0 skipped"


def test_counts_of_all_runs_are_summed(tests_in, capfd, monkeypatch):
    monkeypatch.setattr(blender_window, "provide", lambda: places.TESTS)
    tests_in(unit=MIXED, gui=PASSING)
    assert run() == 1
    assert last_line(capfd)[0] == "2 passed, 2 failed, 2 skipped"


def test_a_window_that_cannot_be_made_is_named_and_fails_nothing(tests_in, capfd, monkeypatch):
    def fails():
        raise ToolError("debootstrap failed: the mirror is away")

    monkeypatch.setattr(blender_window, "provide", fails)
    tests_in(unit=PASSING, gui=PASSING)
    assert run() == 0
    line, errors = last_line(capfd)
    assert line == "1 passed, 0 failed, 0 skipped"
    assert "NOT TESTED: The window tests did not run" in errors
    assert "the mirror is away" in errors


def test_a_machine_without_a_window_is_named(tests_in, capfd):
    tests_in(unit=PASSING, gui=PASSING)
    assert run() == 0
    assert "NOT TESTED: The window tests did not run: no window here." in last_line(capfd)[1]


def test_failing_window_tests_fail(tests_in, capfd, monkeypatch):
    monkeypatch.setattr(blender_window, "provide", lambda: places.TESTS)
    tests_in(unit=PASSING, gui=MIXED)
    assert run() == 1
    assert "test failed in: window" in last_line(capfd)[1]


def test_an_environment_that_cannot_be_made_is_a_failure_with_its_reason(tests_in, capfd, monkeypatch):
    def fails(_version=None):
        raise ToolError("the package index is away")

    monkeypatch.setattr(environments, "blender_python", fails)
    tests_in(unit=PASSING)
    assert run() == 1
    line, errors = last_line(capfd)
    assert line == "0 passed, 1 failed, 0 skipped"
    assert "the package index is away" in errors


def test_versions_run_at_the_same_time_and_print_one_after_another(tests_in, capfd, monkeypatch):
    """Each waits for the other to have begun."""
    meeting = """
import os, pathlib, time
def test_meets():
    here = pathlib.Path(__file__).parent
    (here / str(os.getpid())).touch()
    end = time.monotonic() + 60.0
    while len(list(here.glob("[0-9]*"))) < 2 and time.monotonic() < end:
        os.sched_yield()
    print("seen", len(list(here.glob("[0-9]*"))))
    assert len(list(here.glob("[0-9]*"))) == 2
"""
    tests_in(unit=meeting)
    monkeypatch.setattr(testing, "versions", lambda _chosen, _missing: ["4.5", "5.2"])
    assert run() == 0
    output = capfd.readouterr().out
    first, second = output.index("== tests: Blender 4.5"), output.index("== tests: Blender 5.2")
    assert first < output.index("1 passed") < second < output.rindex("1 passed in")
    assert output.splitlines()[-1] == "2 passed, 0 failed, 0 skipped"


def test_unexpected_passes_count_as_passed():
    assert testing.outcome_of(0, {"passed": 2, "xpassed": 1, "skipped": 1, "": 9}) == Outcome(0, 3, 0, 1)
