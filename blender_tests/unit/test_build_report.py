# SPDX-License-Identifier: GPL-3.0-or-later
"""build.py report: what is checked before anything is rendered, and what the work is told."""

import json
import os
import signal

import pytest

import build
from tooling import machine, reporting
from tooling.console import ToolError


@pytest.fixture(name="blend")
def make_blend(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.blend").write_bytes(b"")
    return "room.blend"


def options(*arguments):
    return build.command_line().parse_args(["report", *arguments])


def test_a_full_report_is_of_the_files_own_pictures(blend):
    job = reporting.job_of(options(blend))
    assert job["scenes"] == [("room.blend", None)]
    assert (job["quick"], job["resolution"], job["frames"]) == (False, None, None)
    assert (job["rounds"], job["reference_samples"]) == (3, 1024)
    assert os.path.isabs(job["folder"])
    assert os.path.basename(job["folder"]) == "report"


def test_a_quick_report_is_of_small_pictures(blend):
    job = reporting.job_of(options(blend, "--quick"))
    assert (job["resolution"], job["rounds"], job["reference_samples"]) == ((320, 180), 1, 256)


def test_what_is_asked_for_counts_in_a_quick_report_too(blend):
    asked = ["--resolution", "64x36", "--rounds", "2", "--reference-samples", "4", "--frames", "3-5", "-o", "out"]
    job = reporting.job_of(options(blend, "--quick", *asked))
    assert (job["resolution"], job["rounds"], job["reference_samples"]) == ((64, 36), 2, 4)
    assert job["frames"] == [3, 4, 5]
    assert reporting.job_of(options(blend, "--frame", "0"))["frames"] == [0]


def test_a_scene_given_twice_is_measured_once_and_with_another_rectangle_again(blend):
    job = reporting.job_of(options(blend, blend, f"{blend}@8x8", f"{blend}@8x8"))
    assert job["scenes"] == [("room.blend", None), ("room.blend", (8, 8))]


def test_the_command_that_repeats_a_report_keeps_odd_names_together(blend, monkeypatch):
    monkeypatch.setattr("sys.argv", ["/somewhere/build.py", "report", "my room.blend", "--quick"])
    assert reporting.job_of(options(blend))["command"] == "python3 build.py report 'my room.blend' --quick"


@pytest.mark.parametrize(("name", "words"), [("nothing.blend", "no such file"), ("picture.png", "of .blend files")])
def test_what_cannot_be_reported_on_is_an_error(blend, tmp_path, name, words):
    (tmp_path / "picture.png").write_bytes(b"")
    with pytest.raises(ToolError, match=f"{name}: .*{words}"):
        reporting.job_of(options(blend, name))


def test_the_folder_is_made(tmp_path):
    reporting.check_folder(tmp_path / "some" / "where")
    assert (tmp_path / "some" / "where").is_dir()


def test_a_folder_that_cannot_be_written_is_an_error_before_anything_is_rendered(blend, tmp_path, monkeypatch):
    monkeypatch.setattr(reporting.environments, "development_python", lambda: pytest.fail("work was started"))
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o555)
    with pytest.raises(ToolError, match="locked is not a folder that can be written"):
        reporting.report(options(blend, "-o", str(locked)))
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(ToolError, match="file cannot be made"):
        reporting.report(options(blend, "-o", str(tmp_path / "file")))


class Child:
    """Stands for the process that does the work; each wait raises the next of `interruptions`."""

    def __init__(self, *interruptions):
        self.interruptions = list(interruptions)
        self.signals = []

    def wait(self):
        if self.interruptions:
            raise self.interruptions.pop(0)
        return 130

    def send_signal(self, number):
        self.signals.append(number)


@pytest.mark.skipif(os.name == "nt", reason="there a Ctrl-C reaches every process of the console")
def test_interruptions_are_passed_on_and_the_end_is_waited_for():
    child = Child(KeyboardInterrupt(), SystemExit(143), KeyboardInterrupt())
    assert reporting.exit_code(child) == 130
    assert child.signals == [signal.SIGINT, signal.SIGTERM, signal.SIGINT]


def test_the_job_is_json(blend):
    assert json.loads(json.dumps(reporting.job_of(options(f"{blend}@8x8"))))["scenes"] == [["room.blend", [8, 8]]]


def test_a_checkout_with_changes_says_so(monkeypatch):
    answers = {"rev-parse": "0123456789ab", "status": ""}
    monkeypatch.setattr(machine, "_git", lambda *arguments: answers[arguments[0]])
    assert machine.commit() == "0123456789ab"
    answers["status"] = " M build.py"
    assert machine.commit() == "0123456789ab + changes"


def test_where_there_is_no_git_the_commit_is_unknown(monkeypatch, tmp_path):
    monkeypatch.setattr(machine.places, "REPOSITORY", tmp_path)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    assert machine.commit() == "unknown"
    monkeypatch.setenv("PATH", "")
    assert machine.commit() == "unknown"
