# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference's own noise, from pictures whose noise is known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from addon.report.reference import REFERENCE_SETTINGS, noise_of, noise_of_mean

SHAPE = (100, 100, 3)
COUNT = math.prod(SHAPE)
DEVIATIONS = 6.0
"""Standard deviations that a mean may be off: chance exceeds them once in 5e8 times."""

FINITE = st.floats(allow_nan=False, allow_infinity=False, width=32)


def pictures(*sigmas):
    """The same random picture with independent normal noise."""
    generator = np.random.default_rng(7)
    truth = generator.random(SHAPE)
    return [(truth + sigma * generator.standard_normal(SHAPE)).astype(np.float32) for sigma in sigmas]


@pytest.mark.parametrize("sigma", [1e-3, 0.3])
def test_the_noise_of_a_mean_of_two(sigma):
    """Two of sigma have a mean of sigma / √2; a root mean square of n values is uncertain by its 1 / √(2n)."""
    even, odd = pictures(sigma, sigma)
    expected = sigma / math.sqrt(2.0)
    assert noise_of_mean(even, odd) == pytest.approx(expected, rel=DEVIATIONS / math.sqrt(2 * COUNT))


@pytest.mark.parametrize(("own", "others"), [(0.05, 0.1), (0.1, 0.05), (0.0, 0.1)])
def test_the_noise_of_a_picture_from_two_others(own, others):
    """The variance of the mean product is (a² + r²)² + r⁴ over n, for a the others' noise and r the picture's."""
    estimate = noise_of(*pictures(own, others, others))
    uncertain = DEVIATIONS * math.sqrt(((others**2 + own**2) ** 2 + own**4) / COUNT)
    assert abs(estimate**2 - own**2) <= uncertain


@given(hnp.arrays(np.float32, (3, 2, 2, 3), elements=FINITE))
def test_noise_is_a_number_of_at_least_0(stack):
    assert 0.0 <= noise_of_mean(stack[0], stack[1]) < math.inf
    assert 0.0 <= noise_of(*stack) < math.inf
    assert noise_of_mean(stack[0], stack[0]) == 0.0
    assert noise_of(stack[0], stack[0], stack[2]) == 0.0


def test_different_or_empty_pictures_are_refused():
    picture, empty = np.zeros(SHAPE, np.float32), np.zeros((0, 4, 3), np.float32)
    for first, second in ((picture, picture[1:]), (empty, empty)):
        with pytest.raises(ValueError, match="cannot be compared"):
            noise_of_mean(first, second)
        with pytest.raises(ValueError, match="cannot be compared"):
            noise_of(first, second, second)


def test_a_reference_is_neither_denoised_nor_clamped():
    assert REFERENCE_SETTINGS["use_denoising"] == REFERENCE_SETTINGS["use_adaptive_sampling"] == "False"
    assert {value for name, value in REFERENCE_SETTINGS.items() if "clamp" in name} == {"0"}
