# SPDX-License-Identifier: GPL-3.0-or-later
"""Every way to generate the deep G-buffer against sequential peeling, which defines it: at rest and in motion."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from layer_checks import assert_agrees, assert_defined, assert_identical, differing
from layer_raycast import raycast_layers
from random_scenes import Case, Motion, built, frames, furnished_moment, numbered

from addon.scene import Camera, Channel, DebugView, Layering, Moment, Sequence, SlotRange, Variant
from addon.scene.versions import new_version
from blender_tests import builders

SIZE = {"width": 48, "height": 32}
# Things are about 6 m away and a pixel is there about 0.15 m wide: a pixel and a few degrees per frame.
MOVING = Motion(camera=0.125, turn=0.03125, boxes=0.125, spin=0.125, vertices=0.125)
VIEWPORT = Sequence(continuous=True)
"""Which a viewport shows with its first sample is a preview of the light, and not counted once there is another."""

SINGLE_PASS = [variant for variant in Variant if variant is not Variant.TWO_PASS]
EXACT = [Variant.PREPASS, Variant.DELAY]
HISTORY = [Variant.PREVIOUS, Variant.PREDICT, Variant.REPROJECT]


def arguments(layers, separation, samples=1):
    """Settings under which the film shows a deep layer, so that its mean tells of that one in every sample."""
    return {
        **SIZE,
        "layers": layers,
        "minimum_separation": separation,
        "deep_output": True,
        "samples": samples,
        "filter_radius": 1.5,
        "debug_view": DebugView.DIRECT,
        "debug_layer": min(layers, 4) - 1,
    }


def assert_same_view(view, other, message=""):
    """The same bits in all layers of sample 0 and in the film over all samples."""
    assert_identical(view.layers, other.layers, message)
    for channel, image in view.channels.items():
        np.testing.assert_array_equal(image, other.channels[channel], f"{message} {channel}")


def final(moments):
    """The sequence of a final render of the last of some moments."""
    previous, earlier = moments[-2], moments[-3]
    return Sequence(previous=previous, earlier=earlier)


@pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("separation", [0.0, 0.05, 0.5])
@pytest.mark.parametrize("layers", [2, 4, 8])
def test_all_variants_equal_two_pass_at_rest(render, session, layerings, layers, separation, orthographic):
    still = furnished_moment(3, orthographic)
    for layering in layerings:
        settings = {**arguments(layers, separation, samples=3), "layering": layering}
        expected = render(still.scene, still.camera, **settings)
        shown = render(still.scene, still.camera, VIEWPORT, **settings)
        assert np.isfinite(expected.layers[1].depth).mean() > 0.2, "layer 1 must hold something to compare"
        assert expected.channels[Channel.COMBINED][..., :3].any()
        for variant in SINGLE_PASS:
            rest = Sequence(previous=still, earlier=still)
            view = session.show(still.scene, still.camera, rest, variant=variant, **settings)
            assert_same_view(view, expected, f"final {variant} {layering}")
            for view in session.play([still] * 3, variant=variant, **settings)[1:]:
                assert_same_view(view, shown, f"viewport {variant} {layering}")


def test_the_layering_that_the_device_chooses_rounds_as_two_pass_does(render, layerings):
    """Which one is faster must not be seen; a driver with one way only has nothing to choose."""
    still = furnished_moment(3, False)
    settings = {**arguments(2, 0.05), "layering": Layering.FASTEST}
    expected = render(still.scene, still.camera, **settings)
    for variant in SINGLE_PASS if len(layerings) > 1 else ():
        assert_same_view(render(still.scene, still.camera, variant=variant, **settings), expected, variant)


@pytest.mark.parametrize("continuous", [False, True], ids=["final", "viewport"])
@pytest.mark.parametrize("variant", SINGLE_PASS)
def test_equal_data_in_other_objects_is_at_rest_too(render, session, variant, continuous):
    """As after an update that changed nothing of what there is to see."""
    still = furnished_moment(3, False)
    moments = [Moment(replace(still.scene), replace(still.camera)) for _ in range(3)]
    settings = arguments(4, 0.05, samples=3)
    expected = render(still.scene, still.camera, VIEWPORT if continuous else None, **settings)
    if continuous:
        view = session.play(moments, variant=variant, **settings)[-1]
    else:
        view = session.show(moments[-1].scene, moments[-1].camera, final(moments), variant=variant, **settings)
    assert_same_view(view, expected)


@pytest.mark.parametrize("variant", SINGLE_PASS)
def test_without_history_every_variant_equals_two_pass(render, variant):
    still = furnished_moment(3, False)
    settings = arguments(4, 0.05, samples=2)
    expected = render(still.scene, still.camera, **settings)
    assert_same_view(render(still.scene, still.camera, variant=variant, **settings), expected, "no sequence")
    shown = render(still.scene, still.camera, VIEWPORT, **settings)
    assert_same_view(render(still.scene, still.camera, VIEWPORT, variant=variant, **settings), shown, "first view")


@pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("variant", EXACT)
def test_exact_variants_equal_two_pass_in_motion(render, session, variant, orthographic):
    moments = frames(furnished_moment(3, orthographic), MOVING, range(4))
    settings = arguments(4, 0.05, samples=2)
    expected = [render(moment.scene, moment.camera, VIEWPORT, **settings) for moment in moments]
    assert differing(expected[0].layers, expected[1].layers, layer=0).mean() > 0.2, "things must move"
    for at, view in enumerate(session.play(moments, variant=variant, **settings)):
        assert_same_view(view, expected[at], f"view {at}")
    last = session.show(moments[-1].scene, moments[-1].camera, final(moments), variant=variant, **settings)
    assert_same_view(last, render(moments[-1].scene, moments[-1].camera, **settings), "final")


def test_delay_lags_by_one_picture_and_is_exact(render, session):
    """The way a viewport uses Delay: when a view arrives, the one before is drawn with it as what follows."""
    moments = frames(furnished_moment(3, False), MOVING, range(4))
    settings = arguments(2, 0.05)
    for before, now in pairwise(moments):
        delayed = Sequence(previous=before, following=now, continuous=True)
        for moment, sequence in ((before, delayed), (now, Sequence(previous=before, continuous=True))):
            view = session.show(moment.scene, moment.camera, sequence, variant=Variant.DELAY, **settings)
            assert_same_view(view, render(moment.scene, moment.camera, **settings))


KINDS = {
    "camera": Motion(camera=0.125),
    "turn": Motion(turn=0.03125),
    "boxes": Motion(boxes=0.125),
    "spin": Motion(spin=0.125),
    "vertices": Motion(vertices=0.125),
}


def wrong_pixels(session, moments, settings, variant, *, continuous):
    """How many pixels of layer 1 of the last moment differ from Two-pass; layer 0 must not."""
    last = moments[-1]
    expected = session.show(last.scene, last.camera, VIEWPORT if continuous else None, **settings)
    if continuous:
        view = session.play(moments, variant=variant, **settings)[-1]
    else:
        view = session.show(last.scene, last.camera, final(moments), variant=variant, **settings)
    assert_identical(view.layers[:1], expected.layers[:1], "layer 0 has no oracle:")
    return int(differing(view.layers, expected.layers).sum())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("continuous", [False, True], ids=["final", "viewport"])
@pytest.mark.parametrize("variant", HISTORY)
def test_error_falls_to_zero_as_motion_does(session, variant, continuous, kind):
    """From a pixel a frame downwards, and accelerating, so that the last step does not foretell the next.

    A pixel is wrong where an edge or a threshold passed over it between the oracle and the frame. Most such passings
    end as the motion shrinks, but two that cancelled out may cease to: the count may rise by no more than chance
    allows, three deviations of a Poisson count. Reprojection looks up to half a pixel aside however slow the motion
    is, if it is not slower than that.
    """
    settings = arguments(2, 0.25)
    counts = [
        wrong_pixels(
            session,
            frames(furnished_moment(5, False), KINDS[kind] * 2.0**-exponent, (0.0, 1.0, 2.5)),
            settings,
            variant,
            continuous=continuous,
        )
        for exponent in (1, 3, 5, 7, 9, 40)
    ]
    assert counts[0] > 10, "a motion of a pixel must be visible in a layer that was found with old depths"
    for larger, smaller in pairwise(counts):
        assert smaller <= larger + 3.0 * np.sqrt(larger), counts
    assert counts[-1] == 0, counts


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("variant", HISTORY)
def test_a_view_that_rested_leaves_history_as_good_as_one_that_did_not(session, variant, samples):
    """After several samples, the last of which was seen through a jitter of its own, hardly anything moves."""
    moments = frames(furnished_moment(5, False), MOVING * 2.0**-40, range(3))
    settings = {**arguments(2, 0.25), "samples": samples}
    assert wrong_pixels(session, moments, settings, variant, continuous=True) == 0


@pytest.mark.parametrize("continuous", [False, True], ids=["final", "viewport"])
@pytest.mark.parametrize("separation", [0.0, 0.25])
def test_predict_is_exact_for_linear_motion(session, separation, continuous):
    """Camera, instances and vertices move by equal steps of a binary size, for which float arithmetic is exact."""
    moments = frames(furnished_moment(5, False), Motion(camera=0.125, boxes=0.125, vertices=0.0625), range(4))
    settings = arguments(3, separation)
    assert wrong_pixels(session, moments, settings, Variant.PREDICT, continuous=continuous) == 0
    assert wrong_pixels(session, moments, settings, Variant.PREVIOUS, continuous=continuous) > 0


@pytest.mark.parametrize("continuous", [False, True], ids=["final", "viewport"])
def test_prediction_errs_less_than_the_last_frame(session, continuous):
    """Of a step that is half as long again as the one before, Predict misses a third; Previous misses all of it."""
    settings = arguments(2, 0.25)
    moments = frames(furnished_moment(5, False), MOVING * 0.5, (0.0, 1.0, 2.5))
    predict, previous = (
        wrong_pixels(session, moments, settings, variant, continuous=continuous)
        for variant in (Variant.PREDICT, Variant.PREVIOUS)
    )
    assert 0 < predict < previous


@pytest.mark.parametrize("continuous", [False, True], ids=["final", "viewport"])
def test_reprojection_is_exact_where_the_past_saw_the_same(session, subpixel_bits, continuous):
    """An orthographic camera that moves by whole pixels, and far along its axis, saw the same a frame before.

    What it did not see lies in the guard band. The reference is told of 2 more bits of doubt than it has of itself,
    for an oracle may allow for the snapping of two frames.
    """
    scene = built(Case(5, 3, 0.25, True))[0]
    size = (32, 16)
    now = Camera(builders.translation(z=8.0), (-4.0, 4.0, -2.0, 2.0), 1.0, 30.0, orthographic=True)
    before = replace(now, world_from_camera=builders.translation(0.5, -0.25, 8.75))
    moments = [Moment(scene, before), Moment(scene, now)]
    settings = {"width": size[0], "height": size[1], "layers": 3, "minimum_separation": 0.25, "deep_output": True}
    settings |= {"variant": Variant.REPROJECT, "guard_band": 4}
    if continuous:
        view = session.play(moments, **settings)[-1]
    else:
        view = session.show(scene, now, Sequence(previous=moments[0]), **settings)
    truth = raycast_layers(scene, now, size, 3, 0.25, subpixel_bits=subpixel_bits - 2)
    assert np.isfinite(truth.depth[1][~truth.ambiguous]).sum() > 30
    assert_agrees(view.layers, truth)


def population(seed, *, quads, triangles, pierced=False):
    """Quads that come and go, a mesh whose topology changes, a material that becomes transparent in places."""
    generator = np.random.default_rng(seed)
    still = furnished_moment(5, False)
    matrices = np.tile(np.eye(4), (quads, 1, 1))
    matrices[:, :3, 3] = generator.uniform(-2.0, 2.0, (quads, 3))
    soup = builders.mesh(
        "soup 1",
        generator.uniform(-2.0, 2.0, (3 * triangles, 3)),
        np.arange(3 * triangles),
        normals=np.zeros((3 * triangles, 3)),
        slots=(SlotRange(0, 0, triangles),),
    )
    scene = still.scene
    meshes = {**scene.meshes, "guest": builders.quad("guest"), "soup 1": replace(soup, version=new_version())}
    guests = replace(numbered("guest", matrices, 3000, "leaf" if pierced else "white"), version=new_version())
    batches = (*scene.batches, guests) if quads else scene.batches
    return Moment(replace(scene, meshes=meshes, batches=batches), still.camera)


@pytest.mark.parametrize("continuous", [False, True], ids=["final", "viewport"])
@pytest.mark.parametrize("variant", SINGLE_PASS)
def test_what_spawns_vanishes_or_changes_is_defined(render, session, variant, continuous):
    empty = Moment(builders.scene(), furnished_moment(5, False).camera)
    moments = [
        population(1, quads=3, triangles=10),
        population(2, quads=0, triangles=20),
        population(3, quads=5, triangles=1, pierced=True),
        empty,
        population(1, quads=3, triangles=10),
        furnished_moment(5, True),
        furnished_moment(5, False),
    ]
    settings = {**arguments(4, 0.05), "variant": variant}
    if continuous:
        views = session.play(moments, **settings)
        again = session.play(moments, **settings)
    else:
        ends = range(3, len(moments) + 1)
        shown = [(moments[end - 1], final(moments[:end])) for end in ends]
        views = [session.show(moment.scene, moment.camera, sequence, **settings) for moment, sequence in shown]
        again = [render(moment.scene, moment.camera, sequence, **settings) for moment, sequence in shown]
        moments = moments[2:]
    for at, (view, repeated, moment) in enumerate(zip(views, again, moments, strict=True)):
        assert_defined(view.layers)
        assert_same_view(view, repeated, f"view {at}")
        expected = render(moment.scene, moment.camera, **arguments(4, 0.05))
        assert_identical(view.layers[:1], expected.layers[:1], f"view {at}")
        if variant in EXACT:
            assert_same_view(view, expected, f"view {at}")


@pytest.mark.parametrize("variant", HISTORY)
def test_a_cut_drops_history(render, session, variant):
    """After a jump of the camera, and after a change of size, the first picture is that of a fresh start."""
    here = furnished_moment(5, False)
    there = Moment(here.scene, replace(furnished_moment(3, False).camera, clip_end=50.0))
    settings = arguments(3, 0.05)
    expected = render(there.scene, there.camera, **settings)
    jumped = session.play([here, there], variant=variant, **settings)[-1]
    assert_same_view(jumped, expected, "jump")
    smaller = {**settings, "width": 33, "height": 17}
    resized = session.show(
        there.scene, there.camera, Sequence(previous=there, continuous=True), variant=variant, **smaller
    )
    assert_same_view(resized, render(there.scene, there.camera, **smaller), "resize")


@pytest.mark.parametrize("variant", SINGLE_PASS)
def test_a_frame_alone_equals_the_frame_in_an_animation(render, session, variant):
    """In a final render nothing depends on what the renderer drew before."""
    moments = frames(furnished_moment(5, False), MOVING, range(4))
    settings = arguments(3, 0.05, samples=2)
    for end in (3, 4):
        last, sequence = moments[end - 1], final(moments[:end])
        view = session.show(last.scene, last.camera, sequence, variant=variant, **settings)
    assert_same_view(view, render(last.scene, last.camera, sequence, variant=variant, **settings))
