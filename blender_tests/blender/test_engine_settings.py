# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's properties as render settings."""

import pytest

from addon.engine import settings
from addon.scene import ShadingModel, Variant
from blender_tests.blender.engine_fixtures import plane_scene_fixture, registered_fixture  # noqa: F401 - fixtures


def both(scene, width=200, height=100):
    """The settings of a final render and of a viewport."""
    return settings.final(scene, width, height, frozenset()).render, settings.viewport(scene, width, height)


@pytest.mark.parametrize("variant", list(Variant))
def test_the_variant_holds_in_renders_and_viewports(plane_scene, variant):
    plane_scene.deep_gbuffer.variant = variant.value
    assert all(how.variant is variant for how in both(plane_scene))


def test_the_separation_in_use_is_the_one_that_is_shown(plane_scene):
    ours = plane_scene.deep_gbuffer
    ours.minimum_separation, ours.relative_separation = 2.0, 0.25
    assert all((how.minimum_separation, how.relative_separation) == (2.0, False) for how in both(plane_scene))
    ours.separation_unit = "RELATIVE"
    assert all((how.minimum_separation, how.relative_separation) == (0.25, True) for how in both(plane_scene))


@pytest.mark.parametrize(
    ("used", "unit", "expected"),
    [(False, "PIXELS", 0), (False, "PERCENT", 0), (True, "PIXELS", 12), (True, "PERCENT", 25)],
)
@pytest.mark.parametrize("size", [(200, 100), (100, 200), (197, 30)])
def test_the_guard_band_in_pixels(plane_scene, used, unit, expected, size):
    """12.5 % of the longer side, rounded up."""
    ours = plane_scene.deep_gbuffer
    ours.use_guard_band, ours.guard_band_unit = used, unit
    ours.guard_band_pixels, ours.guard_band_percent = 12, 12.5
    assert all(how.guard_band == expected for how in both(plane_scene, *size))


def test_settings_of_lights_and_shadows_hold_in_renders_and_viewports(plane_scene):
    ours = plane_scene.deep_gbuffer
    ours.shading_model, ours.shadow_map_size, ours.shadow_memory = "GOURAUD", "512", "1024"
    ours.shadow_updates, ours.world_directions, ours.light_threshold = 3, 7, 0.25
    for how in both(plane_scene):
        assert (how.shading_model, how.shadow_map_size, how.shadow_memory) == (ShadingModel.GOURAUD, 512, 1024)
        assert (how.shadow_updates, how.world_directions, how.light_threshold) == (3, 7, 0.25)


@pytest.mark.parametrize(
    ("files", "deep_output", "motion", "exits"),
    [
        ((), False, False, False),
        (("save_snapshot",), False, False, False),
        (("save_deep",), True, False, True),
        (("save_layers",), True, True, True),
        (("save_layers", "save_deep"), True, True, True),
    ],
)
def test_only_what_a_file_takes_is_rendered(plane_scene, files, deep_output, motion, exits):
    ours = plane_scene.deep_gbuffer
    ours.save_motion = ours.save_exit = True
    for name in files:
        setattr(ours, name, True)
    final, viewport = both(plane_scene)
    assert (final.deep_output, final.motion_vectors, final.exit_surfaces) == (deep_output, motion, exits)
    assert (viewport.deep_output, viewport.motion_vectors, viewport.exit_surfaces) == (False, False, False)
    preview = settings.final(plane_scene, 200, 100, frozenset(), samples=8).render
    assert (preview.deep_output, preview.motion_vectors, preview.exit_surfaces) == (False, False, False)
    ours.save_motion = ours.save_exit = False
    final, _viewport = both(plane_scene)
    assert (final.deep_output, final.motion_vectors, final.exit_surfaces) == (deep_output, False, False)
