# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of what a report measures: complete, without doubles, and in words the engines know."""

import pytest

from addon.report import sweep
from addon.report.engines import ENGINES
from addon.scene import IndirectMethod, Variant
from addon.scene.quality import DEFAULT_QUALITY, QUALITIES


@pytest.mark.parametrize("quick", [False, True])
def test_no_point_is_measured_twice(quick):
    found = sweep.points(quick=quick)
    assert len({point.identity for point in found}) == len(found)


def test_the_short_report_is_part_of_the_long_one():
    every = {point.identity for point in sweep.points(quick=False)}
    short = {point.identity for point in sweep.points(quick=True)}
    assert short < every


def test_every_short_point_is_one_of_its_series():
    for series in sweep.SWEEP:
        assert set(series.quick) <= set(series.values), series.name


def test_every_engine_is_measured():
    assert {point.engine for point in sweep.points(quick=True)} == set(ENGINES)


def test_every_variant_is_measured():
    """Two-Pass is the default, with which everything else is measured."""
    measured = {point.settings.get("variant", "TWO_PASS") for point in sweep.points(quick=False)}
    assert measured == {variant.value for variant in Variant}


def test_every_method_is_measured_and_every_quality():
    """March + grid and its default quality are the default, with which everything else is measured."""
    found = [point.settings for point in sweep.points(quick=False)]
    methods = {settings.get("indirect.method", "MARCH_GRID") for settings in found}
    assert methods == {method.value for method in IndirectMethod}
    qualities = {settings.get("indirect.render.preset", DEFAULT_QUALITY.value) for settings in found}
    assert qualities == {quality.value for quality in QUALITIES}


def test_layers_and_exit_surfaces_are_measured_together():
    found = {
        (settings.get("indirect.method"), settings.get("layers"), settings.get("indirect.exit_surfaces"))
        for settings in (point.settings for point in sweep.points(quick=False))
    }
    for method in (None, "DEEP_MARCH"):
        assert {(method, layers, exits) for layers in "124" for exits in (None, "True")} <= found


def test_every_preset_file_is_measured():
    named = {(point.series, point.label) for series in sweep.SWEEP for point in series.points(quick=False)}
    for series, folder in (("Sampling preset", "sampling"), ("Layer preset", "layers")):
        assert {(series, path.stem) for path in (sweep.PRESETS / folder).glob("*.py")} <= named


def test_a_preset_is_what_its_file_says_of_final_renders():
    assert sweep.presets("sampling")["Draft"] == {"samples": "4", "time_limit": "0.0"}


def test_nothing_of_the_files_own_stops_a_measurement_early():
    """Workbench and EEVEE have no time limit."""
    limited = (point for point in sweep.points(quick=False) if point.engine in {sweep.OURS, "CYCLES"})
    assert {float(point.settings["time_limit"]) for point in limited} == {0.0}


def test_a_value_wins_over_the_base():
    series = sweep.Series("Samples", sweep.OURS, sweep.each("samples", (7,), "{} spp"), {"samples": "4", "seed": "1"})
    (point,) = series.points(quick=False)
    assert (point.label, point.settings) == ("7 spp", {"samples": "7", "seed": "1"})
