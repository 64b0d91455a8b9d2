# SPDX-License-Identifier: GPL-3.0-or-later
"""The guard band: what is rendered around the picture changes nothing in it but what reads beyond its edge."""

from dataclasses import replace

import numpy as np
import pytest
from layer_checks import assert_agrees, assert_defined, assert_identical
from layer_raycast import raycast_layers
from random_scenes import Case, built, furnished_moment, rotation

from addon.scene import Channel, Moment, Sequence, Variant

SIDE = 32
DEEP = {"width": SIDE, "height": SIDE, "deep_output": True, "motion_vectors": True, "exit_surfaces": True}
BAND = 16
# Rounding of depths is far below this share of them, differences between surfaces that are seen apart far above.
ANOTHER_SURFACE = 2.0**-12


def assert_same_picture(view, other):
    """The same bits in all layers and in the film."""
    assert_identical(view.layers, other.layers)
    assert view.channels.keys() == other.channels.keys()
    for channel, image in view.channels.items():
        np.testing.assert_array_equal(image, other.channels[channel], channel)


@pytest.mark.parametrize("variant", [variant for variant in Variant if variant is not Variant.REPROJECT])
def test_no_band_is_built_where_nothing_reads_it(render, variant):
    still = furnished_moment(3, False)
    sequence = Sequence(previous=still, earlier=still)
    settings = {**DEEP, "layers": 3, "variant": variant, "samples": 2, "filter_radius": 1.5}
    without = render(still.scene, still.camera, sequence, **settings)
    with_band = render(still.scene, still.camera, sequence, guard_band=7, **settings)
    assert_same_picture(with_band, without)
    assert with_band.statistics.bytes == without.statistics.bytes
    (reason,) = (left.reason for left in with_band.plan.left_out if left.name == "guard band")
    assert reason
    assert not any(left.name == "guard band" for left in without.plan.left_out), "nobody asked for one"


def test_no_band_is_built_for_one_layer(render):
    still = furnished_moment(3, False)
    view = render(
        still.scene, still.camera, Sequence(previous=still), layers=1, variant=Variant.REPROJECT, guard_band=7, **DEEP
    )
    assert any(left.name == "guard band" for left in view.plan.left_out)
    assert_same_picture(view, render(still.scene, still.camera, layers=1, **DEEP))


@pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("band", [1, 16, 40])
def test_the_picture_is_the_same_inside_a_band(session, subpixel_bits, band, orthographic):
    """Another size of the target is another rounding of interpolated depths, so this holds as far as rounding goes."""
    still = Moment(*built(Case(5, 3, 0.05, orthographic)))
    truth = raycast_layers(still.scene, still.camera, (SIDE, SIDE), 3, 0.05, subpixel_bits=subpixel_bits)
    settings = {**DEEP, "layers": 3, "minimum_separation": 0.05, "variant": Variant.REPROJECT, "guard_band": band}
    final = session.show(still.scene, still.camera, Sequence(previous=still), **settings)
    assert not any(left.name == "guard band" for left in final.plan.left_out)
    for view in (final, *session.play([still] * 3, **settings)):
        assert_agrees(view.layers, truth)
        assert_defined(view.layers)


@pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])
def test_the_film_is_the_same_inside_a_band(session, orthographic):
    """All samples, each film image: equal but for the pixels where rounding decides, at most one in a hundred.

    Without shadows: their maps are fitted to all that is seen, what is in the band as well, and so are their edges.
    """
    still = furnished_moment(3, orthographic)
    lights = tuple(replace(light, casts_shadow=False) for light in still.scene.lights)
    still = Moment(replace(still.scene, lights=lights), still.camera)
    settings = {**DEEP, "layers": 2, "samples": 3, "filter_radius": 1.5, "channels": tuple(Channel)}
    settings |= {"variant": Variant.REPROJECT}
    without, within = (
        session.show(still.scene, still.camera, Sequence(previous=still), guard_band=band, **settings).channels
        for band in (0, BAND)
    )
    for channel, image in without.items():
        assert within[channel].shape == image.shape
        same = np.isclose(within[channel], image, rtol=1e-3, atol=1e-3).all(axis=-1)
        assert same.mean() >= 0.99, channel


def test_the_band_is_counted_in_bytes(render):
    still = furnished_moment(3, False)
    settings = {**DEEP, "layers": 2, "variant": Variant.REPROJECT}
    sizes = [
        render(still.scene, still.camera, Sequence(previous=still), guard_band=band, **settings).statistics.bytes
        for band in (0, BAND)
    ]
    assert sizes[1]["gbuffer.view_depth"] == 4 * sizes[0]["gbuffer.view_depth"]
    assert sizes[1]["film.combined"] == sizes[0]["film.combined"]


def panned(still, pixels):
    """The moment before a pan that brings `pixels` columns into the picture from the right."""
    left, right, _, _ = still.camera.window
    angle = pixels * (right - left) / SIDE
    matrix = still.camera.world_from_camera.copy()
    matrix[:3, :3] = rotation(matrix[:3, 1], angle) @ matrix[:3, :3]
    return Moment(still.scene, replace(still.camera, world_from_camera=matrix))


@pytest.mark.parametrize("continuous", [False, True], ids=["final", "viewport"])
def test_in_a_pan_the_border_is_as_good_as_the_middle(session, continuous):
    """Share of pixels of layer 1 that show another surface than Two-pass: in columns that were out of view a frame ago.

    With the band it must not be above that of the rest by more than three deviations of a count of so many pixels.
    """
    fresh = 4
    wrong = {band: np.zeros((SIDE, SIDE)) for band in (0, BAND)}
    seeds = range(3, 11)
    for seed in seeds:
        now = furnished_moment(seed, False)
        before = panned(now, fresh)
        settings = {"width": SIDE, "height": SIDE, "deep_output": True, "layers": 2, "minimum_separation": 0.05}
        expected = session.show(now.scene, now.camera, **settings).layers
        for band in wrong:
            reprojected = {**settings, "variant": Variant.REPROJECT, "guard_band": band}
            if continuous:
                view = session.play([before, now], **reprojected)[-1]
            else:
                view = session.show(now.scene, now.camera, Sequence(previous=before), **reprojected)
            wrong[band] += ~np.isclose(view.layers[1].depth, expected[1].depth, rtol=ANOTHER_SURFACE)
    border, inside = wrong[BAND][:, -fresh:], wrong[BAND][:, :-fresh]
    share = inside.mean() / len(seeds)
    deviation = np.sqrt(share * (1.0 - share) / (border.size * len(seeds)))
    assert border.mean() / len(seeds) <= share + 3.0 * deviation
    assert wrong[0][:, -fresh:].mean() > border.mean(), "without the band the border must be worse, or it is no use"
