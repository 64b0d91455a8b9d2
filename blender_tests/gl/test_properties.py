# SPDX-License-Identifier: GPL-3.0-or-later
"""What holds of the layers of every scene, whichever variant generates them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from layer_checks import assert_defined, assert_identical, assert_separated
from random_scenes import CASES, Motion, built, frames, fresh, numbered, reordered, rotation

from addon.scene import Camera, Channel, DebugView, Moment, Sequence, SlotRange, Variant
from blender_tests import builders

SIZE = {"width": 48, "height": 32, "deep_output": True}
MOVING = Motion(camera=0.125, turn=0.03125, boxes=0.125, spin=0.125, vertices=0.125)
EXACT = st.sampled_from([Variant.TWO_PASS, Variant.PREPASS, Variant.DELAY])
VARIANTS = st.sampled_from(list(Variant))
SEEDS = st.integers(0, 2**32 - 1)
every_variant = pytest.mark.parametrize("variant", list(Variant))
few_renders = settings(
    max_examples=20, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def moving(case):
    """A case's scene on its way: (the last moment, the sequence that leads there)."""
    earlier, previous, now = frames(Moment(*built(case)), MOVING, range(3), seed=case.seed)
    return now, Sequence(previous=previous, earlier=earlier)


@few_renders
@given(CASES, EXACT, st.booleans())
def test_layers_are_apart_by_the_separation(shared_session, case, variant, relative):
    moment, sequence = moving(case)
    layers = shared_session.show(
        moment.scene,
        moment.camera,
        sequence,
        layers=4,
        minimum_separation=case.separation,
        relative_separation=relative,
        variant=variant,
        **SIZE,
    ).layers
    assert_defined(layers)
    assert_separated(layers, case.separation, relative=relative)


def test_relative_separation_is_a_share_of_the_nearer_depth(render):
    """Walls at 4, 4.4, 5.2 and 16 m: 20 % behind 4 m begins after 4.8 m, where 0.2 m would begin after 4.2 m."""
    walls = [builders.quad(f"{depth}", z=-depth, half=99.0) for depth in (4.0, 4.4, 5.2, 16.0)]
    camera = Camera(np.eye(4), (-0.5, 0.5, -0.5, 0.5), 0.1, 100.0)
    for variant in Variant:
        layers = render(
            builders.scene(*walls),
            camera,
            layers=3,
            minimum_separation=0.2,
            relative_separation=True,
            variant=variant,
            **SIZE,
        ).layers
        np.testing.assert_allclose([layer.depth[16, 20] for layer in layers], [4.0, 5.2, 16.0], rtol=1e-6)


@few_renders
@given(CASES, VARIANTS, SEEDS)
def test_submission_order_does_not_change_a_bit(shared_session, case, variant, seed):
    moment, sequence = moving(case)
    settings = {**SIZE, "layers": case.layers, "minimum_separation": case.separation, "variant": variant}

    def in_another_order(moment):
        return replace(moment, scene=reordered(moment.scene, np.random.default_rng(seed)))

    other = in_another_order(moment)
    shuffled = Sequence(previous=in_another_order(sequence.previous), earlier=in_another_order(sequence.earlier))
    assert_identical(
        shared_session.show(moment.scene, moment.camera, sequence, **settings).layers,
        shared_session.show(other.scene, other.camera, shuffled, **settings).layers,
    )


@few_renders
@given(CASES, VARIANTS)
def test_layers_do_not_depend_on_how_many_are_built(shared_session, case, variant):
    moment, sequence = moving(case)
    settings = {**SIZE, "minimum_separation": case.separation, "variant": variant}
    fewer, more = (
        shared_session.show(moment.scene, moment.camera, sequence, layers=layers, **settings).layers
        for layers in (case.layers, case.layers + 1)
    )
    assert_identical(fewer, more[: case.layers])


@few_renders
@given(CASES, VARIANTS, st.booleans(), st.sampled_from([1e30, 3.4e38]))
def test_an_infinite_separation_leaves_one_layer(shared_session, case, variant, relative, separation):
    moment, sequence = moving(case)
    layers = shared_session.show(
        moment.scene,
        moment.camera,
        sequence,
        layers=3,
        minimum_separation=separation,
        relative_separation=relative,
        variant=variant,
        **SIZE,
    ).layers
    assert np.isfinite(layers[0].depth).any()
    assert not np.isfinite(layers[1].depth).any()
    assert not np.isfinite(layers[2].depth).any()


def tilted_plane(azimuth, orthographic):
    """A 60 m wide plane whose normal is 89.9° from the view direction, 10 m away in the middle of the picture.

    In perspective the picture reaches over the plane's horizon, 1/tan(89.9°) from the middle.
    """
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(np.array([np.cos(azimuth), np.sin(azimuth), 0.0]), np.radians(89.9))
    matrix[2, 3] = -10.0
    scene = fresh(builders.scene(builders.quad("plane", half=30.0), batches=[numbered("plane", matrix[None], 1)]))
    half = 0.005 if orthographic else 0.0025
    return Moment(scene, Camera(np.eye(4), (-half, half, -half * 2 / 3, half * 2 / 3), 0.1, 2000.0, orthographic))


def assert_empty_second_layer(view):
    """In sample 0, and through the film, which shows the second layer, in all others."""
    assert np.isfinite(view.layers[0].depth).mean() > 0.4, "the plane must be in the picture"
    rows, columns = np.nonzero(np.isfinite(view.layers[1].depth))
    assert not len(rows), f"{len(rows)} pixels in layer 1, at (row, column) {(rows[0], columns[0])}"
    np.testing.assert_array_equal(view.channels[Channel.COMBINED][..., :3], 0.0)


