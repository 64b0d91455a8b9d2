# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors of a picture: closed forms, and whatever a render can contain."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from addon.report.metrics import blackened, difference, display, errors

SHAPES = st.tuples(st.integers(1, 5), st.integers(1, 5), st.just(3))
ANYTHING = st.floats(width=32)
FINITE = st.floats(allow_nan=False, allow_infinity=False, width=32)
ROUNDING = 1e-6
"""Relative, of float32."""


@st.composite
def pairs(draw):
    """A picture with any value, and a finite reference of its size."""
    shape = draw(SHAPES)
    return tuple(draw(hnp.arrays(np.float32, shape, elements=values)) for values in (ANYTHING, FINITE))


def flat(*color, size=(4, 6)):
    return np.tile(np.array(color, np.float32), (*size, 1))


@given(pairs())
def test_whatever_the_picture_holds_the_errors_are_numbers(pair):
    picture, reference = pair
    found = errors(picture, reference)
    assert found.invalid == np.count_nonzero(~np.isfinite(picture).all(axis=-1))
    assert found.rmse >= 0.0
    assert found.relative_mse >= 0.0
    assert found.fireflies >= 0.0
    numbers = (found.rmse, found.relative_mse, found.fireflies, *found.bias)
    assert all(math.isfinite(number) for number in numbers)
    assert not math.isnan(found.psnr)
    apart = difference(picture, reference)
    assert apart.dtype == np.float32
    assert np.isfinite(apart).all()
    assert (apart >= 0.0).all()


@given(hnp.arrays(np.float32, SHAPES, elements=FINITE))
def test_equal_pictures_have_no_error(picture):
    found = errors(picture, picture)
    assert (found.rmse, found.relative_mse, found.bias, found.fireflies, found.invalid) == (0, 0, (0, 0, 0), 0, 0)
    assert found.psnr == math.inf
    assert not difference(picture, picture).any()


def test_a_constant_error_has_closed_forms():
    """Red is brighter by 0.3, green as it was, blue darker by 0.1."""
    reference, picture = flat(0.5, 0.2, 0.4), flat(0.8, 0.2, 0.3)
    found = errors(picture, reference)
    assert found.bias == pytest.approx((0.3, 0.0, -0.1), rel=ROUNDING, abs=1e-7)
    assert found.rmse == pytest.approx(math.sqrt((0.09 + 0.01) / 3.0), rel=ROUNDING)
    assert found.relative_mse == pytest.approx((0.09 / 0.26 + 0.01 / 0.17) / 3.0, rel=ROUNDING)
    assert found.fireflies == pytest.approx(0.2126 * 0.3 - 0.0722 * 0.1, rel=1e-5)
    shown = [1.055 * value ** (1.0 / 2.4) - 0.055 for value in (0.5, 0.8, 0.4, 0.3)]
    mse = ((shown[1] - shown[0]) ** 2 + (shown[3] - shown[2]) ** 2) / 3.0
    assert found.psnr == pytest.approx(-10.0 * math.log10(mse), rel=1e-5)
    np.testing.assert_allclose(difference(picture, reference), flat(0.3, 0.0, 0.1), atol=1e-7)


def test_a_darker_picture_has_no_fireflies():
    assert errors(flat(0.1, 0.1, 0.1), flat(0.5, 0.5, 0.5)).fireflies == 0.0


def test_fireflies_are_what_one_pixel_in_a_thousand_exceeds():
    """1 % of the pixels are brighter by 5; with only 0.05 % the percentile does not see them."""
    reference = np.zeros((100, 100, 3), np.float32)
    for share, expected in ((0.01, 5.0), (0.0005, 0.0)):
        picture = reference.copy()
        picture.reshape(-1, 3)[: int(10000 * share)] = 5.0
        assert errors(picture, reference).fireflies == pytest.approx(expected, rel=ROUNDING)


def test_a_pixel_that_is_not_finite_counts_as_black():
    reference, picture = flat(0.5, 0.2, 0.4), flat(0.5, 0.2, 0.4)
    black = picture.copy()
    black[1, 2] = black[3, 0] = 0.0
    picture[1, 2, 0], picture[3, 0, 2] = np.nan, np.inf
    found, expected = errors(picture, reference), errors(black, reference)
    assert (found.invalid, expected.invalid) == (2, 0)
    assert (found.rmse, found.psnr, found.bias) == (expected.rmse, expected.psnr, expected.bias)
    np.testing.assert_array_equal(difference(picture, reference), difference(black, reference))
    np.testing.assert_array_equal(blackened(picture)[0], black)


def test_radiance_of_a_million_watts_keeps_its_digits():
    """A lamp of 1e6 W in 2 million pixels: float32 sums would be off by percents or infinite."""
    shape = (1080, 1920, 3)
    found = errors(np.full(shape, 1.01e6, np.float32), np.full(shape, 1e6, np.float32))
    assert found.rmse == pytest.approx(1e4, rel=1e-9)
    assert found.bias == pytest.approx((1e4,) * 3, rel=1e-9)
    assert found.relative_mse == pytest.approx(1e-4, rel=1e-9)


@pytest.mark.parametrize(
    ("picture", "reference", "message"),
    [
        (flat(0, 0, 0), flat(0, 0, 0, size=(5, 6)), "the picture is 6×4×3 and its reference 6×5×3"),
        (np.zeros((0, 4, 3)), np.zeros((0, 4, 3)), "no RGB pixels"),
        (np.zeros((4, 4)), np.zeros((4, 4)), "no RGB pixels"),
        (flat(0, 0, 0), flat(0, np.nan, 0), "the reference has pixels that are not finite"),
    ],
)
@pytest.mark.parametrize("judge", [errors, difference])
def test_what_cannot_be_compared_is_refused(judge, picture, reference, message):
    with pytest.raises(ValueError, match=message):
        judge(picture, reference)


@given(hnp.arrays(np.float32, SHAPES, elements=ANYTHING))
def test_what_is_shown_is_from_0_to_1(picture):
    shown = display(picture)
    assert shown.dtype == np.float32
    assert (shown >= 0.0).all()
    assert (shown <= 1.0).all()


def test_the_display_curve_is_srgb():
    """Anchors of IEC 61966-2-1: black, its linear part, mid grey at 18 %, white and beyond."""
    grey = np.array([-1.0, 0.0, 0.002, 0.18, 1.0, 7.0], np.float32)
    expected = [0.0, 0.0, 12.92 * 0.002, 0.4613561, 1.0, 1.0]
    np.testing.assert_allclose(display(np.repeat(grey[:, None], 3, axis=1))[:, 1], expected, rtol=ROUNDING)
