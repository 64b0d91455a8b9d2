# SPDX-License-Identifier: GPL-3.0-or-later
"""What ends a final render, and that the user is told."""

import bpy
import numpy as np
import pytest
from engine_fixtures import intercept_fixture, plane_scene_fixture, registered_fixture  # noqa: F401 - fixtures

from addon.engine import statistics
from addon.engine.limits import Limits
from addon.engine.settings import FinalSettings
from addon.scene import RenderSettings

ENDLESS = FinalSettings(RenderSettings(4, 4, samples=1000), noise_threshold=0.01)


def picture(value):
    """A picture of one grey that is opaque."""
    return np.full((4, 4, 4), value, np.float32)


def asked(limits, pictures, last):
    """Samples at which the picture was read, up to the `last`, and what ended it there."""
    read = []

    def reader(done):
        def result():
            read.append(done)
            return pictures(done)

        return result

    ended = [limits.reached(done, 0.0, reader(done)) for done in range(1, last + 1)]
    assert not any(ended[:-1])
    return read, ended[-1]


def test_noise_is_looked_at_whenever_the_samples_have_doubled():
    """Of 100, 50, 25, … over the samples, half of what is left each time."""
    limits = Limits(ENDLESS)
    assert asked(limits, lambda done: picture(0.5 + 1.0 / done), 100) == ([4, 8, 16, 32, 64], "")
    assert limits.noise == pytest.approx(3 / 64 / (1e-4 + 3 * (0.5 + 1 / 64)), rel=1e-5)


def test_little_noise_ends_it_but_not_before_there_are_two_pictures():
    limits = Limits(ENDLESS)
    assert asked(limits, lambda _done: picture(0.5), 8) == ([4, 8], "noise threshold")
    assert limits.noise == 0.0


def test_without_a_threshold_nothing_is_read():
    how = FinalSettings(RenderSettings(4, 4, samples=16))
    assert asked(Limits(how), lambda _done: picture(0.5), 16) == ([], "samples")


def test_pixels_that_are_no_numbers_do_not_end_it():
    assert asked(Limits(ENDLESS), lambda _done: picture(np.nan), 64)[1] == ""


@pytest.mark.parametrize(("elapsed", "ended"), [(0.5, ""), (1.0, "time limit"), (2.0, "time limit")])
def test_time_ends_it_too(elapsed, ended):
    how = FinalSettings(RenderSettings(4, 4, samples=16), time_limit=1.0)
    assert Limits(how).reached(1, elapsed, lambda: picture(0.5)) == ended


@pytest.mark.parametrize(("threshold", "samples", "ended"), [(10.0, 8, "noise threshold"), (1e-5, 12, "samples")])
def test_a_render_ends_and_says_by_what(plane_scene, intercept, threshold, samples, ended):
    """The disc of the sun makes the shadow of a box soft, which few samples show as steps."""
    told = []
    intercept(update_stats=lambda _title, text: told.append(text))
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(-1.0, 0.0, 1.5))
    bpy.data.objects["Sun"].data.angle = 0.5
    ours = plane_scene.deep_gbuffer
    ours.samples, ours.use_noise_threshold, ours.noise_threshold = 12, True, threshold
    bpy.ops.render.render()
    last = statistics.last(plane_scene.name)
    assert (last["samples"], last["ended_by"]) == (samples, ended)
    assert told[-1].startswith(f"Sample {samples}/12 | Noise 0.")
    assert told[-1].endswith(f"Finished by {ended}")
    assert told.count("Sample 1/12") == 1


def test_a_threshold_that_is_off_does_not_count(plane_scene):
    ours = plane_scene.deep_gbuffer
    ours.samples, ours.noise_threshold = 12, 10.0
    bpy.ops.render.render()
    assert statistics.last(plane_scene.name)["samples"] == 12


def test_a_cancelled_render_was_ended_by_nothing(plane_scene, intercept):
    progress = []
    intercept(update_progress=progress.append, test_break=lambda: len(progress) >= 3)
    plane_scene.deep_gbuffer.samples = 500
    bpy.ops.render.render()
    assert statistics.last(plane_scene.name)["ended_by"] == ""
