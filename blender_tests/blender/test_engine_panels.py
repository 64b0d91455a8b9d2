# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels draw what is there: every property they name exists, and statistics are readable."""

from functools import partial
from types import SimpleNamespace

import addon_utils
import bpy
import pytest

from addon.report.engines import assign
from addon.scene import IndirectMethod
from addon.ui import data_panels, indirect_panels, panels, sampling_panels
from addon.ui.panels import (
    DEEP_GBUFFER_PT_guard_band,
    DEEP_GBUFFER_PT_layer_output,
    DEEP_GBUFFER_PT_layers,
    DEEP_GBUFFER_PT_statistics,
)
from blender_tests.blender.engine_fixtures import plane_scene_fixture, registered_fixture  # noqa: F401 - fixtures

CLASSES = (*sampling_panels.CLASSES, *indirect_panels.CLASSES, *panels.CLASSES)
PANELS = [panel for panel in CLASSES if hasattr(panel, "_column")]
ALTERNATIVES = {"minimum_separation": "relative_separation", "guard_band_pixels": "guard_band_percent"}
"""Properties of which a panel shows one or the other."""


class Layout:
    """Stands in for a UILayout: checks and collects texts, operators, properties and those that are grayed out."""

    def __init__(self, parent=None):
        self.active = True
        self.parent = parent
        self.texts = parent.texts if parent else []
        self.properties = parent.properties if parent else []
        self.operators = parent.operators if parent else []
        self.gray = parent.gray if parent else set()

    def _nested(self, **_options):
        return Layout(self)

    box = column = row = split = _nested

    @property
    def grayed_out(self):
        return not self.active or (self.parent is not None and self.parent.grayed_out)

    def label(self, text, **_options):
        self.texts.append(text)

    def prop(self, data, name, **_options):
        assert name in data.bl_rna.properties, name
        self.properties.append(name)
        if self.grayed_out:
            self.gray.add(name)

    def progress(self, text, factor):
        assert 0.0 <= factor <= 1.0
        self.texts.append(text)

    def operator(self, name, **_options):
        category, function = name.split(".")
        assert hasattr(getattr(bpy.ops, category), function)
        self.operators.append(name)
        return SimpleNamespace()


def drawn(panel, context=None):
    """What the panel and its header show; in Blender's own context unless told otherwise."""
    whole = Layout()
    for draw in (getattr(panel, "draw_header", None), panel.draw):
        if draw is not None:
            stand_in = SimpleNamespace(layout=Layout(whole))
            for name in ("_column", "_draw_numbers"):
                if hasattr(panel, name):
                    setattr(stand_in, name, partial(getattr(panel, name), stand_in))
            draw(stand_in, context or bpy.context)
    return whole


@pytest.mark.parametrize("panel", PANELS)
def test_every_panel_draws_before_and_after_a_render(plane_scene, panel):
    before = drawn(panel)
    bpy.ops.render.render()
    after = drawn(panel)
    assert after.properties or after.texts
    assert before.properties == after.properties


def test_every_setting_has_its_place_in_a_panel(plane_scene):
    ours = plane_scene.deep_gbuffer
    shown = {name for panel in PANELS for name in drawn(panel).properties}
    assert not shown & set(ALTERNATIVES.values())
    ours.separation_unit, ours.guard_band_unit = "RELATIVE", "PERCENT"
    others = {name for panel in PANELS for name in drawn(panel).properties}
    assert not others & set(ALTERNATIVES)
    for method in IndirectMethod:
        ours.indirect.method = method.value
        others |= {name for panel in indirect_panels.CLASSES[1:] for name in drawn(panel).properties}
    groups = ours, ours.indirect, ours.indirect.render
    own = {item.identifier for group in groups for item in group.bl_rna.properties if item.type != "POINTER"}
    assert own - {"name"} <= shown | others
    assert {"film_transparent", "filter_size", "use_pass_z", "use_pass_object_index"} <= shown


def test_what_only_concerns_several_layers_is_gray_with_one(plane_scene):
    assert not drawn(DEEP_GBUFFER_PT_layers).gray
    plane_scene.deep_gbuffer.layers = 1
    assert drawn(DEEP_GBUFFER_PT_layers).gray == {"variant", "separation_unit", "minimum_separation"}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({}, True),
        ({"layers": 1}, False),
        ({"save_layers": True}, False),
        ({"save_deep": True}, False),
        ({"debug_view": "NORMAL", "debug_layer": 2}, False),
        ({"debug_view": "NORMAL", "debug_layer": 1}, True),
        ({"debug_layer": 2}, True),
        ({"indirect.method": "RADIOSITY"}, False),
        ({"indirect.method": "MARCH_GRID"}, False),
        ({"indirect.method": "MARCH_GRID", "indirect.render.contact_steps": 0}, False),
        (
            {
                "indirect.method": "MARCH_GRID",
                "indirect.render.contact_steps": 0,
                "indirect.viewport.contact_steps": 0,
            },
            True,
        ),
    ],
)
def test_who_sets_layers_is_told_where_nothing_reads_them(plane_scene, change, told):
    for name, value in change.items():
        assign(plane_scene.deep_gbuffer, name, str(value))
    assert any("Nothing reads" in text for text in drawn(DEEP_GBUFFER_PT_layers).texts) == told


