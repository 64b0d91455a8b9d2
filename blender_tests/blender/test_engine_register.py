# SPDX-License-Identifier: GPL-3.0-or-later
"""Registering, and taking everything back without a trace."""

import re
import subprocess
import sys
import threading
from functools import reduce
from pathlib import Path

import bpy
import pytest

import addon
from addon.engine import sessions, settings, viewport
from addon.engine.statistics import ENGINE
from addon.scene import DebugView, RenderSettings, ShadingModel, Variant
from addon.ui import operators
from blender_tests.blender.engine_fixtures import plane_scene_fixture, registered_fixture  # noqa: F401 - fixtures

PRESETS = ("deep_gbuffer/sampling", "deep_gbuffer/layers")
"""Folders of presets that come with the add-on."""
LIGHT_SETTINGS = (
    "shading_model",
    "shadow_map_size",
    "shadow_memory",
    "shadow_updates",
    "world_directions",
    "light_threshold",
)
IN_ALL_VERSIONS = (
    "RENDER_PT_format",
    "RENDER_PT_output",
    "RENDER_PT_color_management",
    "MATERIAL_PT_preview",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
    "WORLD_PT_context_world",
    "DATA_PT_EEVEE_light",
    "DATA_PT_EEVEE_light_influence",
    "DATA_PT_spot",
    "DATA_PT_lens",
    "OBJECT_PT_shading",
    "OBJECT_PT_visibility",
    "VIEWLAYER_PT_layer",
)


def panels():
    return [panel for panel in bpy.types.Panel.__subclasses__() if hasattr(panel, "COMPAT_ENGINES")]


def traces():
    """Everything that registering may change, as plain values."""
    names = [name for name in dir(bpy.app.handlers) if name.endswith(("_pre", "_post", "_init", "_complete"))]
    engines = [cls for cls in bpy.types.RenderEngine.__subclasses__() if cls.is_registered]
    return {
        "types": sorted(name for name in dir(bpy.types) if "deep_gbuffer" in name.lower() or "DeepGBuffer" in name),
        "engines": sorted(getattr(cls, "bl_idname", "") for cls in engines),
        "compatible": {panel.__name__: sorted(panel.COMPAT_ENGINES) for panel in panels() if panel.is_registered},
        "handlers": {name: list(getattr(bpy.app.handlers, name)) for name in names},
        "timers": bpy.app.timers.is_registered(viewport._tick),
        "properties": sorted(bpy.types.Scene.bl_rna.properties.keys()),
        "presets": sorted(path for folder in PRESETS for path in bpy.utils.preset_paths(folder)),
        "threads": sorted(thread.name for thread in threading.enumerate() if thread.name == "GLThread"),
        "sessions": (len(sessions._final), len(sessions._mirrors), len(viewport._viewports)),
    }


@pytest.fixture(name="unregistered")
def unregistered_fixture(registered):
    """The add-on taken away for the time of a test."""
    addon.unregister()
    yield
    addon.register()


def test_twice_in_a_row_leaves_no_trace(unregistered):
    before = traces()
    assert not before["types"]
    assert not [name for name, engines in before["compatible"].items() if ENGINE in engines]
    assert "deep_gbuffer" not in before["properties"]
    assert not [path for path in before["presets"] if "addon" in path]
    assert before["threads"] == []
    for _ in range(2):
        addon.register()
        assert traces()["types"]
        scene = bpy.context.scene
        scene.render.engine = ENGINE
        scene.render.resolution_x = scene.render.resolution_y = 16
        if scene.camera is None:
            scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
            scene.collection.objects.link(scene.camera)
        bpy.ops.render.render()
        assert traces()["threads"] == ["GLThread"]
        addon.unregister()
        assert traces() == before


@pytest.mark.parametrize("name", IN_ALL_VERSIONS)
def test_blenders_own_panels_show(registered, name):
    assert ENGINE in getattr(bpy.types, name).COMPAT_ENGINES


@pytest.mark.parametrize("name", ["OBJECT_PT_light_linking", "OBJECT_PT_shadow_linking"])
def test_linking_of_lights_shows_wherever_its_parent_does(registered, name):
    panel = getattr(bpy.types, name)
    assert panel.bl_parent_id == "OBJECT_PT_shading"
    assert not hasattr(panel, "COMPAT_ENGINES")


def test_panels_whose_settings_we_do_not_read_stay_away(registered):
    shown = {panel.__name__ for panel in panels() if ENGINE in panel.COMPAT_ENGINES}
    assert not {name for name in shown if "freestyle" in name.lower() or "eevee_raytracing" in name}
    assert "DATA_PT_light" not in shown


def test_a_process_that_forgets_to_unregister_ends(registered):
    script = "import sys; sys.path.append(sys.argv[1]); import addon; addon.register()"
    done = subprocess.run([sys.executable, "-c", script, str(Path(addon.__file__).parents[1])], timeout=60, check=False)
    assert done.returncode == 0


