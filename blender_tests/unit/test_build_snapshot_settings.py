# SPDX-License-Identifier: GPL-3.0-or-later
"""`build.py render SNAPSHOT.npz`: settings by name, or an error that says what is allowed; the frames it knows of."""

from dataclasses import replace

import pytest

from addon.scene import IndirectMethod, IndirectSettings, Moment, RenderSettings, Sequence, snapshot
from addon.scene.settings import DebugView, Layering, Variant
from blender_tests import builders
from tooling.snapshot_job import JobError, frames_of, settings_of


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


def test_how_layers_are_generated_can_be_set():
    chosen = settings(
        ("variant", "REPROJECT"), ("layering", "VERTEX_SHADER"), ("guard_band", "16"), ("relative_separation", "on")
    )
    assert (chosen.variant, chosen.layering) == (Variant.REPROJECT, Layering.VERTEX_SHADER)
    assert (chosen.guard_band, chosen.relative_separation) == (16, True)


def test_indirect_light_can_be_set_by_dots():
    chosen = settings(("indirect.method", "DEEP_MARCH"), ("indirect.rays", "3"), ("indirect.spatial_filter", "off"))
    assert chosen == replace(
        RenderSettings(64, 32),
        indirect=IndirectSettings(method=IndirectMethod.DEEP_MARCH, rays=3, spatial_filter=False),
    )


@pytest.mark.parametrize("name", ["indirect", "indirect.ray", "indirect.", "layers.rays", ".layers"])
def test_a_path_that_leads_nowhere_is_refused(name):
    with pytest.raises(JobError, match=f"no setting '{name}'; it has .*"):
        settings((name, "1"))


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
        ("variant", "FANCY", "variant: one of TWO_PASS, .*REPROJECT, not 'FANCY'"),
        ("layers", "two", "layers: .*'two'"),
        ("minimum_separation", "far", "minimum_separation: .*'far'"),
    ],
)
def test_what_is_no_value_is_refused_by_name(name, text, message):
    with pytest.raises(JobError, match=message):
        settings((name, text))


def seen(x):
    """A scene with its own camera at some x."""
    return replace(
        builders.scene(builders.quad("q")),
        camera=replace(builders.camera(), world_from_camera=builders.translation(x, 0.0, 3.0)),
    )


def test_the_frames_of_a_snapshot_are_its_sequence(tmp_path):
    snapshot.save(tmp_path / "scene.npz", seen(3.0), seen(2.0), seen(1.0))
    frame, sequence = frames_of(snapshot.load(tmp_path / "scene.npz"), "scene.npz")
    frames = frame, sequence.previous, sequence.earlier
    assert [moment.camera.position[0] for moment in frames] == [3.0, 2.0, 1.0]
    assert all(moment.scene.camera is moment.camera for moment in frames)
    assert not sequence.continuous


def test_without_other_frames_nothing_is_known_of_any():
    scene = seen(3.0)
    assert frames_of(snapshot.Snapshot(scene), "scene.npz") == (Moment(scene, scene.camera), Sequence())


def test_a_frame_without_a_camera_is_not_known():
    _, sequence = frames_of(snapshot.Snapshot(seen(3.0), replace(seen(2.0), camera=None)), "scene.npz")
    assert sequence.previous is None
    with pytest.raises(JobError, match="scene.npz: the scene has no camera"):
        frames_of(snapshot.Snapshot(builders.scene(), seen(2.0)), "scene.npz")
