# SPDX-License-Identifier: GPL-3.0-or-later
"""A report's order of work, its guess of the time left, and the line that shows it."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.report.sweep import Point
from tooling.console import ToolError
from tooling.report import plan
from tooling.report.plan import Durations, Look, Task
from tooling.report.progress import Lines, duration
from tooling.report.results import Subject

ROOM = Subject("room", Path("room.blend"), (1,), (640, 360), None)
HALL = Subject("hall", Path("hall.blend"), (1,), (640, 360), None)
FAST = Point("Samples", "1 spp", "DEEP_GBUFFER", {"samples": "1"})
SLOW = Point("Samples", "4 spp", "DEEP_GBUFFER", {"samples": "4"})
PEER = Point("Workbench", "", "WORKBENCH", {})


def test_a_round_of_everything_comes_before_the_next_round():
    assert plan.rounds([ROOM, HALL], [FAST, PEER], 2) == [
        [Task(ROOM, FAST, number), Task(ROOM, PEER, number), Task(HALL, FAST, number), Task(HALL, PEER, number)]
        for number in (1, 2)
    ]


def test_a_scene_is_its_own_frame_unless_others_are_asked_for():
    look = Look(7, (640, 360), "5.2.3")
    assert plan.subject("room", ROOM.blend, None, None, look) == Subject("room", ROOM.blend, (7,), (640, 360), None)
    assert plan.subject("room", ROOM.blend, None, [1, 2], look).frames == (1, 2)


@pytest.mark.parametrize(("crop", "fits"), [((640, 360), True), ((641, 360), False), ((640, 361), False)])
def test_what_is_judged_lies_within_the_picture(crop, fits):
    look = Look(1, (640, 360), "5.2.3")
    if fits:
        assert plan.subject("room", ROOM.blend, crop, None, look).crop == crop
    else:
        with pytest.raises(ToolError, match="cannot be judged in a picture of 640x360"):
            plan.subject("room", ROOM.blend, crop, None, look)


@given(
    st.lists(
        st.sampled_from(["a/room.blend", "b/room.blend", "hall.blend", "room_2.blend", "c/Room.blend"]), unique=True
    )
)
def test_every_scene_has_a_name_of_its_own(files):
    names = plan.names([Path(file) for file in files])
    assert len(set(names)) == len(files)


def test_time_left_is_told_from_what_is_most_alike():
    durations = Durations()
    assert durations.left([]) == (0.0, True)
    assert durations.left([Task(ROOM, FAST, 1)]) == (0.0, False)
    durations.add(Task(HALL, SLOW, 1), 100.0)
    assert durations.left([Task(ROOM, FAST, 1)]) == (100.0, True)  # its engine
    durations.add(Task(ROOM, SLOW, 1), 10.0)
    assert durations.left([Task(ROOM, FAST, 1)]) == (10.0, True)  # its engine in the scene
    durations.add(Task(ROOM, FAST, 1), 1.0)
    durations.add(Task(ROOM, FAST, 2), 3.0)
    assert durations.left([Task(ROOM, FAST, 3)]) == (2.0, True)  # itself
    assert durations.left([Task(ROOM, FAST, 3), Task(HALL, SLOW, 2)]) == (102.0, True)
    assert durations.left([Task(ROOM, FAST, 3), Task(ROOM, PEER, 1)]) == (2.0, False)


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.0, "1 s"), (59.0, "59 s"), (59.9, "1 min"), (60.0, "1 min"), (480.0, "8 min"), (9000.0, "2.5 h")],
)
def test_durations_in_words(seconds, words):
    assert duration(seconds) == words


def test_the_line_of_progress(monkeypatch):
    shown = []
    monkeypatch.setattr("tooling.console.Progress.show", lambda _self, text: shown.append(text))
    lines = Lines(64, 3)
    lines.start(Task(ROOM, PEER, 2), 11, (480.0, True))
    lines.working("Sample 3/16")
    lines.start(Task(ROOM, FAST, 2), 12, (480.0, False))
    lines.start(Task(ROOM, SLOW, 2), 13, (0.0, False))
    assert shown == [
        "12/64 room · Workbench · round 2 of 3 · about 8 min left",
        "12/64 room · Workbench · round 2 of 3 · about 8 min left · Sample 3/16",
        "13/64 room · Samples: 1 spp · round 2 of 3 · more than 8 min left",
        "14/64 room · Samples: 4 spp · round 2 of 3 · … left",
    ]
