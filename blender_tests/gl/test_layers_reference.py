# SPDX-License-Identifier: GPL-3.0-or-later
"""The deep G-buffer against a float64 ray caster: which surface is in which layer, and the minimum separation Δz."""

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from layer_checks import assert_agrees, assert_identical, assert_separated
from layer_raycast import LayerReference, raycast_layers
from random_scenes import CASES, Case, built, numbered, on_binary_grid, reordered, scaled, transformed

from addon.scene import Camera, Moment
from blender_tests import builders

SIZE = (60, 40)
few_renders = settings(
    max_examples=12, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.fixture(scope="module")
def layers_of(shared_session):
    """layers_of(scene, camera, layers, separation): every layer, from one sample at pixel centres."""

    def layers_of(scene, camera, layers, separation):
        return shared_session.show(
            scene,
            camera,
            width=SIZE[0],
            height=SIZE[1],
            layers=layers,
            minimum_separation=separation,
            deep_output=True,
        ).layers

    return layers_of


@pytest.fixture(scope="module")
def compare(layers_of, subpixel_bits):
    """compare(scene, camera, layers, separation): render, hold against the ray caster, and return what it found."""

    def compare(scene, camera, layers, separation) -> LayerReference:
        images = layers_of(scene, camera, layers, separation)
        truth = raycast_layers(scene, camera, SIZE, layers, separation, subpixel_bits=subpixel_bits)
        assert_separated(images, separation)
        assert_agrees(images, truth)
        return truth

    return compare


@few_renders
@given(CASES)
@example(Case(seed=0, layers=4, separation=0.0, orthographic=False))
@example(Case(seed=5, layers=4, separation=0.05, orthographic=True))
@example(Case(seed=3, layers=3, separation=0.5, orthographic=False))
def test_layers_equal_ray_caster(compare, subpixel_bits, case):
    truth = compare(*built(case), case.layers, case.separation)
    # Expected share: total edge length × 2δ / picture area, and 300 triangles of this size have about 6000 px of edges.
    assert truth.ambiguous.mean() < 0.015 + 5.0 * 2.0**-subpixel_bits


def test_separation_larger_than_the_scene_leaves_one_layer(layers_of):
    images = layers_of(*built(Case(seed=5, layers=3, separation=1e4, orthographic=False)), 3, 1e4)
    assert np.isfinite(images[0].depth).mean() > 0.5
    assert not np.isfinite(images[1].depth).any()
    assert not np.isfinite(images[2].depth).any()


def test_eight_layers(compare):
    truth = compare(*built(Case(seed=5, layers=8, separation=0.05, orthographic=False)), 8, 0.05)
    assert np.isfinite(truth.depth[7]).any(), "the case must reach layer 8 to mean something"


@few_renders
@given(CASES)
def test_submission_order_does_not_change_a_bit(layers_of, case):
    scene, camera = built(case)
    images = layers_of(scene, camera, case.layers, case.separation)
    other = reordered(scene, np.random.default_rng(case.seed))
    assert_identical(images, layers_of(other, camera, case.layers, case.separation))


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_million_metres_from_the_origin_looks_the_same(layers_of, orthographic):
    """Shifted by 2²⁰ m, which is exact in float64 for numbers on a grid of 2⁻²⁰ m."""
    near = on_binary_grid(Moment(*built(Case(seed=5, layers=3, separation=0.05, orthographic=orthographic))), 20)
    far = transformed(near, builders.translation(*(2.0**20 * np.array([1.0, -1.0, 0.5]))))
    images, others = (layers_of(moment.scene, moment.camera, 3, 0.05) for moment in (near, far))
    assert_identical(images, others)


@pytest.mark.parametrize("factor", [2.5e-6, 2.5e4], ids=["hundredth of a millimetre", "hundred kilometres"])
@pytest.mark.parametrize("orthographic", [False, True])
def test_tiny_and_huge_scenes(compare, factor, orthographic):
    """Scenes that are 4 m wide, made 10⁻⁵ m and 10⁵ m wide."""
    still = Moment(*built(Case(seed=3, layers=3, separation=0.5 * factor, orthographic=orthographic)))
    moment = scaled(still, factor)
    truth = compare(moment.scene, moment.camera, 3, 0.5 * factor)
    assert np.isfinite(truth.depth[1]).mean() > 0.1


def test_ray_caster_selects_greedily():
    """Walls at 1.0, 1.3, 1.6 and 3.0 m: with Δz = 0.5 m the second layer is the third wall, not the second."""
    matrices = np.tile(np.eye(4), (4, 1, 1))
    matrices[:, 2, 3] = -np.array([3.0, 1.3, 1.0, 1.6])
    scene = builders.scene(builders.quad("wall", half=9.0), batches=[numbered("wall", matrices, 1)])
    camera = Camera(np.eye(4), (-0.5, 0.5, -0.25, 0.25), 0.1, 100.0)
    truth = raycast_layers(scene, camera, (9, 5), 4, 0.5, subpixel_bits=8)
    certain = ~truth.ambiguous
    assert certain.mean() > 0.5, "only the diagonal of the walls is uncertain"
    for layer, (depth, owner) in enumerate([(1.0, 3), (1.6, 4), (3.0, 1), (np.inf, 0)]):
        np.testing.assert_allclose(truth.depth[layer][certain], depth, rtol=1e-12)
        np.testing.assert_array_equal(truth.owner[layer][certain], owner)
