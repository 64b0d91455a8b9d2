# SPDX-License-Identifier: GPL-3.0-or-later
from addon.render.memory import Memory


class Thing:
    """Something with an identity."""


def test_the_same_is_not_made_twice_and_another_thing_is():
    memory, one, other = Memory(), Thing(), Thing()
    made = memory.recall("name", (one,), Thing)
    assert memory.recall("name", (one,), Thing) is made
    assert memory.recall("name", (other,), Thing) is not made
    assert memory.recall("another name", (one,), Thing) is not made
    assert memory.recall("name", (one, other), Thing) is not made


def test_what_is_asked_for_no_more_is_let_go():
    """Over 200 frames of an animation, each of new things beside one that stays, no more than a frame's is held."""
    memory, lasting, made = Memory(), Thing(), 0

    def make():
        nonlocal made
        made += 1
        return Thing()

    for _ in range(200):
        kept = memory.recall("lasting", (lasting,), Thing)
        memory.recall("passing", (Thing(),), make)
        memory.forget_unused()
        assert memory.count == 2
        assert memory.recall("lasting", (lasting,), Thing) is kept
    assert made == 200


def test_parts_of_what_is_remembered_stay_as_long():
    """Only the whole is asked for while nothing changes; when something does, its parts are still there."""
    memory, whole, part = Memory(), Thing(), Thing()
    made = memory.recall("part", (part,), Thing)
    memory.recall("whole", (whole,), Thing)
    memory.forget_unused()
    for _ in range(3):
        memory.recall("whole", (whole,), Thing)
        memory.forget_unused()
    assert memory.recall("part", (part,), Thing) is made
