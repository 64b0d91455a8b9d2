# SPDX-License-Identifier: GPL-3.0-or-later
"""Views that strain float32: depths, distances, sizes, angles, shapes and resolutions at their ends."""

from dataclasses import replace

import numpy as np
import pytest
from layer_checks import assert_agrees, assert_defined, assert_identical, assert_separated
from layer_raycast import ROUNDINGS, UNIT_ROUNDOFF, raycast_layers
from random_scenes import (
    ASPECT,
    Case,
    Motion,
    built,
    frames,
    fresh,
    furnished_moment,
    numbered,
    on_binary_grid,
    scaled,
    transformed,
)

from addon.scene import Camera, Moment, Sequence, Variant
from blender_tests import builders

SIZE = (32, 24)
DEEP = {"width": SIZE[0], "height": SIZE[1], "deep_output": True}
every_variant = pytest.mark.parametrize("variant", list(Variant))
projections = pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])


def shown(render, moment, **settings):
    """The layers of a moment at rest."""
    sequence = Sequence(previous=moment, earlier=moment)
    return render(moment.scene, moment.camera, sequence, **{**DEEP, **settings}).layers


def check(render, moment, variant, subpixel_bits, layers=3, separation=0.05):
    """Render a moment at rest and hold it against the ray caster, whose finding is returned."""
    images = shown(render, moment, variant=variant, layers=layers, minimum_separation=separation)
    truth = raycast_layers(*view(moment), SIZE, layers, separation, subpixel_bits=subpixel_bits)
    assert_defined(images)
    assert_separated(images, separation)
    assert_agrees(images, truth)
    return truth


def view(moment):
    """(scene, camera)."""
    return moment.scene, moment.camera


def wall_pairs(depths, gap):
    """Per depth two squares that face the camera in a column of their own, the farther one behind by a share `gap`.

    The farther ones are drawn first, so that depth alone decides.
    """
    matrices = []
    for factor in (1.0 + gap, 1.0):
        for column, depth in enumerate(depths * factor):
            half = 0.5 * depth / len(depths)
            center = depth * ((column + 0.5) / len(depths) - 0.5)
            matrices.append(builders.translation(center, 0.0, -depth) @ np.diag([half, 99.0 * half, 1.0, 1.0]))
    batches = [
        replace(numbered("wall", np.array(matrices[: len(depths)]), 1), key="a far"),
        replace(numbered("wall", np.array(matrices[len(depths) :]), 100), key="b near"),
    ]
    camera = Camera(np.eye(4), (-0.5, 0.5, -0.5, 0.5), 1e-4, 1e7)
    return Moment(builders.scene(builders.quad("wall"), batches=batches), camera)