GRAZING = {
    **SIZE,
    "layers": 2,
    "minimum_separation": 0.0,
    "debug_view": DebugView.NORMAL,
    "debug_layer": 1,
    "samples": 3,
    "filter_radius": 1.5,
}


@pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])
@every_variant
def test_a_grazing_plane_does_not_peel_itself(session, variant, orthographic):
    for azimuth in np.linspace(0.0, 2.0 * np.pi, 7):
        plane = tilted_plane(azimuth, orthographic)
        still = Sequence(previous=plane, earlier=plane)
        assert_empty_second_layer(session.show(plane.scene, plane.camera, still, variant=variant, **GRAZING))
        for view in session.play([plane] * 3, variant=variant, **GRAZING):
            assert_empty_second_layer(view)


def nudged(camera, sideways, turned):
    """The camera moved by parts of a pixel (of what is 10 m away), and turned by parts of a pixel."""
    unit = (camera.window[1] - camera.window[0]) / SIZE["width"]
    matrix = camera.world_from_camera.copy()
    angle = np.array([-turned[1], turned[0], 0.0]) * unit / (10.0 if camera.orthographic else 1.0)
    if np.any(angle):
        matrix[:3, :3] = rotation(angle, float(np.linalg.norm(angle))) @ matrix[:3, :3]
    matrix[:2, 3] += np.array(sideways) * unit * (1.0 if camera.orthographic else 10.0)
    return replace(camera, world_from_camera=matrix)


# Parts of a pixel, at most half of one, and of any size below.
fractions = st.tuples(*2 * [st.builds(lambda step, size: step * 2.0**-size, st.integers(-16, 16), st.integers(5, 30))])


@few_renders
@given(
    st.sampled_from([Variant.REPROJECT, Variant.PREVIOUS]),
    st.floats(0.0, 2.0 * np.pi),
    st.booleans(),
    fractions,
    fractions,
    st.booleans(),
)
def test_a_grazing_plane_does_not_peel_itself_under_a_sub_pixel_camera_move(
    shared_session, variant, azimuth, orthographic, sideways, turned, continuous
):
    plane = tilted_plane(azimuth, orthographic)
    before = Moment(plane.scene, nudged(plane.camera, sideways, turned))
    if continuous:
        view = shared_session.play([before, plane], variant=variant, **GRAZING)[-1]
    else:
        sequence = Sequence(previous=before, earlier=before)
        view = shared_session.show(plane.scene, plane.camera, sequence, variant=variant, **GRAZING)
    assert_empty_second_layer(view)


RED = builders.material("red", base_color=(1.0, 0.0, 0.0))
GREEN = builders.material("green", base_color=(0.0, 1.0, 0.0))
# Seen aslant, so that the depths are no round numbers.
ASLANT = np.block([[rotation(np.array([1.0, 2.0, 0.5]), 0.7), np.zeros((3, 1))], [np.zeros((1, 3)), 1.0]])


def in_two_meshes(generator):
    """Two quads at the same place, in two meshes of different materials, submitted in either order."""
    batches = [
        replace(builders.batch(key, [ASLANT], (color,), object_index=index), ids=np.int64([index]))
        for key, color, index in (("a", "red", 1), ("b", "green", 2))
    ]
    ordered = [batches[index] for index in generator.permutation(2)]
    return builders.scene(builders.quad("a"), builders.quad("b"), materials=(RED, GREEN), batches=ordered)


def in_one_mesh(generator):
    """Two quads at the same place in two slots of one mesh; the triangles of each in any order."""
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    triangles = [generator.permutation([(0, 1, 2), (0, 2, 3)]) + first for first in (0, 4)]
    mesh = builders.mesh("both", 2 * corners, triangles, slots=(SlotRange(0, 0, 2), SlotRange(1, 2, 2)))
    batches = [builders.batch("both", [ASLANT], ("red", "green"), object_index=1)]
    return builders.scene(mesh, materials=(RED, GREEN), batches=batches)


def in_one_batch(generator):
    """Five instances at the same place with different pass indices, submitted in any order."""
    batch = numbered("quad", np.tile(ASLANT, (5, 1, 1)), 1, "red")
    order = generator.permutation(5)
    batch = replace(batch, object_index=batch.object_index[order], ids=batch.ids[order])
    return builders.scene(builders.quad("quad"), materials=(RED,), batches=[batch])


@pytest.mark.parametrize("place", [in_two_meshes, in_one_mesh, in_one_batch])
@every_variant
def test_coincident_surfaces_are_resolved_the_same_way_in_any_order(render, variant, place):
    camera = builders.camera()
    expected = None
    for seed in range(6):
        scene = place(np.random.default_rng(seed))
        still = Moment(scene, camera)
        layers = render(
            scene,
            camera,
            Sequence(previous=still, earlier=still),
            layers=2,
            minimum_separation=0.0,
            variant=variant,
            **SIZE,
        ).layers
        expected = expected or layers
        assert_identical(layers, expected, f"order {seed}")
    covered = np.isfinite(expected[0].depth)
    assert covered.any()
    assert not np.isfinite(expected[1].depth).any(), "equal depth is not behind"
    assert len(np.unique(expected[0].object_index[covered])) == 1, "one surface wins everywhere"
    assert len(np.unique(expected[0].albedo[covered], axis=0)) == 1, "one surface wins everywhere"
