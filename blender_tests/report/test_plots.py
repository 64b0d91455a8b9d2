# SPDX-License-Identifier: GPL-3.0-or-later
"""Plots of error against time, drawn by matplotlib."""

from blender_tests.report_builders import errors, measurement, scene, swept
from tooling.report import panels, plots

LARGEST = 120_000
"""Bytes of a plot that is committed."""


def test_plots_of_any_report_can_be_drawn():
    perfect = measurement(flip=0.0, digest="perfect", errors=errors(relative_mse=0.0, rmse=0.0))
    for measurements in ([perfect], [measurement(warm=())], [*swept(quick=False), perfect]):
        shown = [panels.panel(scene(measurements), metric) for metric in (panels.FLIP, panels.RELATIVE_MSE)]
        data = plots.png(shown, "a <b>room</b> & more")
        assert data.startswith(b"\x89PNG")
        assert len(data) < LARGEST
        svg = plots.svg(shown[0])
        assert "<text" in svg
        assert svg.count("<svg") == 1
