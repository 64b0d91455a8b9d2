# SPDX-License-Identifier: GPL-3.0-or-later
"""The process that makes a report: what it is told as JSON, its exit code, and whose layer files it takes."""

import json
from pathlib import Path

import pytest

import build
from tooling import reporting
from tooling.console import ToolError
from tooling.report import __main__ as process
from tooling.report.instruments import one_of_each
from tooling.report.interfaces import Options

ASKED = ["room.blend@8x8", "hall.blend", "--quick", "--frames", "3-5", "--rounds", "2", "--reference-samples", "16"]


@pytest.fixture(name="job")
def make_job(tmp_path, monkeypatch):
    """What the verb tells the process, for two files."""
    monkeypatch.chdir(tmp_path)
    for name in ("room.blend", "hall.blend"):
        (tmp_path / name).write_bytes(b"")
    monkeypatch.setattr("sys.argv", ["build.py", "report", *ASKED])
    job = reporting.job_of(build.command_line().parse_args(["report", *ASKED]))
    return json.loads(json.dumps({**job, "python": "a python"}))


def test_the_options_come_through_json(job, tmp_path):
    assert process.options_of(job) == Options(
        scenes=((Path("room.blend"), (8, 8)), (Path("hall.blend"), None)),
        folder=tmp_path / "report",
        quick=True,
        resolution=(320, 180),
        frames=(3, 4, 5),
        rounds=2,
        command=f"python3 build.py report {' '.join(ASKED)}",
    )


def test_what_is_not_asked_for_is_the_files_own(job):
    options = process.options_of({**job, "resolution": None, "frames": None})
    assert (options.resolution, options.frames) == (None, None)


@pytest.mark.parametrize(("problems", "code"), [([], 0), (["room is left out: it is broken."], 1)])
@pytest.mark.parametrize(("quick", "warm_seconds"), [(True, 1.0), (False, 4.0)])
def test_problems_are_listed_and_are_the_exit_code(job, monkeypatch, capfd, problems, code, quick, warm_seconds):
    made = []

    def make(options, points, instruments):
        made.append((instruments.python, instruments.warm_seconds, instruments.reference_samples))
        assert {point.engine for point in points} == {"DEEP_GBUFFER", "CYCLES", "EEVEE", "WORKBENCH"}
        return problems

    monkeypatch.setattr(process, "make", make)
    assert process.main({**job, "quick": quick}) == code
    assert made == [(Path("a python"), warm_seconds, 16)]
    said = capfd.readouterr()
    assert said.err.splitlines()[1:] == [f"  {problem}" for problem in problems]
    assert "wrote" not in said.out


@pytest.mark.parametrize("view_layers", [1, 2])
def test_one_layer_file_is_taken_of_each_frame(view_layers):
    files = [Path(f"{frame}_{layer}.exr") for frame in range(3) for layer in range(view_layers)]
    assert one_of_each(files, 3) == (Path("0_0.exr"), Path("1_0.exr"), Path("2_0.exr"))


@pytest.mark.parametrize("count", [0, 1, 4])
def test_a_frame_without_motion_is_told_of(count):
    with pytest.raises(ToolError, match=f"3 frames have {count} files with motion vectors"):
        one_of_each([Path("layers.exr")] * count, 3)
