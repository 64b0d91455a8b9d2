# SPDX-License-Identifier: GPL-3.0-or-later
"""Plots of error against time, drawn by matplotlib."""

import pytest
from matplotlib import pyplot

from blender_tests.report_builders import errors, measurement, scene, swept
from tooling.report import labels, panels, plots

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


def written(*marks):
    """Where the texts of marks at these places stand, as boxes in pixels, beside the marks in pixels."""
    figure = pyplot.figure(figsize=(6.0, 4.0))
    try:
        axes = figure.add_subplot(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
        labels.place(axes, [labels.Label(x, y, "Workbench", (0.0, 0.0, 0.0)) for x, y in marks], [], 10.0)
        renderer = figure.canvas.get_renderer()
        boxes = [text.get_window_extent(renderer).extents for text in axes.texts]
        return boxes, [axes.transData.transform(mark) for mark in marks], figure.dpi / 72.0
    finally:
        pyplot.close(figure)


@pytest.mark.parametrize("apart", [0.01 * step for step in range(16, 28)])
def test_a_text_does_not_stand_beside_another_mark(apart):
    boxes, (first, second), pixels = written((0.3, 0.5), (0.3 + apart, 0.5))
    for box, other in ((boxes[0], second), (boxes[1], first)):
        across = max(box[0] - other[0], other[0] - box[2], 0.0)
        upwards = max(box[1] - other[1], other[1] - box[3], 0.0)
        assert max(across, upwards) >= labels.NEAR * pixels - 1.0


def test_a_single_render_has_no_caps():
    def caps(warm):
        return plots.svg(panels.panel(scene([measurement(warm=warm)]), panels.FLIP)).count('id="LineCollection')

    assert caps((0.5, 0.6)) == caps((0.5,)) + 1
