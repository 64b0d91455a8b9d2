# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare with Cycles, as a user sees it in a fresh Blender window."""

import numpy as np
import pytest

INTERRUPTED = 130
"""Exit code of a Blender that was told to stop."""

IMAGES = ["Comparison: Cycles", "Comparison: Deep G-Buffer", "Comparison: Difference"]
DIFFERENCE = IMAGES[-1]
STATUS_BAR = np.s_[780:798, 4:400]
"""Where Blender shows its status: rows, columns of the screen."""

TEXT, STATUS_TEXT = 0.55, 0.3
"""Text is brighter than this, what is behind it is not; the status bar's is gray."""


def test_the_scenario_ran_to_its_end(comparison):
    assert comparison.results.get("finished"), comparison.results.get("error", comparison.output[-3000:])
    assert "Traceback" not in comparison.output, comparison.output


def test_the_dialog_asks_first(comparison):
    before, dialog = comparison.screen("cancelled"), comparison.screen("dialog")
    changed = np.abs(before - dialog).max(axis=-1) > 0.05
    assert changed[360:500, 360:670].mean() > 0.5
    assert changed.mean() < 0.1


def test_the_status_bar_tells_how_far_it_is_while_it_runs(comparison):
    running, cancelled = comparison.screen("running")[STATUS_BAR], comparison.screen("cancelled")[STATUS_BAR]
    assert (running.max(axis=-1) > STATUS_TEXT).sum() > 200
    assert cancelled.max() < STATUS_TEXT
    assert comparison.results["second_offered"] is False


def test_escape_cancels_and_leaves_nothing(comparison):
    assert comparison.results["cancelled"] == {"folders": 0, "images": [], "processes": [INTERRUPTED]}
    assert comparison.results["unchanged_after_cancelling"]


def test_it_opens_a_window_with_the_difference_and_the_sidebar(comparison):
    found = comparison.results["compared"]
    assert found["images"] == IMAGES
    assert (found["windows"], found["shown"], found["sizes"]) == (2, [DIFFERENCE], [[384, 216]])
    assert found["sidebars"] == [True]
    assert found["viewports"] == 1  # the largest area is still what it was


@pytest.mark.parametrize("name", ["compared", "compared_again"])
def test_settings_and_files_stay_as_they_were(comparison, name):
    found = comparison.results[name]
    assert found["unchanged"]
    assert found["files"] == [""]  # never saved, and no copy among the recent ones


def test_the_next_one_takes_the_editor_that_is_open(comparison):
    found = comparison.results["compared_again"]
    assert found["images"] == IMAGES
    assert (found["windows"], found["shown"], found["sizes"]) == (2, [DIFFERENCE], [[192, 108]])
    assert found["processes"] == [INTERRUPTED, 0, 0]
    assert found["folders"] == 1


@pytest.mark.parametrize("name", ["compared", "compared_again"])
def test_the_picture_and_the_numbers_are_on_the_screen(comparison, name):
    screen = comparison.screen(name)
    picture, sidebar = screen[190:650, 400:870], screen[180:560, 975:1205]
    assert (picture.max(axis=-1) < 0.1).mean() > 0.9  # both engines agree but for noise and edges
    assert (picture.max(axis=-1) > 0.2).sum() > 300  # edges, where one Cycles sample more or less shows
    rows = (sidebar.max(axis=-1) > TEXT).any(axis=1)
    assert (np.diff(rows.astype(int)) == 1).sum() >= 14  # lines of text: 4 of the renders, 9 of the error, 3 titles


def test_the_buttons_switch_to_the_other_pictures(comparison):
    assert comparison.results["switched_to"] == ["Comparison: Cycles"]
    difference, cycles = comparison.screen("compared_again"), comparison.screen("switched")
    lit_side = np.s_[400:540, 680:800]  # of the cube, as large as before
    assert difference[lit_side].max() < 0.2
    assert cycles[lit_side].min() > 0.35


def test_undo_leaves_the_pictures_where_they_are(comparison):
    assert comparison.results["undone"]["samples"] == 4
    assert comparison.results["undone"]["images"] == IMAGES
    assert comparison.results["undone"]["shown"] == ["Comparison: Cycles"]
    before, after = comparison.screen("switched"), comparison.screen("undone")
    picture = np.s_[190:650, 400:870]
    assert np.abs(before[picture] - after[picture]).max() < 0.05


def test_in_background_it_runs_to_its_end_and_tells_how_far_it_is(background):
    assert background.results.get("done") == ["FINISHED"], background.output[-3000:]
    assert background.results["images"] == IMAGES
    assert background.results["folders"] == 1
    rows = dict(row for _, rows in background.results["tables"] for row in rows)
    assert rows["Size"] == "192 × 108"
    assert float(rows["RMSE"]) < 0.02
    assert "Compare with Cycles: 0% | Starting Blender" in background.output
    assert "Traceback" not in background.output, background.output


def test_the_numbers_are_those_of_two_engines_that_agree(comparison):
    rows = dict(row for _, rows in comparison.results["compared"]["tables"] for row in rows)
    assert rows["Size"] == "384 × 216"
    assert float(rows["RMSE"]) < 0.02
    assert float(rows["Noise of Cycles"]) > 0.0
    assert abs(float(rows["Bias, red"])) < 0.002
    assert rows["Invalid pixels"] == "0"


@pytest.mark.parametrize(("way", "count"), [("loaded", 4), ("quit", 5)])
def test_loading_a_file_or_quitting_ends_it(comparison, way, count):
    found = comparison.results[way]
    assert found.pop("images", []) == []
    assert found == {"folders": 0, "processes": [INTERRUPTED, 0, 0, INTERRUPTED, INTERRUPTED][:count]}
