# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs in processes of their own: what they tell arrives, and no way to end leaves one running."""

import os
import sys
import textwrap

import pytest

from addon.report.messages import INTERRUPTED, MARK
from tooling import jobs
from tooling.console import ToolError


class Job:
    """A Python program as a job; what it tells is kept in `told`."""

    def __init__(self, scratch):
        self.told = []
        self._scratch = scratch

    def run(self, program, *, take=None, has_all=lambda: True, environment=None):
        """Run the program, which has `send` and the modules `os` and `sys`, to its end."""
        head = "import os, sys\nfrom addon.report.messages import send\n"
        root = jobs.__file__.rpartition("tooling")[0]
        command = [sys.executable, "-c", f"import sys; sys.path.append({root!r})\n{head}{textwrap.dedent(program)}"]
        jobs.run(command, self._scratch, take or (lambda *message: self.told.append(message)), has_all, environment)


@pytest.fixture(name="job")
def job_fixture(tmp_path):
    return Job(tmp_path)


def test_messages_arrive_among_what_blender_says(job):
    job.run("""
        print("Blender says something")
        send("progress", "halfway")
        sys.stdout.write("unfinished line ")
        send("picture", {"frame": 1, "path": "π.exr"})
    """)
    assert job.told == [("progress", "halfway"), ("picture", {"frame": 1, "path": "π.exr"})]


def test_it_has_a_profile_and_temporary_files_of_its_own(job, tmp_path):
    names = ("BLENDER_USER_RESOURCES", "TMPDIR", "TEMP", "MORE")
    job.run(f"send('environment', [os.environ[name] for name in {names}])", environment={"MORE": "5"})
    ((_, found),) = job.told
    assert found == [str(tmp_path / "profile"), str(tmp_path), str(tmp_path), "5"]
    assert (tmp_path / "profile").is_dir()


def test_its_own_sentence_is_the_error(job):
    with pytest.raises(ToolError, match=r"^room\.blend is broken\.$"):
        job.run("print('noise'); send('error', 'room.blend is broken.'); sys.exit(1)")


def test_without_a_sentence_the_error_is_what_blender_said_last(job):
    with pytest.raises(ToolError, match=r"(?s)without a picture \(exit code 3\); it last said:\n.*line 39$") as caught:
        job.run("[print(f'line {number}') for number in range(40)]; sys.exit(3)")
    assert "line 0\n" not in str(caught.value)
    assert MARK not in str(caught.value)


def test_an_end_before_everything_was_told_is_an_error(job):
    with pytest.raises(ToolError, match=r"without a picture \(exit code 0\)"):
        job.run("send('progress', 'hardly begun')", has_all=lambda: False)


def test_an_interrupted_job_interrupts(job):
    with pytest.raises(KeyboardInterrupt):
        job.run(f"sys.exit({INTERRUPTED})")


@pytest.mark.skipif(os.name == "nt", reason="asks for processes as Unix does")
@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_whatever_is_raised_meanwhile_ends_the_job(job, error):
    def take(_kind, number):
        numbers.append(number)
        raise error

    numbers = []
    with pytest.raises(error):
        job.run("send('number', os.getpid()); import threading; threading.Event().wait()", take=take)
    with pytest.raises(ProcessLookupError):
        os.kill(numbers[0], 0)
