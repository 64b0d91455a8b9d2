# SPDX-License-Identifier: GPL-3.0-or-later
"""`build.py render SNAPSHOT.npz --set`: render settings by name, or an error that says what is allowed."""

import pytest

from addon.scene import RenderSettings
from addon.scene.settings import DebugView
from tooling.snapshot_job import JobError, settings_of


def settings(*assignments, resolution=(64, 32), samples=None):
    """The settings of a job with these --set assignments."""
    return settings_of({"resolution": resolution, "samples": samples, "set": assignments})


def test_resolution_and_samples_are_the_jobs():
    assert settings(samples=3) == RenderSettings(64, 32, samples=3)


def test_without_them_the_defaults_hold():
    plain = settings(resolution=None)
    assert (plain.width, plain.height, plain.samples) == (1920, 1080, RenderSettings(1, 1).samples)


def test_numbers_booleans_and_enumerations_by_name():
    chosen = settings(
        ("layers", "4"), ("minimum_separation", "0.25"), ("transparent_film", "On"), ("debug_view", "NORMAL")
    )
    assert (chosen.layers, chosen.minimum_separation, chosen.transparent_film) == (4, 0.25, True)
    assert chosen.debug_view is DebugView.NORMAL
    assert settings(("transparent_film", "off")).transparent_film is False


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(JobError, match=r"no setting 'lairs'; it has .*\blayers\b"):
        settings(("lairs", "4"))


@pytest.mark.parametrize("name", ["channels", "deep_output", "width", "height"])
def test_what_the_job_decides_itself_cannot_be_set(name):
    with pytest.raises(JobError, match=f"no setting '{name}'"):
        settings((name, "1"))


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("transparent_film", "maybe", "transparent_film: true or false, not 'maybe'"),
        ("debug_view", "SHINY", "debug_view: one of NONE, .*NORMAL.*, not 'SHINY'"),
        ("layers", "two", "layers: .*'two'"),
        ("minimum_separation", "far", "minimum_separation: .*'far'"),
    ],
)
def test_what_is_no_value_is_refused_by_name(name, text, message):
    with pytest.raises(JobError, match=message):
        settings((name, text))