@pytest.mark.parametrize(
    ("variant", "layers", "used", "gray"),
    [
        ("REPROJECT", 2, True, set()),
        ("REPROJECT", 2, False, {"guard_band_unit", "guard_band_pixels"}),
        ("REPROJECT", 1, True, {"use_guard_band", "guard_band_unit", "guard_band_pixels"}),
        ("PREVIOUS", 2, True, {"use_guard_band", "guard_band_unit", "guard_band_pixels"}),
    ],
)
def test_a_guard_band_that_nothing_reads_is_gray(plane_scene, variant, layers, used, gray):
    ours = plane_scene.deep_gbuffer
    ours.variant, ours.layers, ours.use_guard_band = variant, layers, used
    assert drawn(DEEP_GBUFFER_PT_guard_band).gray == gray


def test_indirect_light_reads_the_guard_band(plane_scene):
    ours = plane_scene.deep_gbuffer
    ours.use_guard_band, ours.indirect.method = True, "MARCH_GRID"
    assert not drawn(DEEP_GBUFFER_PT_guard_band).gray


def test_options_of_files_that_are_not_written_are_gray(plane_scene):
    ours = plane_scene.deep_gbuffer
    assert drawn(DEEP_GBUFFER_PT_layer_output).gray == {"save_motion", "save_exit", "layers_path"}
    ours.save_deep = True
    assert drawn(DEEP_GBUFFER_PT_layer_output).gray == {"save_motion"}
    ours.save_deep, ours.save_layers = False, True
    assert not drawn(DEEP_GBUFFER_PT_layer_output).gray


def showing(**data):
    """A context that shows some data in the Properties editor of our engine."""
    return SimpleNamespace(
        **{"engine": "DEEP_GBUFFER", **dict.fromkeys(("object", "light", "material", "world")), **data}
    )


@pytest.mark.parametrize("panel", data_panels.CLASSES)
def test_panels_of_data_show_where_there_is_some_and_the_engine_is_ours(registered, panel):
    material = bpy.data.materials.new("Paint")
    lamp = bpy.data.lights.new("Lamp", "POINT")
    data = {"object": bpy.data.objects.new("Lamp", lamp), "light": lamp, "material": material}
    full = showing(**data, world=bpy.data.worlds.new("World"))
    assert panel.poll(full)
    assert not panel.poll(SimpleNamespace(**{**vars(full), "engine": "CYCLES"}))
    assert not panel.poll(showing())
    assert drawn(panel, full).properties
    assert hasattr(bpy.types, getattr(panel, "bl_parent_id", panel.__name__))


def test_settings_of_cycles_are_shown_as_long_as_there_are_any(registered):
    context = showing(material=bpy.data.materials.new("Paint"), world=bpy.data.worlds.new("World"))
    panels = data_panels.DEEP_GBUFFER_PT_material_settings, data_panels.DEEP_GBUFFER_PT_world_ray_visibility
    addon_utils.disable("cycles")
    try:
        assert not any(panel.poll(context) for panel in panels)
    finally:
        addon_utils.enable("cycles")
    assert all(panel.poll(context) for panel in panels)


def test_each_kind_of_object_shows_the_rays_that_are_read_of_it(registered):
    def shown(data, instance_type="NONE"):
        item = bpy.data.objects.new("Thing", data)
        item.instance_type = instance_type
        context = showing(object=item)
        panel = data_panels.DEEP_GBUFFER_PT_object_ray_visibility
        return drawn(panel, context).properties if panel.poll(context) else []

    assert shown(bpy.data.meshes.new("M")) == ["visible_camera", "visible_shadow"]
    assert shown(bpy.data.lights.new("L", "SUN")) == ["visible_diffuse", "visible_glossy"]
    assert shown(None) == shown(bpy.data.cameras.new("C")) == []
    assert len(shown(None, "COLLECTION")) == 4


def test_a_limit_of_shadow_maps_that_is_not_kept_is_gray(registered):
    panel = data_panels.DEEP_GBUFFER_PT_light_shadow
    limit = "shadow_maximum_resolution"
    lamp, sun = bpy.data.lights.new("Lamp", "POINT"), bpy.data.lights.new("Sun", "SUN")
    assert drawn(panel, showing(light=lamp)).gray == {limit}
    lamp.use_absolute_resolution = True
    assert not drawn(panel, showing(light=lamp)).gray
    assert drawn(panel, showing(light=sun)).properties == ["use_shadow", limit]
    assert not drawn(panel, showing(light=sun)).gray
    sun.use_shadow = False
    assert drawn(panel, showing(light=sun)).gray == {limit}


def test_statistics_show_times_passes_reasons_and_memory(plane_scene):
    assert drawn(DEEP_GBUFFER_PT_statistics).texts == ["No final render yet."]
    bpy.ops.render.render()
    texts = drawn(DEEP_GBUFFER_PT_statistics).texts
    assert {"Time", "Passes (last sample)", "Left out", "Memory", "gbuffer", "direct", "composite"} <= set(texts)
    assert any(text.endswith(" ms") for text in texts)
    assert texts[texts.index("Ended by") + 1] == "Samples"
    assert any(text.endswith(" MiB") for text in texts)
    assert any("no" in text for text in texts[texts.index("Left out") : texts.index("Memory")])
