# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparisons with Cycles that fail or are ended: a reason is given, and nothing is left."""

import signal
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import addon
from addon.output import write_channels
from addon.report import comparison
from addon.ui import compare as operators
from addon.ui import compared_images, comparing
from blender_tests.blender.comparison_fixtures import (  # noqa: F401 - fixtures
    SAMPLES,
    children_fixture,
    compare,
    comparison_images,
    folders,
    scene_fixture,
    started,
)
from blender_tests.blender.engine_fixtures import plane_scene_fixture, registered_fixture  # noqa: F401 - fixtures


@pytest.fixture(name="broken")
def broken_fixture(monkeypatch):
    """broken(program): the other Blender is a Python that runs this instead."""

    def broken(program):
        monkeypatch.setattr(comparing, "_command", lambda: [sys.executable, "-c", program])

    return broken


def test_without_a_camera_it_says_so(scene):
    scene.camera = None
    with pytest.raises(RuntimeError, match="has no camera"):
        compare()
    assert folders() == []


def test_without_cycles_it_says_so(scene, monkeypatch):
    bpy.ops.preferences.addon_disable(module="cycles")
    try:
        with pytest.raises(RuntimeError, match="There is no Cycles to compare with"):
            compare()
    finally:
        bpy.ops.preferences.addon_enable(module="cycles")
    assert folders() == []


def told(kind, content):
    """A program that says one thing as a job does, then ends well."""
    return f"from addon.report.messages import send; send({kind!r}, {content!r})"


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        ("raise SystemExit(3)", r"ended too early \(exit code 3\)"),
        ("print('out of cheese'); raise SystemExit(1)", "out of cheese"),
        ("raise SystemExit(130)", "was interrupted"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", r"exit code -9\)"),
        ("", r"exit code 0\).* It said nothing"),
        (told("error", "The file is broken."), "The file is broken"),
        (
            told("failed", {"name": "second half", "reason": "No room."}),
            "Cycles, second half could not render: No room",
        ),
    ],
)
def test_a_child_that_fails_gives_its_reason_and_leaves_nothing(scene, broken, children, monkeypatch, program, reason):
    monkeypatch.setenv("PYTHONPATH", str(Path(comparison.__file__).parents[2]))
    broken(program)
    with pytest.raises(RuntimeError, match=reason):
        compare()
    assert_nothing_is_left(children)


def assert_nothing_is_left(children):
    """Of the only comparison that there was."""
    assert [child.returncode is not None for child in children] == [True]
    assert folders() == []
    assert comparing.running() is None
    assert comparing.numbers() is None
    assert comparison_images() == []


def test_pictures_that_blender_cannot_load_are_reported(scene, children, monkeypatch):
    def half_written(path, _channels):
        if path.stem != "cycles":
            write_channels(path, {letter: np.zeros((4, 4), np.float32) for letter in "RGB"})

    monkeypatch.setattr(compared_images, "write_channels", half_written)
    with pytest.raises(RuntimeError, match=r"could not be compared: .*cycles\.exr"):
        compare()
    assert_nothing_is_left(children)


@pytest.mark.parametrize("error", [KeyError("red"), MemoryError(), TypeError("no number")])
def test_any_failure_ends_it(scene, children, monkeypatch, error):
    def failing(*_arguments):
        raise error

    monkeypatch.setattr(comparing, "compare", failing)
    with pytest.raises(RuntimeError, match=r"could not be compared: |not enough memory"):
        compare()
    assert_nothing_is_left(children)


def test_a_colour_configuration_of_another_kind_does_not_stop_it(scene, monkeypatch):
    monkeypatch.setattr(compared_images, "_working_space", lambda: "No such space")
    assert compare() == {"FINISHED"}
    assert len(comparison_images()) == 3


def following(comparison_now):
    """A stand-in for the operator that follows it, and for its context; `reports` and `removed` timers."""
    reports, removed = [], []
    manager = SimpleNamespace(windows=[], event_timer_remove=removed.append)
    operator = SimpleNamespace(
        _comparison=comparison_now,
        _timer="timer",
        report=lambda kind, text: reports.append((kind, text)),
    )
    operator._end = lambda context: operators.DEEP_GBUFFER_OT_follow_comparison._end(operator, context)
    return operator, SimpleNamespace(window_manager=manager), reports, removed


