# SPDX-License-Identifier: GPL-3.0-or-later
"""Registering, and taking everything back without a trace."""

import subprocess
import sys
import threading
from pathlib import Path

import bpy
import pytest

import addon
from addon.engine import sessions, viewport
from addon.engine.statistics import ENGINE
from blender_tests.blender.engine_fixtures import plane_scene_fixture, registered_fixture  # noqa: F401 - fixtures

IN_ALL_VERSIONS = (
    "RENDER_PT_format",
    "RENDER_PT_output",
    "RENDER_PT_color_management",
    "MATERIAL_PT_preview",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
    "WORLD_PT_context_world",
    "DATA_PT_EEVEE_light",
    "DATA_PT_spot",
    "DATA_PT_lens",
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
        "presets": sorted(bpy.utils.preset_paths("deep_gbuffer/sampling")),
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
    own = [item for item in settings.bl_rna.properties if item.identifier not in {"rna_type", "name"}]
    assert len(own) == 12
    for item in own:
        assert len(item.description) > 15, item.identifier
        assert not item.description.endswith("."), item.identifier
        if item.type in {"INT", "FLOAT"}:
            assert item.soft_max <= item.hard_max
            assert item.hard_min <= item.default <= item.soft_max
    units = {item.identifier: item.unit for item in own if item.type == "FLOAT"}
    assert units == {"minimum_separation": "LENGTH", "time_limit": "TIME_ABSOLUTE"}


def test_defaults(registered, plane_scene):
    fresh = bpy.data.scenes.new("Fresh").deep_gbuffer
    assert (fresh.samples, fresh.viewport_samples, fresh.layers, fresh.minimum_separation) == (16, 16, 2, 0.5)
    assert (fresh.time_limit, fresh.layers_path, fresh.save_layers, fresh.save_deep) == (0.0, "//", False, False)


def test_presets_set_samples(registered, plane_scene):
    found = [path for path in bpy.utils.preset_paths("deep_gbuffer/sampling") if "addon" in path]
    assert len(found) == 1
    bpy.ops.script.execute_preset(filepath=f"{found[0]}/Draft.py", menu_idname="DEEP_GBUFFER_PT_sampling_presets")
    assert bpy.context.scene.deep_gbuffer.samples == 4


def test_copying_statistics_needs_a_render(plane_scene):
    assert not bpy.ops.deep_gbuffer.copy_statistics.poll()
    bpy.ops.render.render()
    assert bpy.ops.deep_gbuffer.copy_statistics.poll()
