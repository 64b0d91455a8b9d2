# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels draw what is there: every property they name exists, and statistics are readable."""

from types import SimpleNamespace

import bpy
import pytest

from addon.ui.panels import CLASSES, DEEP_GBUFFER_PT_statistics
from blender_tests.blender.engine_fixtures import plane_scene_fixture, registered_fixture  # noqa: F401 - fixtures


class Layout:
    """Stands in for a UILayout: checks properties and collects texts."""

    def __init__(self):
        self.texts = []
        self.properties = []

    def _nested(self, **_options):
        return self

    box = column = row = split = _nested

    def label(self, text):
        self.texts.append(text)

    def prop(self, data, name, **_options):
        assert name in data.bl_rna.properties, name
        self.properties.append(name)

    def operator(self, name, **_options):
        category, function = name.split(".")
        assert hasattr(getattr(bpy.ops, category), function)


def drawn(panel):
    layout = Layout()
    stand_in = SimpleNamespace(layout=layout)
    stand_in._column = lambda: panel._column(stand_in)
    panel.draw(stand_in, bpy.context)
    return layout


@pytest.mark.parametrize("panel", [panel for panel in CLASSES if hasattr(panel, "_column")])
def test_every_panel_draws_before_and_after_a_render(plane_scene, panel):
    before = drawn(panel)
    bpy.ops.render.render()
    after = drawn(panel)
    assert after.properties or after.texts
    assert before.properties == after.properties


def test_every_setting_has_its_place_in_a_panel(plane_scene):
    shown = {name for panel in CLASSES if hasattr(panel, "_column") for name in drawn(panel).properties}
    own = {item.identifier for item in plane_scene.deep_gbuffer.bl_rna.properties} - {"rna_type", "name"}
    assert own <= shown
    assert {"film_transparent", "filter_size", "use_pass_z", "use_pass_object_index"} <= shown


def test_statistics_show_times_passes_reasons_and_memory(plane_scene):
    assert drawn(DEEP_GBUFFER_PT_statistics).texts == ["No final render yet."]
    bpy.ops.render.render()
    texts = drawn(DEEP_GBUFFER_PT_statistics).texts
    assert {"Time", "Passes (last sample)", "Left out", "Memory", "gbuffer", "direct", "composite"} <= set(texts)
    assert any(text.endswith(" ms") for text in texts)
    assert any(text.endswith(" MiB") for text in texts)
    assert any("no" in text for text in texts[texts.index("Left out") : texts.index("Memory")])