TIMER = SimpleNamespace(type="TIMER", value="NOTHING")


@pytest.mark.parametrize("where", ["compare", "show"])
def test_a_failure_in_a_window_ends_its_timer(scene, children, monkeypatch, where):
    def failing(*_arguments):
        raise RuntimeError("It broke")

    broken_part = (comparing, "compare") if where == "compare" else (operators.image_editors, "show")
    monkeypatch.setattr(*broken_part, failing)
    comparing.start(scene, SAMPLES, 100)
    operator, context, reports, removed = following(comparing.running())
    ends = operators.DEEP_GBUFFER_OT_follow_comparison.modal
    while ends(operator, context, TIMER) == {"PASS_THROUGH"}:
        assert removed == []
    assert removed == ["timer"]
    assert [(kind, "It broke" in text) for kind, text in reports] == [({"ERROR"}, True)]
    assert comparing.running() is None


def test_an_unforeseen_failure_ends_the_timer_too(scene, monkeypatch):
    operator, context, _reports, removed = following(None)
    monkeypatch.setattr(comparing, "step", lambda: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        operators.DEEP_GBUFFER_OT_follow_comparison.modal(operator, context, TIMER)
    assert removed == ["timer"]


@pytest.mark.parametrize("windows", [[], ["no window at all"]])
def test_without_a_window_that_follows_it_nothing_is_left(scene, children, windows):
    comparing.start(scene, SAMPLES, 100)
    context = SimpleNamespace(window=None, window_manager=SimpleNamespace(windows=windows), temp_override=no_override)
    with pytest.raises(comparison.ComparisonError, match="window"):
        operators._follow(context)
    assert_nothing_is_left(children)


def no_override(window):
    raise RuntimeError(f"{window} is no window")


def test_a_blender_that_cannot_be_started_is_named(scene, monkeypatch):
    monkeypatch.setattr(comparing, "_command", lambda: ["/no/such/blender"])
    with pytest.raises(RuntimeError, match=r"could not be started a second time.*/no/such/blender"):
        compare()
    assert folders() == []


def test_a_scene_that_cannot_be_saved_is_reported(scene, monkeypatch):
    monkeypatch.setattr(comparing.tempfile, "mkdtemp", lambda **_options: "/proc/none")
    with pytest.raises(RuntimeError, match="could not be saved for the comparison"):
        compare()


def test_pictures_that_cannot_be_written_are_reported(scene, children, monkeypatch):
    def full(*_arguments):
        raise OSError("No space left on device")

    monkeypatch.setattr(compared_images, "write_channels", full)
    with pytest.raises(RuntimeError, match="could not be compared: No space left on device"):
        compare()
    assert_nothing_is_left(children)


@pytest.mark.parametrize("way", ["cancel", "load", "unregister", "interrupt"])
def test_ending_it_leaves_no_process_and_no_folder(scene, children, monkeypatch, way):
    scene.deep_gbuffer.samples = 1_000_000
    handler = signal.getsignal(signal.SIGINT)
    if way == "interrupt":
        monkeypatch.setattr(comparing, "step", interrupted_step(comparing.step))
        with pytest.raises(RuntimeError, match="was cancelled"):
            compare()
    else:
        started(scene)
        assert not bpy.ops.deep_gbuffer.compare_with_cycles.poll()
        if way == "cancel":
            assert bpy.ops.deep_gbuffer.cancel_comparison() == {"FINISHED"}
        elif way == "load":
            bpy.ops.wm.read_factory_settings(use_empty=True)
        else:
            addon.unregister()
            addon.register()
    assert signal.getsignal(signal.SIGINT) == handler
    assert len(children) == 1
    assert children[0].returncode is not None
    assert folders() == []
    assert comparing.running() is None
    assert not bpy.ops.deep_gbuffer.cancel_comparison.poll()


def interrupted_step(step):
    """`comparing.step`, until the first sample is there: then Ctrl+C."""

    def stepping():
        if comparing.running().progress.fraction > 0.0:
            raise KeyboardInterrupt
        return step()

    return stepping
