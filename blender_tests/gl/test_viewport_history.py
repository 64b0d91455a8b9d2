# SPDX-License-Identifier: GPL-3.0-or-later
"""What one picture may leave to the next: when history must be dropped, and how much of it is exact."""

from dataclasses import replace

import numpy as np
import pytest
from layer_checks import assert_identical, differing
from random_scenes import Motion, frames, furnished_moment

from addon.render import RenderError
from addon.render.geometry import drawing_order
from addon.render.targets import TexturePool
from addon.scene import Moment, Sequence, Variant
from addon.scene.versions import new_version
from blender_tests import builders

HISTORY = [Variant.PREVIOUS, Variant.PREDICT, Variant.REPROJECT]
MOVING = Motion(camera=0.125, turn=0.03125, boxes=0.125, spin=0.125, vertices=0.125)


def arguments(layers, separation=0.05):
    """Settings of small pictures whose layers are read."""
    return {"width": 48, "height": 32, "layers": layers, "minimum_separation": separation, "deep_output": True}


def follow(previous):
    """The sequence of a viewport's next view."""
    return Sequence(previous=previous, continuous=True)


@pytest.mark.parametrize("variant", [variant for variant in Variant if variant is not Variant.TWO_PASS])
def test_a_view_that_memory_did_not_suffice_for_leaves_no_history(render, session, monkeypatch, variant):
    still = furnished_moment(3, False)
    settings = {**arguments(3), "variant": variant}
    expected = render(still.scene, still.camera, **arguments(3)).layers
    session.show(still.scene, still.camera, follow(None), **settings)

    def refuse(*_arguments):
        raise RenderError("Out of graphics memory.")

    with monkeypatch.context() as short:
        short.setattr(TexturePool, "_check_memory", refuse)
        with pytest.raises(RenderError):
            session.show(still.scene, still.camera, follow(still), **{**settings, "width": 64})
    view = session.show(still.scene, still.camera, follow(still), **settings)
    assert_identical(view.layers, expected)


@pytest.mark.parametrize("variant", HISTORY)
def test_history_is_dropped_where_another_scene_is_shown(render, session, variant):
    first, second = furnished_moment(3, False), furnished_moment(5, False)
    second = Moment(second.scene, first.camera)
    settings = {**arguments(2), "variant": variant}
    session.play([first, first], **settings)
    view = session.show(second.scene, second.camera, follow(first), **settings)
    expected = render(second.scene, second.camera, **arguments(2)).layers
    assert_identical(view.layers, expected)


@pytest.mark.parametrize("variant", HISTORY)
def test_a_view_is_exact_again_as_soon_as_it_rests(render, session, variant):
    moments = frames(furnished_moment(3, False), MOVING, range(4))
    settings = {**arguments(5), "variant": variant}
    session.play(moments, **settings)
    last = moments[-1]
    view = session.show(last.scene, last.camera, follow(last), **settings)
    assert_identical(view.layers, render(last.scene, last.camera, **arguments(5)).layers)


def planes_seen_from(position, count=1):
    """Planes tilted by 60°, 4 m behind one another, in front of a camera at a position (m)."""
    matrix = np.eye(4)
    matrix[:3, :3] = [[0.5, 0.0, np.sqrt(0.75)], [0.0, 1.0, 0.0], [-np.sqrt(0.75), 0.0, 0.5]]
    matrices = [builders.translation(z=-4.0 * index) @ matrix for index in range(count)]
    scene = builders.scene(builders.quad("plane", half=200.0), batches=[builders.batch("plane", matrices)])
    camera = replace(builders.camera(), world_from_camera=builders.translation(*position))
    return Moment(scene, camera)


def test_planes_do_not_peel_themselves_where_a_prediction_is_a_little_wrong(session):
    scene = planes_seen_from((0.0, 0.0, 5.0), count=2).scene
    cameras = [planes_seen_from((0.5 * 0.0005 * step**2, 0.0, 5.0)).camera for step in range(4)]
    for view in session.play(
        [Moment(scene, camera) for camera in cameras], variant=Variant.PREDICT, **arguments(4, 0.0)
    ):
        for layer in view.layers[2:]:
            assert not np.isfinite(layer.depth).any()


@pytest.mark.parametrize("pan", [0.001, 0.05, 0.3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_plane_that_grows_or_shrinks_on_screen_does_not_peel_itself(session, pan, sign):
    before = planes_seen_from((0.0, 0.0, 5.0))
    now = Moment(before.scene, planes_seen_from((sign * pan, 0.0, 5.0)).camera)
    view = session.play([before, now], variant=Variant.REPROJECT, **arguments(2, 0.0))[-1]
    moved = np.abs(pan / 5.0 * 48 / 2.0)
    inside = view.layers[1].depth[:, int(np.ceil(2.0 * moved)) + 1 : -int(np.ceil(2.0 * moved)) - 1]
    assert inside.size
    assert not np.isfinite(inside).any()


def test_instances_are_drawn_in_an_order_that_ids_do_not_change():
    generator = np.random.default_rng(1)
    matrices = np.tile(np.eye(4), (6, 1, 1))
    matrices[:, :3, 3] = generator.integers(0, 2, (6, 3))
    matrices[3:, :3, 3] = matrices[:3, :3, 3]
    matrices[3:, 0, 0] = 2.0
    batch = replace(builders.batch("a", matrices), object_index=np.zeros(6, np.int32))
    drawn = batch.matrices[drawing_order(batch)]
    for _ in range(5):
        order = generator.permutation(6)
        other = replace(
            batch, matrices=matrices[order], ids=generator.integers(-(2**62), 2**62, 6), version=new_version()
        )
        np.testing.assert_array_equal(other.matrices[drawing_order(other)], drawn)


@pytest.mark.parametrize("variant", [Variant.PREVIOUS, Variant.REPROJECT])
def test_history_shows_in_motion(session, variant):
    """The checks above could not fail if these variants were exact in motion as well."""
    moments = frames(furnished_moment(3, False), MOVING, range(4))
    exact = session.play(moments, variant=Variant.PREPASS, **arguments(2))[-1].layers
    assert differing(session.play(moments, variant=variant, **arguments(2))[-1].layers, exact, layer=1).any()
