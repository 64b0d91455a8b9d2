# SPDX-License-Identifier: GPL-3.0-or-later
"""build.py: the command line, and that it runs where only an old plain Python is."""

import argparse
import ast
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

import build

INSIDE_BLENDER_OR_ENVIRONMENT = {"render_job.py", "shader_variants.py"}


@given(st.integers(-10_000, 10_000), st.integers(0, 500))
def test_frame_ranges_include_both_ends(first, length):
    frames = build.frame_range(f"{first}-{first + length}")
    assert frames == list(range(first, first + length + 1))


@pytest.mark.parametrize("text", ["", "5", "9-3", "a-b", "1-2-3", "1.5-2"])
def test_other_frame_ranges_are_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="range of frames"):
        build.frame_range(text)


@given(st.integers(1, 100_000), st.integers(1, 100_000))
def test_resolution(width, height):
    assert build.resolution(f"{width}x{height}") == (width, height)


@pytest.mark.parametrize("text", ["640", "640x", "0x5", "-3x5", "640X360", "1x1x1"])
def test_other_resolutions_are_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="resolution"):
        build.resolution(text)


def test_assignments_keep_equals_signs_in_the_value():
    assert build.assignment("path=a=b") == ("path", "a=b")
    with pytest.raises(argparse.ArgumentTypeError, match="name=value"):
        build.assignment("layers")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("room.blend", ("room.blend", None)),
        ("a b/room.blend@360x240", ("a b/room.blend", (360, 240))),
        ("me@home/room.blend", ("me@home/room.blend", None)),
        ("old.blend@home/room.blend", ("old.blend@home/room.blend", None)),
        ("old.blend@home/room.blend@8x9", ("old.blend@home/room.blend", (8, 9))),
    ],
)
def test_a_scene_may_say_which_rectangle_is_judged(text, expected):
    assert build.scene_file(text) == expected


@pytest.mark.parametrize("text", ["room.blend@", "room.blend@360", "room.blend@0x8", "room.blend@8x8@8x8"])
def test_other_rectangles_are_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="resolution"):
        build.scene_file(text)


@pytest.mark.parametrize("text", ["nan", "inf", "-1", "soon"])
def test_time_limits_are_finite_and_not_negative(text):
    with pytest.raises(argparse.ArgumentTypeError, match="seconds"):
        build.seconds(text)


@pytest.mark.parametrize("verb", ["render", "report", "test", "check", "package", "bench"])
def test_every_verb_explains_itself(repository, verb):
    answer = subprocess.run(
        [sys.executable, str(repository / "build.py"), verb, "--help"], capture_output=True, text=True, check=True
    )
    assert f"build.py {verb}" in answer.stdout


def test_a_missing_file_is_an_error_with_a_message(repository, tmp_path):
    answer = subprocess.run(
        [sys.executable, str(repository / "build.py"), "render", str(tmp_path / "nothing.blend")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode == 1
    assert "nothing.blend: no such file" in answer.stderr
    assert "Traceback" not in answer.stderr


def test_what_build_py_imports_parses_on_python_3_9(repository):
    files = [repository / "build.py", *(repository / "tooling").glob("*.py")]
    files += [repository / "addon" / name for name in ("__init__.py", "report/__init__.py", "report/messages.py")]
    for path in files:
        if path.name not in INSIDE_BLENDER_OR_ENVIRONMENT:
            assert ast.parse(path.read_text(encoding="utf-8"), str(path), feature_version=(3, 9)).body


def test_statistics_go_into_a_file_that_can_be_written(tmp_path):
    from tooling.console import ToolError
    from tooling.rendering import check_statistics

    check_statistics(tmp_path / "s.json")
    for path in (tmp_path, tmp_path / "nowhere" / "s.json"):
        with pytest.raises(ToolError, match="statistics cannot be written there"):
            check_statistics(path)
