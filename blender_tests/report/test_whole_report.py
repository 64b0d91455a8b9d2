# SPDX-License-Identifier: GPL-3.0-or-later
"""A report from the scene to the page: real renders by both engines, real plots, and nothing made twice."""

import json

import pytest

from addon.report.reference import REFERENCE_SETTINGS
from addon.report.sweep import Point
from tooling import environments
from tooling.report import tables
from tooling.report.instruments import BlenderInstruments
from tooling.report.interfaces import Options
from tooling.report.run import make

POINTS = (
    Point("Samples", "1 spp", "DEEP_GBUFFER", {"samples": "1"}),
    Point("Samples", "4 spp", "DEEP_GBUFFER", {"samples": "4"}),
    Point("Cycles", "1 spp", "CYCLES", {**REFERENCE_SETTINGS, "samples": "1"}),
)


@pytest.fixture(name="options")
def make_options(repository, tmp_path):
    blend = repository / "scenes" / "cornell_box.blend"
    return Options(((blend, None),), tmp_path, True, (96, 54), None, 1, "python3 build.py report")


def test_a_report_is_made_once_and_is_whole(options, tmp_path):
    instruments = BlenderInstruments(environments.blender_python(), warm_seconds=0.01, reference_samples=2)
    assert make(options, POINTS, instruments) == []
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert page.count("<svg") + page.count("data:image/svg+xml") >= 2
    assert all(text in page for text in ("Samples: 4 spp", "Cycles: 1 spp", "cornell_box.blend", "--samples 4"))
    (rows,) = tables.rows_of((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert [(row.series, row.label) for row in rows] == [(point.series, point.label) for point in POINTS]
    assert json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))["blender"].startswith("5.2")
    assert {path.suffix for path in (tmp_path / "plots").iterdir()} == {".png"}

    measured = {path: path.stat().st_mtime_ns for path in tmp_path.glob("measured/*")}
    assert len(measured) == len(POINTS)
    assert make(options, POINTS, instruments) == []
    assert {path: path.stat().st_mtime_ns for path in tmp_path.glob("measured/*")} == measured