@every_variant
def test_a_tenth_of_a_millimetre_and_ten_thousand_kilometres_in_one_view(render, subpixel_bits, variant):
    """The depth of a wall that faces the camera is off by its corners' rounding and the interpolation's, K·u each;
    surfaces that are 2⁻¹⁸ of their depth apart, four times that, are told apart."""
    gap = 2.0**-18
    depths = np.geomspace(1.5e-4, 9e6, SIZE[0] // 4)
    moment = wall_pairs(depths, gap)
    check(render, moment, variant, subpixel_bits, layers=2, separation=0.0)
    near, far = shown(render, moment, variant=variant, layers=2, minimum_separation=0.0)
    columns = np.arange(2, SIZE[0], 4)
    middle = SIZE[1] // 3
    bound = 2.0 * ROUNDINGS * UNIT_ROUNDOFF
    np.testing.assert_allclose(near.depth[middle, columns].astype(np.float64), depths, rtol=bound)
    np.testing.assert_allclose(far.depth[middle, columns].astype(np.float64), depths * (1.0 + gap), rtol=bound)
    np.testing.assert_array_equal(near.object_index[middle, columns], 100 + np.arange(len(depths)))
    np.testing.assert_array_equal(far.object_index[middle, columns], 1 + np.arange(len(depths)))


@projections
@every_variant
def test_a_million_metres_from_the_origin_nothing_changes(render, variant, orthographic):
    """Shifted by 2²⁰ m, which is exact for numbers on a grid of 2⁻¹⁰ m; in motion, by whole steps of that grid."""
    still = on_binary_grid(Moment(*built(Case(5, 3, 0.05, orthographic))), 10)
    moments = frames(still, Motion(camera=0.125, boxes=0.125, vertices=0.125), range(3))
    far_away = builders.translation(*(2.0**20 * np.array([1.0, -1.0, 0.5])))
    here, there = (
        render(
            *view(last),
            Sequence(previous=previous, earlier=earlier),
            layers=3,
            minimum_separation=0.05,
            variant=variant,
            motion_vectors=True,
            exit_surfaces=True,
            **DEEP,
        ).layers
        for earlier, previous, last in (moments, [transformed(moment, far_away) for moment in moments])
    )
    assert np.isfinite(here[1].depth).any()
    assert_identical(here, there)


@projections
@pytest.mark.parametrize("factor", [2.5e-6, 2.5e4], ids=["hundredth of a millimetre", "hundred kilometres"])
@every_variant
def test_tiny_and_huge_scenes(render, subpixel_bits, variant, factor, orthographic):
    """Scenes that are 4 m wide, made 10⁻⁵ m and 10⁵ m wide."""
    still = Moment(*built(Case(3, 3, 0.5, orthographic)))
    truth = check(render, scaled(still, factor), variant, subpixel_bits, separation=0.5 * factor)
    assert np.isfinite(truth.depth[1]).mean() > 0.1


@pytest.mark.parametrize("degrees", [0.1, 170.0])
@every_variant
def test_narrow_and_wide_fields_of_view(render, subpixel_bits, variant, degrees):
    """The narrow one from where it shows 6 m, the wide one from the middle of things."""
    half = np.tan(np.radians(degrees / 2.0))
    scene, camera = built(Case(3, 3, 0.05, False))
    distance = 3.0 / half if degrees < 1.0 else 0.0
    matrix = camera.world_from_camera.copy()
    matrix[:3, 3] = distance * matrix[:3, 2]
    camera = Camera(matrix, (-half, half, -half * ASPECT, half * ASPECT), 0.01, 1e4)
    truth = check(render, Moment(scene, camera), variant, subpixel_bits)
    assert np.isfinite(truth.depth[1]).mean() > 0.05
    assert truth.ambiguous.mean() < 0.5


@every_variant
def test_an_orthographic_camera_is_a_distant_tele_camera(render, variant):
    """Rays of a camera at 2¹³ m meet what is d behind the plane of the window at a point that is off by r·d/2¹³,
    r ≤ 20 pixels from the middle and |d| ≤ 4 m: less than 2⁻⁶ of a pixel, which both ray casts are told of."""
    scene = built(Case(3, 3, 0.5, True))[0]
    distance = 2.0**13
    window = np.array([-3.0, 3.0, -3.0 * ASPECT, 3.0 * ASPECT])
    cameras = (
        Camera(builders.translation(z=8.0), tuple(window), 1.0, 20.0, orthographic=True),
        Camera(builders.translation(z=distance), tuple(window / distance), 1.0, 1e6),
    )
    truths, views = [], []
    for camera in cameras:
        truths.append(raycast_layers(scene, camera, SIZE, 3, 0.5, subpixel_bits=6))
        views.append(shown(render, Moment(scene, camera), variant=variant, layers=3, minimum_separation=0.5))
    certain = ~(truths[0].ambiguous | truths[1].ambiguous)
    assert certain.mean() > 0.5
    for layer, (flat, tele) in enumerate(zip(*views, strict=True)):
        covered = np.isfinite(flat.depth) & certain
        assert covered.any()
        np.testing.assert_array_equal(covered, np.isfinite(tele.depth) & certain)
        np.testing.assert_array_equal(flat.object_index[covered], tele.object_index[covered])
        tolerance = (truths[0].tolerance[layer] + truths[1].tolerance[layer])[covered]
        difference = tele.depth[covered].astype(np.float64) - (distance - 8.0) - flat.depth[covered]
        assert (np.abs(difference) <= tolerance).all()


def slivers(count):
    """Thirds of a mesh: triangles of a fraction of a pixel, needles of 10⁻⁶ m width, and triangles without area."""
    generator = np.random.default_rng(7)
    corners = generator.uniform(-2.0, 2.0, (count, 1, 3)) + generator.uniform(-0.06, 0.06, (count, 3, 3))
    needles, flat = slice(count // 3, 2 * count // 3), slice(2 * count // 3, None)
    corners[needles, 1] = corners[needles, 0] + generator.uniform(-2.0, 2.0, corners[needles, 0].shape)
    corners[needles, 2] = corners[needles, 0] + generator.uniform(-1e-6, 1e-6, corners[needles, 0].shape)
    corners[flat, 2] = corners[flat, generator.integers(2)]
    points = 3 * count
    mesh = builders.mesh("slivers", corners, np.arange(points), normals=generator.normal(size=(points, 3)))
    scene = builders.scene(mesh, lights=(builders.light(),), batches=[numbered("slivers", np.eye(4)[None], 1)])
    return fresh(scene)


@every_variant
def test_a_hundred_thousand_slivers(render, variant):
    scene = slivers(100_000)
    moments = [Moment(scene, builders.camera(z=distance, half_width=0.5)) for distance in (6.0, 5.99, 5.98)]
    layers = render(
        *view(moments[2]),
        Sequence(previous=moments[1], earlier=moments[0]),
        layers=2,
        minimum_separation=0.01,
        variant=variant,
        motion_vectors=True,
        exit_surfaces=True,
        **DEEP,
    ).layers
    assert_defined(layers)
    assert np.isfinite(layers[0].depth).mean() > 0.5
    assert np.isfinite(layers[1].depth).mean() > 0.2
    for layer in layers:
        depth = layer.depth[np.isfinite(layer.depth)]
        assert depth.min() > 1.9, "everything is between 2 and 10 m away"
        assert depth.max() < 10.1


@every_variant
def test_triangles_through_the_camera_plane(render, subpixel_bits, variant):
    scene, camera = built(Case(5, 3, 0.05, False))
    matrix = camera.world_from_camera.copy()
    matrix[:3, 3] = (0.25, -0.125, 0.5)
    camera = replace(camera, world_from_camera=matrix, clip_start=1e-3, window=(-1.0, 1.0, -ASPECT, ASPECT))
    truth = check(render, Moment(scene, camera), variant, subpixel_bits)
    assert np.isfinite(truth.depth[1]).mean() > 0.2


@every_variant
def test_a_camera_inside_closed_meshes(render, variant):
    """Two boxes about the camera, seen from inside: their back faces, with normals that face the camera."""
    scene = builders.scene(builders.box("inner"), builders.box("outer", half=2.0))
    scene = replace(scene, batches=(numbered("inner", np.eye(4)[None], 1), numbered("outer", np.eye(4)[None], 2)))
    camera = Camera(builders.translation(0.125, 0.25, 0.5), (-0.25, 0.25, -0.25, 0.25), 1e-3, 100.0)
    first, second, third = shown(
        render, Moment(scene, camera), variant=variant, layers=3, minimum_separation=0.25, exit_surfaces=True
    )
    for layer, depth in ((first, 1.5), (second, 2.5)):
        np.testing.assert_allclose(layer.depth, depth, rtol=2.0 * ROUNDINGS * UNIT_ROUNDOFF)
        np.testing.assert_allclose(layer.normal, np.broadcast_to((0.0, 0.0, 1.0), layer.normal.shape), atol=1e-4)
    assert not np.isfinite(third.depth).any()


@pytest.mark.parametrize("size", [(1, 1), (1, 17), (33, 1), (31, 23)], ids=str)
@pytest.mark.parametrize("layers", [2, 8])
def test_odd_resolutions(render, session, size, layers):
    still = furnished_moment(3, False)
    moments = frames(still, Motion(camera=0.125, boxes=0.125), range(3))
    settings = {"width": size[0], "height": size[1], "deep_output": True, "layers": layers}
    expected = render(*view(still), **settings).layers
    assert expected[0].depth.shape == size[::-1]
    for variant in Variant:
        assert_identical(shown(render, still, variant=variant, **settings), expected, variant)
        for band in (0, 3):
            for played in session.play(moments, variant=variant, guard_band=band, **settings):
                assert_defined(played.layers)
                assert played.layers[0].depth.shape == size[::-1]
