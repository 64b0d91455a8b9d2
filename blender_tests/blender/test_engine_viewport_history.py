# SPDX-License-Identifier: GPL-3.0-or-later
"""What a viewport's renderer is told of the views before and after the one it draws."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from addon.engine.viewport_session import GUIDED_BY_HISTORY, ViewportSession
from addon.render import plan
from addon.scene import DebugView, RenderSettings, Variant
from blender_tests import builders
from blender_tests.blender.engine_fixtures import camera_at, idle, session_fixture  # noqa: F401 - fixtures

BACK = builders.quad("back", half=3.0)
FRONT = builders.quad("front", z=1.0, half=0.5)
SCENE = builders.scene(BACK, FRONT, lights=(builders.light(casts_shadow=False),))
SIZE = {"width": 24, "height": 16, "samples": 3}
SETTINGS = {
    variant: RenderSettings(**SIZE, variant=variant, debug_view=DebugView.DIRECT, debug_layer=1) for variant in Variant
}
"""Settings of pictures that show the second layer, so that all variants need two."""

DELAY = SETTINGS[Variant.DELAY]


class StubRenderer:
    """Records each `begin` as (x of the camera, of the previous one, of the following one), None where there is none.

    `interludes`: what to call while the picture of the n-th `begin` is drawn, by n.
    """

    begun: ClassVar = []
    interludes: ClassVar = {}

    def __init__(self, _device):
        self._samples = 0

    def begin(self, scene, view, settings, sequence):
        assert sequence.continuous
        assert sequence.earlier is None
        moments = (sequence.previous, sequence.following)
        assert all(moment is None or moment.scene is SCENE for moment in moments)
        places = (view.position[0], *(moment and moment.camera.position[0] for moment in moments))
        StubRenderer.begun.append(tuple(place if place is None else int(place) for place in places))
        self._samples = 0
        return plan(scene, settings, continuous=True)

    def render_sample(self):
        self._samples += 1
        interlude = StubRenderer.interludes.pop(len(StubRenderer.begun), None)
        if interlude is not None:
            interlude()
        return self._samples

    def read(self, _channel):
        return np.zeros((1, 1, 4), np.float32)

    def release(self):
        pass


@pytest.fixture(name="stub")
def stub_fixture(monkeypatch):
    """Sessions use the stub."""
    monkeypatch.setattr("addon.engine.viewport_session.Renderer", StubRenderer)
    StubRenderer.begun, StubRenderer.interludes = [], {}
    return StubRenderer


def show(session, *places, settings=DELAY):
    """Move the camera from place to place, letting the session draw each to its end."""
    for x in places:
        session.show(SCENE, camera_at(x), settings)
        idle(session)


def assert_finished(session, x):
    """The session shows the view from x with all its samples."""
    assert session.error is None
    assert session.picture.complete
    assert session.picture.view.camera.position[0] == x


@pytest.mark.parametrize("variant", [Variant.TWO_PASS, Variant.PREPASS])
def test_each_view_is_drawn_after_the_one_before(session, stub, variant):
    show(session, 1, 2, 3, settings=SETTINGS[variant])
    assert stub.begun == [(1, None, None), (2, 1, None), (3, 2, None)]
    assert_finished(session, 3)


@pytest.mark.parametrize("variant", sorted(GUIDED_BY_HISTORY))
def test_a_view_that_history_guided_is_drawn_again_once_it_rests(session, stub, variant):
    show(session, 1, 2, 3, settings=SETTINGS[variant])
    assert stub.begun == [(1, None, None), (2, 1, None), (2, 2, None), (3, 2, None), (3, 3, None)]
    assert_finished(session, 3)


@pytest.mark.parametrize("variant", sorted(GUIDED_BY_HISTORY))
def test_a_view_that_history_guided_is_shown_at_once(session, stub, variant):
    shown = []
    stub.interludes = {3: lambda: shown.append(session.picture)}
    show(session, 1, 2, settings=SETTINGS[variant])
    (picture,) = shown
    assert picture.view.camera.position[0] == 2
    assert picture.samples == 1


@pytest.mark.parametrize("variant", sorted(GUIDED_BY_HISTORY))
def test_in_a_fluent_motion_each_view_is_drawn_once(session, stub, variant):
    settings = SETTINGS[variant]
    stub.interludes = {x - 1: (lambda x=x: session.show(SCENE, camera_at(x), settings)) for x in (2, 3, 4)}
    show(session, 1, settings=settings)
    assert stub.begun == [(1, None, None), (2, 1, None), (3, 2, None), (4, 3, None), (4, 4, None)]


def test_one_sample_is_drawn_again_too(session, stub):
    one = replace(SETTINGS[Variant.PREVIOUS], samples=1)
    show(session, 1, 2, settings=one)
    assert stub.begun == [(1, None, None), (2, 1, None), (2, 2, None)]


def test_delay_draws_the_view_before_once_more_looking_ahead(session, stub):
    show(session, 1, 2, 3)
    assert stub.begun == [(1, None, None), (1, 1, 2), (2, 1, None), (2, 2, 3), (3, 2, None)]
    assert_finished(session, 3)


def test_delay_draws_each_view_of_a_fluent_motion_once(session, stub):
    """From the second on: each looks ahead to the one that became known while the last was drawn."""
    stub.interludes = {
        begun: (lambda x=x: session.show(SCENE, camera_at(x), DELAY)) for begun, x in ((1, 2), (2, 3), (3, 4), (4, 5))
    }
    show(session, 1)
    assert stub.begun == [(1, None, None), (1, 1, 2), (2, 1, 3), (3, 2, 4), (4, 3, 5), (5, 4, None)]
    assert_finished(session, 5)


def test_delay_leaves_out_views_that_are_gone_before_they_are_known(session, stub):
    def move():
        for x in (3, 4, 5):
            session.show(SCENE, camera_at(x), DELAY)

    stub.interludes = {2: move}
    show(session, 1, 2)
    assert stub.begun == [(1, None, None), (1, 1, 2), (2, 1, 5), (5, 2, None)]
    assert_finished(session, 5)


def test_every_picture_that_delay_draws_is_shown(session, stub):
    shown = []
    stub.interludes = {begun: (lambda: shown.append(int(session.picture.view.camera.position[0]))) for begun in (3, 5)}
    show(session, 1, 2, 3)
    assert shown == [1, 2]


@pytest.mark.parametrize("variant", list(Variant))
def test_where_one_layer_is_enough_each_view_is_drawn_once(session, stub, variant):
    show(session, 1, 2, settings=RenderSettings(**SIZE, variant=variant))
    assert stub.begun == [(1, None, None), (2, 1, None)]


@pytest.mark.parametrize(
    "changed",
    [
        {"width": 25},
        {"height": 17},
        {"layers": 3},
        {"variant": Variant.PREDICT},
        {"guard_band": 4},
    ],
)
@pytest.mark.parametrize("variant", [Variant.DELAY, Variant.PREVIOUS])
def test_other_settings_are_a_cut(session, stub, variant, changed):
    show(session, 1, settings=SETTINGS[variant])
    show(session, 2, settings=replace(SETTINGS[variant], **changed))
    assert stub.begun == [(1, None, None), (2, None, None)]
    assert_finished(session, 2)


@pytest.mark.parametrize("method", ["begin", "render_sample", "read"])
@pytest.mark.parametrize("variant", [Variant.DELAY, Variant.PREVIOUS])
def test_an_error_is_a_cut(session, stub, monkeypatch, variant, method):
    show(session, 1, settings=SETTINGS[variant])
    with monkeypatch.context() as patch:
        patch.setattr(StubRenderer, method, lambda *_: (_ for _ in ()).throw(ValueError("broken")))
        show(session, 2, settings=SETTINGS[variant])
        assert "broken" in session.error
    show(session, 3, settings=SETTINGS[variant])
    assert stub.begun[-1] == (3, None, None)
    assert_finished(session, 3)


@pytest.mark.parametrize("variant", list(Variant))
def test_a_view_at_rest_ends_in_the_same_picture_whatever_the_variant(session, variant):
    show(session, 0, 0.25, settings=SETTINGS[variant])
    finished = session.picture.pixels
    other = ViewportSession()
    show(other, 0.25, settings=SETTINGS[Variant.TWO_PASS])
    other.close()
    assert finished[..., :3].max() > 0.01
    np.testing.assert_array_equal(finished, other.picture.pixels)
