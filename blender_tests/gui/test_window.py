# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user sees in a real Blender window, judged by screenshots."""

import numpy as np
import pytest

ROUNDING = 1.5 / 255.0
"""Screenshot and saved render each round to 8 bits: two roundings of half a step, and half a step of float noise."""

EDGES = 0.002
"""Share of pixels that may differ more: Blender hands the viewport its camera in single precision, which moves edges
by about 1e-4 pixels, and a pixel on an edge may fall to the other side in one sample of eight."""

FURNITURE = 48
"""Pixels along a viewport's border where Blender draws rounded corners and the arrows of folded regions."""

BLACK = 2.0 / 255.0


def differing(first, second):
    """Share of pixels of which a channel differs by more than rounding."""
    return float((np.abs(first - second).max(axis=-1) > ROUNDING).mean())


def test_the_scenario_ran_to_its_end(window):
    assert window.results.get("finished"), window.results.get("error", window.output[-3000:])
    assert "Traceback" not in window.output, window.output


def test_the_viewport_shows_the_scene(window):
    shown = window.viewport("first")
    assert shown.std() > 0.03
    assert (shown.max(axis=-1) > BLACK).mean() > 0.95


def assert_same_light(picture, other):
    """The same but for the noise of few light samples: a viewport's first one, a preview, is not among those it shows,
    and where kept shadow maps lie decides how their edges are rounded."""
    difference = np.abs(picture - other)
    assert difference.mean() < 0.01
    assert (difference.max(axis=-1) > 0.1).mean() < 0.01


@pytest.mark.parametrize("name", ["camera", "debug"])
def test_the_viewport_equals_the_final_render(window, name):
    viewport, final = window.viewport(name), window.final(name)
    assert viewport.shape == final.shape
    inside = np.s_[FURNITURE:-FURNITURE, FURNITURE:-FURNITURE]
    covered = window.coverage(name)[inside] == 1.0  # a debug view's background is transparent
    assert covered.mean() > 0.5
    assert final[inside][covered].std() > 0.05
    if name == "debug":
        assert differing(viewport[inside][covered], final[inside][covered]) <= EDGES
    else:
        assert_same_light(viewport[inside][covered], final[inside][covered])


def test_a_material_edit_shows(window):
    before, after = window.viewport("camera"), window.viewport("edited")
    reddish = (before[..., 0] > 1.5 * before[..., 1]) & (before[..., 0] > 0.2)
    assert reddish.mean() > 0.02
    assert (after[reddish][:, 1] > after[reddish][:, 0]).mean() > 0.95


def test_a_moved_object_shows(window):
    assert differing(window.viewport("edited"), window.viewport("moved")) > 0.02


@pytest.mark.parametrize("variant", ["DELAY", "PREVIOUS", "REPROJECT"])
def test_a_viewport_comes_to_rest_in_the_same_picture_with_every_variant(window, variant):
    expected = window.viewport("TWO_PASS")
    assert expected.std() > 0.03
    assert differing(expected, window.viewport("edited")) > 0.1
    assert_same_light(window.viewport(variant), expected)


def test_a_border_shows_only_its_part(window):
    whole, part = window.viewport("edited"), window.viewport("border")
    height, width = whole.shape[:2]
    inside = np.zeros((height, width), bool)
    inside[height // 4 + 2 : 3 * height // 4 - 2, width // 4 + 2 : 3 * width // 4 - 2] = True
    assert differing(whole[inside][None], part[inside][None]) <= 0.02
    outside = np.ones((height, width), bool)
    outside[height // 4 - 2 : 3 * height // 4 + 2, width // 4 - 2 : 3 * width // 4 + 2] = False
    assert part[outside].std(axis=0).max() < 0.01


def test_undo_while_rendering_comes_back_to_the_picture(window):
    assert window.results["undo"] == {"steps": 10, "z": 0.0}
    assert differing(window.viewport("edited"), window.viewport("undone")) <= EDGES


def test_escape_cancels_a_final_render(window):
    assert 0 < window.results["cancelled"]["samples"] < 100_000


def test_a_material_preview_is_rendered(window):
    preview = window.results["preview"]
    assert preview["renders"] >= 1
    red, green, blue, _alpha = preview["means"]
    assert green > 1.2 * max(red, blue)


def test_a_resized_viewport_is_never_black(window):
    shown = window.viewport("split")
    assert (shown.max(axis=-1) > BLACK).mean() > 0.95
    assert shown.std() > 0.03


def test_two_viewports_show_two_views(window):
    assert window.results["sessions of two"] == 2
    left, right = window.viewport("two", 0), window.viewport("two", 1)
    for shown in (left, right):
        assert (shown.max(axis=-1) > BLACK).mean() > 0.95
        assert shown.std() > 0.03
    width = min(left.shape[1], right.shape[1])
    assert differing(left[:, :width], right[:, :width]) > 0.1


def test_leaving_leaves_nothing_behind(window):
    assert window.results["sessions after loading"] == 0
    assert window.results["threads"] == []
