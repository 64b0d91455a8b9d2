# SPDX-License-Identifier: GPL-3.0-or-later
"""The bench of deep G-buffer generation: what it calls an error, what moves in its sequences, what its tables say."""

from dataclasses import replace

import numpy as np
import pytest

from addon.scene import Layering, Moment, Scene, Variant
from blender_tests import builders
from blender_tests.bench import _clips, _errors, _generation_tables, _hall, _measuring, _occlusion

INF = np.inf
WIDTH, HEIGHT = 64, 64


def stack(*layers):
    """View depths (n, 1, W) from a row per layer."""
    return np.array(layers, np.float32)[:, None, :]


def reference(*layers):
    """A reference of these depths, seen by a camera of 64 pixels a side; its normals face the viewer."""
    depths = stack(*layers)
    normals = np.zeros((*depths.shape[1:], 3), np.float32)
    normals[..., 2] = 1.0
    return _errors.Reference(depths, normals, builders.camera())


def test_equal_layers_have_no_error():
    layers = ([1.0, 2.0, INF], [3.0, INF, INF])
    assert _errors.errors(stack(*layers), reference(*layers), 0.5) == _errors.Errors(0.0, 0.0, 0.0, 0.0)


def test_another_nearest_surface_is_no_error_but_a_fault():
    with pytest.raises(ValueError, match="layer 0 differs"):
        _errors.errors(stack([1.0], [3.0]), reference([1.1], [3.0]), 0.5)


def test_shares_are_of_covered_pixels_and_missed_ones_of_what_the_reference_has():
    expected = reference([1.0, 1.0, 1.0, 1.0, INF], [2.0, 2.0, 2.0, INF, INF])
    found = _errors.errors(stack([1.0, 1.0, 1.0, 1.0, INF], [2.0, INF, 1.25, 3.0, INF]), expected, 0.5)
    assert (found.violating, found.differing, found.missed) == (1 / 4, 3 / 4, 1 / 3)


def test_a_violation_is_anything_not_more_than_the_separation_behind_in_any_layer():
    depths = stack([1.0, 1.0, 1.0, INF], [1.5, 1.6, 9.0, INF], [INF, INF, 9.25, INF])
    assert _errors.violations(depths, 0.5).tolist() == [[True, False, True, False]]


def test_without_separation_the_same_depth_is_a_violation():
    assert _errors.violations(stack([2.0, 2.0], [2.0, 2.001]), 0.0).tolist() == [[True, False]]


def test_depths_that_rounding_can_explain_are_the_same_surface():
    one_bit = np.nextafter(np.float32(3.0), np.float32(4.0))
    depth, expected = np.array([[3.0, 3.0, INF, 3.0]], np.float32), np.array([[one_bit, 3.001, INF, INF]], np.float32)
    assert _errors.differences(depth, expected).tolist() == [[False, True, False, True]]


def test_one_layer_only_lacks_the_occlusion_of_the_others():
    depths, normals, camera = plane_under_a_slab()
    found = _errors.errors(depths[:1], _errors.Reference(depths, normals, camera), 0.5)
    assert (found.violating, found.differing, found.missed) == (0.0, 0.0, 0.0)
    assert found.occlusion > 0.01


