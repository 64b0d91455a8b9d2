# SPDX-License-Identifier: GPL-3.0-or-later
"""Flicker: what moves as its motion vectors say does not flicker, and what changes in place does."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.report.flicker import flicker

HEIGHT, WIDTH = 60, 80
NEAR, FAR = 2.0, 5.0


def texture(seed=0, width=WIDTH):
    return np.random.default_rng(seed).random((HEIGHT, width, 3)).astype(np.float32)


def still(count, depth=FAR, motion=(0.0, 0.0)):
    """Depths and motions of a wall."""
    vectors = np.full((HEIGHT, WIDTH, 2), motion, np.float32)
    return [np.full((HEIGHT, WIDTH), depth, np.float32)] * count, [vectors] * count


def test_the_same_picture_at_rest_does_not_flicker():
    assert flicker([texture()] * 3, *still(3)) == 0.0


@pytest.mark.parametrize(("right", "up"), [(3, 0), (-2, 0), (0, 5), (0, -1), (4, -7)])
def test_a_texture_that_moves_by_whole_pixels_does_not_flicker(right, up):
    """Rows count downwards, motion upwards. Moved the other way, independent noise: √(1/6)."""
    pictures = [np.roll(texture(), (-up * frame, right * frame), axis=(0, 1)) for frame in range(3)]
    assert flicker(pictures, *still(3, motion=(right, up))) == 0.0
    assert flicker(pictures, *still(3, motion=(-right, -up))) == pytest.approx(math.sqrt(1.0 / 6.0), rel=0.1)


def test_a_gradient_that_moves_by_part_of_a_pixel_does_not_flicker():
    """Bilinear interpolation is exact on it, up to the rounding of float32."""
    columns = np.arange(WIDTH, dtype=np.float64)
    pictures = [np.tile((0.01 * (columns - 0.3 * frame))[None, :, None], (HEIGHT, 1, 3)) for frame in range(2)]
    assert flicker(pictures, *still(2, motion=(0.3, 0.0))) == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize(("fraction", "kept"), [(0.0, 1.0), (0.5, 0.5), (0.25, 0.625)])
def test_independent_noise_counts_twice_and_interpolation_smooths_one(fraction, kept):
    """Variance σ² of the picture and, of the one before, the sum of the squared weights of two texels.

    A root mean square of n values is uncertain by 1 / √(2n), by √2 more at most where neighbours share texels; six
    times that is allowed.
    """
    generator = np.random.default_rng(3)
    pictures = [0.5 + 0.02 * generator.standard_normal((HEIGHT, WIDTH, 3)) for _ in range(3)]
    expected = 0.02 * math.sqrt(1.0 + kept)
    uncertain = 6.0 / math.sqrt(2 * HEIGHT * (WIDTH - 1) * 3)
    found = flicker(pictures, *still(3, motion=(fraction, 0.0)))
    assert found == pytest.approx(expected, rel=uncertain)


def test_a_light_that_blinks_has_its_amplitude():
    pictures = [texture() + 0.25 * (frame % 2) for frame in range(4)]
    assert flicker(pictures, *still(4)) == pytest.approx(0.25, rel=1e-6)


def test_pairs_are_averaged_as_squares():
    """One change of 0.3 in three pairs."""
    pictures = [texture() + (0.3 if frame == 3 else 0.0) for frame in range(4)]
    assert flicker(pictures, *still(4)) == pytest.approx(0.3 / math.sqrt(3.0), rel=1e-6)


def square(frame, step, distance=NEAR, drift=0):
    """Picture, depth, motion of a textured square that moves right by `step` pixels a frame, the wall by `drift`."""
    picture, depth = np.roll(texture(), drift * frame, axis=1), np.full((HEIGHT, WIDTH), FAR, np.float32)
    motion = np.full((HEIGHT, WIDTH, 2), (drift, 0.0), np.float32)
    inside = np.s_[20:40, 20 + step * frame : 40 + step * frame]
    picture[inside] = texture(1)[:20, :20]
    depth[inside], motion[inside] = distance, (step, 0.0)
    return picture, depth, motion


def test_what_comes_into_view_does_not_count():
    frames = [square(frame, 4) for frame in range(3)]
    assert flicker(*zip(*frames, strict=True)) == 0.0
    pictures, _, motions = zip(*frames, strict=True)
    assert flicker(pictures, still(3)[0], motions) > 0.05, "depth is what tells"


def test_what_comes_into_view_from_just_behind_does_not_count():
    """The square is nearer by 2 % only, and its motion alone would let a wall be nearer by 40 %."""
    frames = [square(frame, 4, 0.98 * FAR, drift=-4) for frame in range(3)]
    assert flicker(*zip(*frames, strict=True)) == 0.0


def test_a_moving_thing_that_blinks_counts():
    """It covers 400 of 4800 pixels; of the wall all but the 80 that come into view are followed."""
    (first, *rest), (second, depth, motion) = square(0, 4), square(1, 4)
    second[depth == NEAR] += 0.5
    expected = 0.5 * math.sqrt(400 / (4800 - 80))
    assert flicker([first, second], [rest[0], depth], [rest[1], motion]) == pytest.approx(expected, rel=1e-6)


def approached(share):
    """Depths and motions of a wall towards whose middle the camera moves by a share of its distance, and how many
    pixels of it stay on the picture."""
    rows, columns = np.indices((HEIGHT, WIDTH))
    x, y = columns - (WIDTH - 1) / 2, (HEIGHT - 1) / 2 - rows
    motion = np.stack([x * share, y * share], axis=-1).astype(np.float32)
    depths = [np.full((HEIGHT, WIDTH), FAR * factor, np.float32) for factor in (1.0, 1.0 - share)]
    return depths, [motion, motion]


@pytest.mark.parametrize("share", [0.01, 0.1])
def test_what_comes_nearer_counts_but_about_where_the_camera_heads(share):
    """There, within a disc of an eighth of the width, it is not told from another surface."""
    depths, motions = approached(share)
    lit = texture()
    assert flicker([lit * 0.0, lit * 0.0 + 0.5], depths, motions) == pytest.approx(0.5)
    rows, columns = np.indices((HEIGHT, WIDTH))
    distance = np.hypot(columns - (WIDTH - 1) / 2, rows - (HEIGHT - 1) / 2)
    near, far = distance < 0.9 * WIDTH / 8, (distance > 1.2 * WIDTH / 8) & (distance < 2.0 * WIDTH / 8)
    for place, expected in ((near, None), (far, 0.5)):
        only = [np.where(place, depth, np.float32(np.inf)) if number else depth for number, depth in enumerate(depths)]
        assert flicker([lit * 0.0, lit * 0.0 + 0.5], only, motions) == (expected and pytest.approx(expected))


def test_a_tilted_floor_is_the_same_surface_between_texels():
    """Depth changes by 1.7 % per row and more, but only by 0.5 % may a surface come nearer that slides by 0.05 rows."""
    depth = np.tile((FAR / (1.0 + 0.1 * np.arange(HEIGHT)))[:, None], (1, WIDTH)).astype(np.float32)
    motion = np.full((HEIGHT, WIDTH, 2), (0.0, -0.05), np.float32)
    blink = [np.zeros((HEIGHT, WIDTH, 3)), np.full((HEIGHT, WIDTH, 3), 0.5)]
    assert flicker(blink, [depth, depth], [motion, motion]) == pytest.approx(0.5)


def test_where_nothing_can_be_followed_there_is_no_flicker():
    blink = [np.zeros((HEIGHT, WIDTH, 3)), np.ones((HEIGHT, WIDTH, 3))]
    assert flicker(blink, *still(2, depth=np.inf)) is None
    assert flicker(blink, *still(2, motion=(WIDTH, 0.0))) is None
    assert flicker(blink[:1], *still(1)) is None


@given(st.floats(width=32), st.floats(width=32))
def test_no_motion_vector_is_too_strange(x, y):
    found = flicker([texture()] * 2, *still(2, motion=(x, y)))
    assert found is None or 0.0 <= found <= 1.0


def test_frames_that_do_not_fit_are_refused():
    depths, motions = still(2)
    with pytest.raises(ValueError, match="one size"):
        flicker([texture(), texture()[1:]], depths, motions)
    with pytest.raises(ValueError, match="shorter"):
        flicker([texture()] * 3, depths, motions)
