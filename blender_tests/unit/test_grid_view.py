# SPDX-License-Identifier: GPL-3.0-or-later
"""How large cells are that a view gets, and how long a viewport keeps them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from addon.render.grid import view as grid_view
from addon.render.grid.levels import expected_faces
from addon.render.grid.view import GridFitting
from addon.scene import IndirectMethod, IndirectSettings, RenderSettings
from blender_tests import builders

GRID = IndirectSettings(IndirectMethod.MARCH_GRID)


@pytest.fixture(name="cell")
def cell_fixture(monkeypatch):
    """cell(fitting, side, indirect, continuous=True): what a view of so much (m) gets of a scene of 20 m."""
    scene = builders.scene(builders.box("box", half=10.0))

    def cell(fitting, side, indirect=GRID, *, continuous=True):
        seen = np.array([[0.0] * 3, [side] * 3])
        monkeypatch.setattr(grid_view, "_seen_box", lambda _frame: seen)
        settings = RenderSettings(64, 64, indirect=indirect)
        return fitting.fit(SimpleNamespace(scene=scene, settings=settings, continuous=continuous)).cell

    return cell


def test_a_viewport_keeps_cells_that_nearly_fit(cell):
    fitting = GridFitting()
    first = cell(fitting, 20.0)
    assert cell(fitting, 16.0) == first
    assert cell(fitting, 16.0, continuous=False) < first


def test_a_viewport_changes_cells_that_no_longer_fit(cell):
    fitting = GridFitting()
    first = cell(fitting, 20.0)
    assert cell(fitting, 9.0) < 0.7 * first


@pytest.mark.parametrize("changes", [{"cells": 80}, {"cells": 50}, {"cell_size": 0.3}])
def test_other_settings_are_other_cells_at_once(cell, changes):
    fitting, indirect = GridFitting(), replace(GRID, **changes)
    first = cell(fitting, 20.0)
    other = cell(fitting, 20.0, indirect)
    assert other != first
    assert other == cell(GridFitting(), 20.0, indirect)


def test_less_memory_makes_cells_larger(cell):
    few = replace(GRID, grid_memory=1)
    assert cell(GridFitting(), 20.0, few) > cell(GridFitting(), 20.0)
    assert cell(GridFitting(), 20.0, replace(few, cell_size=0.05)) > 0.05


@pytest.mark.parametrize("scale", [(1, 1, 1), (100, 100, 1), (5, 5, 0), (3, 1, 7), (-2, 2, 2)])
def test_surface_is_what_instances_have(scale):
    """Of a box, whose sides face along the axes, exactly; turned, too."""
    x, y, z = np.abs(scale)
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    matrix = np.eye(4)
    matrix[:3, :3] = turn @ np.diag(scale)
    shares = grid_view._areas_across(builders.box("box", half=0.5))
    area = grid_view._placed_areas(shares, matrix[None])[0]
    assert area == pytest.approx(2.0 * (x * y + y * z + z * x))


def test_a_box_has_as_many_faces_as_expected():
    """24 m² of surface in cells of 0.1 m: 2.2 a cell."""
    fitting = GridFitting()
    boxes, areas = fitting._surface(builders.scene(builders.box("box", half=1.0)))
    level = grid_view.grid_levels(boxes[0], np.zeros(3), 0.1, 64, 1 << 24)[0]
    assert expected_faces([level], boxes, areas) == pytest.approx(2.2 * 2400)
