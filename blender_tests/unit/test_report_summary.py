# SPDX-License-Identifier: GPL-3.0-or-later
"""The sentences that a report begins a scene with, each only where its figures say so."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from addon.report.sweep import Point
from blender_tests.report_builders import errors, measurement, scene
from tooling.report import summary, tables


def test_the_summary_tells_who_is_best_in_a_second():
    peer = measurement(Point("Cycles, denoised", "1 spp", "CYCLES", {"use_denoising": "True"}), warm=(0.6,), flip=0.2)
    ours, slow = measurement(warm=(0.4,), flip=0.1), measurement(warm=(9.0,), flip=0.005, digest="other")
    others = (Point("Samples", "1 spp", "DEEP_GBUFFER", {}), Point("EEVEE", "1 spp", "EEVEE", {}))
    hasty = [measurement(point, warm=(0.05,), flip=0.9) for point in others]
    made = scene([*hasty, ours, slow, peer])
    first, second, third = summary.sentences(tables.rows(made, "5.2"), made)
    assert first.startswith(
        "Within 1 s the lowest FLIP is 0.100, by Deep G-Buffer (Samples: 4 spp, 0.40 s); the best of"
    )
    assert second == (
        "The fastest denoised Cycles takes 0.60 s warm, FLIP 0.200; in that time Deep G-Buffer reaches 0.100, "
        "0.50 times as much (Samples: 4 spp, 0.40 s)."
    )
    assert third.startswith("1 point has a FLIP below the reference's own noise")
    assert summary.sentences([], made) == []


def test_a_perfect_peer_has_no_ratio():
    peer = measurement(Point("Cycles, denoised", "1 spp", "CYCLES", {"use_denoising": "True"}), flip=0.0)
    made = scene([measurement(), peer])
    assert "reaches 0.100 (Samples: 4 spp" in summary.sentences(tables.rows(made, "5.2"), made)[1]


def flattening(*points, **changes):
    """What is said of our samples, measured as (samples, FLIP); errors are those of a picture that is too dark."""
    figures = errors(**{"rmse": 0.2, "bias": (-0.1, -0.1, -0.1), **changes})
    series = changes.pop("series", "Samples")
    measured = [
        measurement(Point(series, f"{count} spp", "DEEP_GBUFFER", {"samples": str(count)}), flip=flip, errors=figures)
        for count, flip in points
    ]
    made = scene(measured)
    found = [each for each in summary.sentences(tables.rows(made, "5.2"), made) if each.startswith("From ")]
    return found[0] if found else ""


@pytest.mark.parametrize(("last", "course"), [(0.574, "falls only"), (0.59, "rises"), (0.525, "falls only")])
def test_bias_is_named_where_more_samples_change_little(last, course):
    assert flattening((64, last), (1, 0.583), (4, 0.1)) == (
        f"From 1 to 64 samples Deep G-Buffer's FLIP {course} from 0.583 to {last:.3f}: a large part of what is left is "
        "bias (red −0.100, green −0.100, blue −0.100), which more samples do not remove."
    )


def test_bias_is_not_named_where_samples_help_where_it_is_small_or_where_there_is_one_point():
    assert "FLIP stays 0.583:" in flattening((1, 0.583), (4, 0.583))
    assert not flattening((1, 0.583), (64, 0.52))
    assert not flattening((1, 0.583), (64, 0.574), rmse=0.21)
    assert not flattening((1, 0.0), (64, 0.0), rmse=0.0, bias=(0.0, 0.0, 0.0))
    assert not flattening((1, math.nan), (64, math.nan))
    assert not flattening((1, 0.583))


@given(arrays.arrays(np.float64, (4, 5, 3), elements=st.floats(-10.0, 10.0)))
def test_bias_is_a_part_of_rmse(error):
    red, green, blue = error.mean(axis=(0, 1))
    figures = errors(rmse=float(np.sqrt(np.mean(error * error))), bias=(red, green, blue))
    share = summary.bias_share(tables.rows(scene([measurement(errors=figures)]), "5.2")[0])
    assert math.isnan(share) if figures.rmse == 0.0 else 0.0 <= share <= 1.0 + 1e-12


def test_a_picture_of_one_wrong_colour_has_nothing_but_bias():
    figures = errors(rmse=math.sqrt((0.09 + 0.01 + 0.04) / 3.0), bias=(-0.3, 0.1, 0.2))
    assert summary.bias_share(tables.rows(scene([measurement(errors=figures)]), "5.2")[0]) == pytest.approx(1.0)


def test_times_of_one_picture_and_equally_many_samples_are_told():
    def point(name, samples, warm, digest="same"):
        return measurement(Point("Layers", name, "DEEP_GBUFFER", {"samples": samples}), warm=warm, digest=digest)

    slow, other = point("8", "64", (9.0,)), point("9", "4", (7.0,), "other")
    same = [point("1", "4", (0.3,)), slow, point("2", "4", (0.27, 0.38, 0.4)), other, point("3", "4", ())]
    made = scene(same)
    assert summary.sentences(tables.rows(made, "5.2"), made)[-1] == (
        "3 of 5 points are bit for bit the picture of another. 2 points with one picture and equally many samples took "
        "0.30 to 0.38 s: differences in time as small as that say little about settings."
    )
    made = scene([same[0], slow])
    assert summary.sentences(tables.rows(made, "5.2"), made)[-1] == (
        "1 of 2 point is bit for bit the picture of another."
    )