def test_every_property_tells_what_it_is(registered):
    settings = bpy.context.scene.deep_gbuffer
    groups = settings, settings.indirect, settings.indirect.render
    own = [
        item
        for group in groups
        for item in group.bl_rna.properties
        if item.identifier not in {"rna_type", "name"} and item.type != "POINTER"
    ]
    assert len(own) == 29 + 11 + 8
    for item in own:
        assert len(item.description) > 15, item.identifier
        assert not item.description.endswith("."), item.identifier
        if item.type in {"INT", "FLOAT"}:
            assert item.soft_max <= item.hard_max
            assert item.hard_min <= item.default <= item.soft_max
        for choice in item.enum_items if item.type == "ENUM" else ():
            assert len(choice.description) > 15 or choice.identifier == "NONE", (item.identifier, choice.identifier)
            assert not choice.description.endswith("."), (item.identifier, choice.identifier)
    units = {item.identifier: item.unit for item in own if item.type == "FLOAT" and item.unit != "NONE"}
    lengths = dict.fromkeys(("minimum_separation", "radius", "march_distance", "cell_size"), "LENGTH")
    assert units == {**lengths, "time_limit": "TIME_ABSOLUTE"}


def test_every_variant_and_every_debug_view_can_be_chosen(registered):
    properties = bpy.context.scene.deep_gbuffer.bl_rna.properties
    assert [item.identifier for item in properties["variant"].enum_items] == list(Variant)
    assert {item.identifier for item in properties["debug_view"].enum_items} == set(DebugView)
    assert [item.identifier for item in properties["shading_model"].enum_items] == list(ShadingModel)
    assert [int(item.identifier) for item in properties["shadow_map_size"].enum_items] == [
        2**power for power in range(8, 14)
    ]


def test_items_keep_the_places_that_files_store(registered):
    properties = bpy.context.scene.deep_gbuffer.bl_rna.properties
    views = [item.identifier for item in properties["debug_view"].enum_items]
    assert views[9:] == [
        *("MOTION", "EXIT_DEPTH", "EXIT_NORMAL", "EXIT_ALBEDO"),
        *("INDIRECT", "GRID_CELLS", "GRID_RADIANCE", "MARCH_HITS", "LIGHT_ORIGIN"),
    ]


def test_defaults(registered, plane_scene):
    fresh = bpy.data.scenes.new("Fresh").deep_gbuffer
    assert (fresh.samples, fresh.viewport_samples, fresh.layers, fresh.minimum_separation) == (16, 16, 2, 0.5)
    assert (fresh.time_limit, fresh.layers_path, fresh.save_layers, fresh.save_deep) == (0.0, "//", False, False)
    assert (fresh.separation_unit, fresh.relative_separation) == ("DISTANCE", pytest.approx(0.05))
    assert (fresh.use_guard_band, fresh.guard_band_unit, fresh.guard_band_pixels) == (False, "PIXELS", 64)
    assert fresh.guard_band_percent == 3.0
    assert (fresh.save_motion, fresh.save_exit) == (False, False)
    assert (fresh.use_noise_threshold, fresh.noise_threshold) == (False, pytest.approx(0.01))
    how, default = settings.viewport(plane_scene, 8, 8), RenderSettings(8, 8)
    for name in LIGHT_SETTINGS:
        assert getattr(how, name) == pytest.approx(getattr(default, name)), name


@pytest.mark.parametrize(
    ("folder", "preset", "name", "value"),
    [
        ("deep_gbuffer/sampling", "Draft", "samples", 4),
        ("deep_gbuffer/layers", "Tabletop", "minimum_separation", pytest.approx(0.02)),
        ("deep_gbuffer/layers", "Landscape", "separation_unit", "RELATIVE"),
    ],
)
def test_presets_set_what_they_are_for(registered, plane_scene, folder, preset, name, value):
    found = [path for path in bpy.utils.preset_paths(folder) if "addon" in path]
    assert len(found) == 1
    menu = f"DEEP_GBUFFER_PT_{folder.split('/')[1]}_presets"
    bpy.ops.script.execute_preset(filepath=f"{found[0]}/{preset}.py", menu_idname=menu)
    assert getattr(bpy.context.scene.deep_gbuffer, name) == value


def test_every_shipped_preset_sets_existing_properties(registered):
    settings = bpy.context.scene.deep_gbuffer
    for folder in PRESETS:
        for path in next(Path(path) for path in bpy.utils.preset_paths(folder) if "addon" in path).glob("*.py"):
            names = re.findall(r"^settings\.(\w+) =", path.read_text(encoding="utf-8"), re.MULTILINE)
            assert names, path
            assert all(name in settings.bl_rna.properties for name in names), path


@pytest.mark.parametrize("cls", [cls for cls in operators.CLASSES if hasattr(cls, "preset_values")])
def test_presets_of_ones_own_keep_existing_properties(registered, cls):
    assert cls.preset_values
    for value in cls.preset_values:
        owner, *path, name = value.split(".")
        assert owner == "settings"
        group = reduce(getattr, path, bpy.context.scene.deep_gbuffer)
        assert not group.bl_rna.properties[name].is_readonly


def test_copying_statistics_needs_a_render(plane_scene):
    assert not bpy.ops.deep_gbuffer.copy_statistics.poll()
    bpy.ops.render.render()
    assert bpy.ops.deep_gbuffer.copy_statistics.poll()