def plane_under_a_slab():
    """A plane that faces the viewer at 2 m; over its right half, as another layer, one that is 0.2 m nearer.

    Layer 1 nearer than layer 0 is nothing a renderer makes, but the estimate asks only where its points are.
    """
    depths = np.full((2, HEIGHT, WIDTH), 2.0, np.float32)
    depths[1, :, WIDTH // 2 :] = 1.8
    depths[1, :, : WIDTH // 2] = INF
    normals = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    normals[..., 2] = 1.0
    return depths, normals, builders.camera()


def test_a_plane_does_not_occlude_itself():
    depths, normals, camera = plane_under_a_slab()
    assert np.all(_occlusion.obscurance(depths[:1], normals, camera) == 1.0)


def test_points_above_the_surface_within_the_radius_occlude():
    depths, normals, camera = plane_under_a_slab()
    openness = _occlusion.obscurance(depths, normals, camera)
    assert np.all(openness[:, 6:] < 0.7)
    depths[1, :, WIDTH // 2 :] = 2.0 - 1.1 * _occlusion.RADIUS
    assert np.all(_occlusion.obscurance(depths, normals, camera) == 1.0)


def test_of_two_layers_the_one_that_occludes_more_counts():
    depths, normals, camera = plane_under_a_slab()
    empty = np.full((1, HEIGHT, WIDTH), INF, np.float32)
    both = _occlusion.obscurance(np.concatenate([depths, empty, depths[1:]]), normals, camera)
    assert np.array_equal(both, _occlusion.obscurance(depths, normals, camera))


def test_nothing_is_said_where_nothing_is_seen():
    depths, normals, camera = plane_under_a_slab()
    depths[0, : HEIGHT // 2] = INF
    unknown = np.isnan(_occlusion.obscurance(depths, normals, camera))
    rows = len(unknown) // 2
    assert unknown[:rows].all()
    assert not unknown[rows:].any()


def test_a_pan_moves_a_point_at_its_depth_by_its_pixels():
    camera = _hall.camera(640, 360)
    step = _clips.pan_step(camera, 40.0, 9.0, 640)
    point = camera.position + np.array([1.0, 9.0, 0.5])

    def column(view):
        x, _, minus_depth = view.rotation.T @ (point - view.position)
        left, right = view.window[:2]
        return (x / -minus_depth - left) / (right - left) * 640

    assert column(camera) - column(_clips.panned(camera, step)) == pytest.approx(40.0, abs=1e-9)


def test_the_sequences_show_what_they_promise():
    clips = {clip.name: clip for clip in _clips.hall_clips(640, 360)}
    assert all(180_000 < _generation_tables.triangles(clip) < 220_000 for clip in clips.values())
    first, second = clips["hall, static"].moments[:2]
    assert first is second
    for name, pixels in (("hall, slow pan", _clips.SLOW), ("hall, fast pan", _clips.FAST)):
        first, second = clips[name].moments[:2]
        assert first.scene is second.scene
        step = _clips.pan_step(first.camera, pixels, _clips.HALL_DEPTH, 640)
        assert second.camera.position - first.camera.position == pytest.approx([step, 0.0, 0.0])


def test_turning_changes_the_rings_only():
    first, second = changed("hall, rotating")
    assert first.meshes == second.meshes
    other = [now.key for before, now in zip(first.batches, second.batches, strict=True) if before is not now]
    assert other == ["torus"]


def test_waves_change_the_vertices_of_the_cloth_only():
    first, second = changed("hall, deforming")
    assert first.batches == second.batches
    other = {key for key in first.meshes if first.meshes[key] is not second.meshes[key]}
    assert other == {"cloth 0", "cloth 1", "cloth 2"}
    for key in other:
        before, now = first.meshes[key], second.meshes[key]
        assert before.version != now.version
        assert np.array_equal(before.triangles, now.triangles)
        moved = np.linalg.norm(now.positions - before.positions, axis=1).max()
        assert 0.01 < moved < 2.0 * _hall.WAVE_HEIGHT


def changed(name):
    """The first two scenes of a sequence in the hall."""
    clip = next(clip for clip in _clips.hall_clips(640, 360) if clip.name == name)
    return clip.moments[0].scene, clip.moments[1].scene


def test_equal_parts_of_consecutive_scenes_become_the_same_objects():
    before = builders.scene(builders.quad("a"), builders.quad("b"))
    again = builders.scene(replace(builders.quad("a"), version=7), builders.quad("b", z=1.0))
    joined = _clips.shared(again, before)
    assert joined.meshes["a"] is before.meshes["a"]
    assert joined.meshes["b"] is again.meshes["b"]
    assert joined.batches[0] is before.batches[0]
    assert joined.materials["white"] is before.materials["white"]


def test_what_is_new_in_a_scene_stays():
    again = builders.scene(builders.quad("a"))
    assert _clips.shared(again, Scene()).meshes["a"] is again.meshes["a"]


def test_only_delay_looks_ahead():
    camera = builders.camera()
    moments = tuple(Moment(builders.scene(builders.quad("a")), camera) for _ in range(4))
    clip = _clips.Clip("clip", "", moments)
    delayed, reprojected = (_measuring.sequence(clip, 2, 0, variant) for variant in (Variant.DELAY, Variant.REPROJECT))
    assert (delayed.earlier, delayed.previous, delayed.following) == (moments[0], moments[1], moments[3])
    assert (reprojected.earlier, reprojected.previous, reprojected.following) == (moments[0], moments[1], None)


@pytest.mark.parametrize(("index", "known"), [(1, (None, None)), (2, (None, 1)), (3, (1, 2))])
def test_a_viewport_knows_no_frame_before_its_first(index, known):
    moments = tuple(Moment(builders.scene(builders.quad("a")), builders.camera()) for _ in range(4))
    seen = _measuring.sequence(_clips.Clip("clip", "", moments), index, 1, Variant.PREDICT)
    assert (seen.earlier, seen.previous) == tuple(None if frame is None else moments[frame] for frame in known)


def figures(stage, occlusion=0.0, differing=0.0):
    """Figures of frames with these milliseconds."""
    found = [_errors.Errors(0.0, differing, 0.0, occlusion) for _ in stage]
    return _measuring.Figures(list(stage), [1.0] * len(stage), found, 2**20)


def test_figures_are_medians_and_errors_means():
    measured = figures([5.0, 100.0, 6.0])
    measured.errors = [_errors.Errors(0.1, 0.0, 0.0, 0.0), _errors.Errors(0.3, 0.0, 0.0, 0.2)]
    assert measured.time == 6.0
    assert measured.error.violating == pytest.approx(0.2)
    assert measured.error.occlusion == pytest.approx(0.2 / 2**0.5)


def test_times_are_compared_frame_by_frame():
    mine, other = figures([20.0, 300.0, 40.0]), figures([10.0, 100.0, 10.0])
    assert mine.relative_to(other) == 3.0
    assert mine.relative_to(other, with_begin=True) == 301.0 / 101.0


def test_the_table_of_a_sequence_has_times_relative_to_one_layer_per_separation():
    group = {"PREPASS": figures([20.0], 0.0123, 0.5), "one layer": figures([10.0])}
    measured = dict.fromkeys(
        ((n, dz) for n in _generation_tables.LAYERS for dz in _generation_tables.SEPARATIONS), group
    )
    row = _generation_tables.variant_rows(measured)[0]
    assert row[:5] == ["Prepass", "2", "2.00 / 2.00 / 2.00", "1.91 / 1.91 / 1.91", "1.0"]
    assert row[5:] == ["0", "50.00 / 50.00 / 50.00", "0", "12.30 / 12.30 / 12.30"]
    assert _generation_tables.summary_rows({"a": measured})[0] == [
        *("Prepass", "2", "2.00", "1.0", "0", "50.00 (50.00)", "0", "12.30 (12.30)")
    ]


def test_the_verdict_counts_what_is_dearer_at_two_layers():
    def row(layers, method, *ratios):
        return _generation_tables.LayeringRow("hall", layers, method, 100.0, ratios)

    rows = [
        row(2, Layering.GEOMETRY_SHADER, 0.9, 1.2, 1.004, 1.0),
        row(4, Layering.GEOMETRY_SHADER, 2.0, 2.0, 2.0, 2.0),
        row(2, Layering.VERTEX_SHADER, 0.9, 0.9, 0.9, 0.9),
    ]
    dearer = _generation_tables.verdict(Layering.GEOMETRY_SHADER, rows)
    assert dearer.startswith("- By geometry shader, ")
    assert "no, more in 1 of 4 cases (0.90 to 1.20 times as much)" in dearer
    assert "yes, always" in _generation_tables.verdict(Layering.VERTEX_SHADER, rows)
