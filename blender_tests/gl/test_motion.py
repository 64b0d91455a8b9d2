# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion vectors against a float64 projection of the points that the ray caster finds, now and a frame before."""

from dataclasses import replace

import numpy as np
import pytest
from layer_raycast import camera_triangles, raycast_layers
from random_scenes import Case, Motion, built, frames, furnished_moment, rotation

from addon.scene import Channel, DebugView, Moment, Sequence, Variant
from blender_tests import builders

SIZE = (32, 24)
DEEP = {"width": SIZE[0], "height": SIZE[1], "deep_output": True, "motion_vectors": True}
# float16 may truncate.
HALF_ROUNDING = 2.0**-10
KINDS = {
    "translation": Motion(boxes=0.25),
    "rotation": Motion(spin=0.125),
    "deformation": Motion(vertices=0.25),
    "camera pans": Motion(turn=0.0625),
    "camera moves": Motion(camera=0.25),
    "all at once": Motion(camera=0.125, turn=0.03125, boxes=0.125, spin=0.125, vertices=0.125),
}
every_kind = pytest.mark.parametrize("kind", KINDS)
projections = pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])


def previous_pixels(now, before, triangles, pixels):
    """Where what is seen at `pixels` (N, 2) on `triangles` (N,) of moment `now` was in the frame `before`, (N, 2)."""
    corners, old_corners = (
        np.array([item[0] for item in camera_triangles(moment.scene, moment.camera)])[triangles]
        for moment in (now, before)
    )
    left, right, bottom, top = now.camera.window
    point = np.array([left, bottom]) + pixels / SIZE * (right - left, top - bottom)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    plane = (normal * corners[:, 0]).sum(axis=1)
    if now.camera.orthographic:
        depth = (plane - (normal[:, :2] * point).sum(axis=1)) / normal[:, 2]
        seen = np.column_stack([point, depth])
    else:
        seen = np.column_stack([point, np.ones(len(point))])
        seen *= (plane / (normal * seen).sum(axis=1))[:, None]
    # Barycentric coordinates from areas.
    areas = np.stack(
        [
            (np.cross(corners[:, (k + 1) % 3] - seen, corners[:, (k + 2) % 3] - seen) * normal).sum(axis=1)
            for k in range(3)
        ],
        axis=1,
    )
    weights = areas / areas.sum(axis=1, keepdims=True)
    old = (weights[:, :, None] * old_corners).sum(axis=1)
    left, right, bottom, top = before.camera.window
    window = old[:, :2] if before.camera.orthographic else old[:, :2] / old[:, 2:]
    return (window - (left, bottom)) / (right - left, top - bottom) * SIZE


def expected_motion(now, before, truth, layer, subpixel_bits):
    """(motion (N, 2), tolerance (N,)) at the pixels that are certain and covered, in row order.

    Rasterisation may sample a triangle up to δ off the pixel centre: 2⁻ˢ for snapping, and the rest of what
    `layer_raycast` lists, below 2⁻¹¹ here. Both ends of the vector move along, the far one by its own rate. Depth is
    interpolated with the relative error that the ray caster allows it, and so are both ends.
    """
    rows, columns = np.nonzero(~truth.ambiguous & np.isfinite(truth.depth[layer]))
    triangles = truth.triangle[layer, rows, columns]
    pixels = np.column_stack([columns, rows]) + 0.5
    before_pixels = previous_pixels(now, before, triangles, pixels)
    reach = 2.0**-subpixel_bits + 2.0**-11
    tolerance = 4.0 * max(SIZE) * truth.tolerance[layer, rows, columns] / truth.depth[layer, rows, columns]
    for step in reach * np.eye(2):
        change = previous_pixels(now, before, triangles, pixels + step) - before_pixels - step
        tolerance += 2.0 * np.linalg.norm(change, axis=1)
    motion = pixels - before_pixels
    return motion, tolerance + HALF_ROUNDING * np.abs(motion).max(axis=1)


@projections
@every_kind
def test_motion_equals_the_projection_of_moved_points(render, subpixel_bits, kind, orthographic):
    before, now = frames(Moment(*built(Case(5, 3, 0.05, orthographic))), KINDS[kind], range(2))
    truth = raycast_layers(now.scene, now.camera, SIZE, 3, 0.05, subpixel_bits=subpixel_bits)
    for variant in (Variant.TWO_PASS, Variant.PREPASS, Variant.REPROJECT):
        layers = render(
            now.scene,
            now.camera,
            Sequence(previous=before, earlier=before),
            layers=3,
            minimum_separation=0.05,
            variant=variant,
            **DEEP,
        ).layers
        # Layers from stale depths may hold other surfaces; layer 0 is every variant's.
        for layer in range(1 if variant is Variant.REPROJECT else 3):
            motion, tolerance = expected_motion(now, before, truth, layer, subpixel_bits)
            assert len(motion) > 30
            assert np.abs(motion).max() > 0.5, "something must move"
            rendered = layers[layer].motion[~truth.ambiguous & np.isfinite(truth.depth[layer])]
            excess = np.linalg.norm(rendered - motion, axis=1) - tolerance
            worst = excess.argmax()
            assert excess[worst] <= 0.0, f"{variant} layer {layer}: {rendered[worst]}, expected {motion[worst]}"


def test_one_pixel_to_the_right_and_two_up_is_one_and_two(render):
    """A wall at 4 m seen through a window of 32 × 24 pixels that are 2⁻⁴ m wide there; the image mirrored as well."""
    camera = builders.camera(z=4.0)
    camera = replace(camera, window=(-0.25, 0.25, -0.1875, 0.1875))
    now = builders.scene(builders.quad("wall", half=9.0))
    shift = builders.translation(-(2.0**-4), -2.0 * 2.0**-4, 0.0)
    before = replace(now, batches=(builders.batch("wall", [shift]),))
    before = replace(before, batches=(replace(before.batches[0], version=before.batches[0].version + 1),))
    for mirrored in (False, True):
        if mirrored:
            camera = replace(camera, window=(0.25, -0.25, -0.1875, 0.1875))
        motion = render(now, camera, Sequence(previous=Moment(before, camera)), layers=1, **DEEP).layers[0].motion
        expected = (-1.0 if mirrored else 1.0, 2.0)
        np.testing.assert_allclose(motion, np.broadcast_to(expected, motion.shape), atol=2.0**-9)


@projections
def test_what_is_static_has_exactly_no_motion(render, orthographic):
    """Equal data under other objects and versions, too; only the boxes move."""
    still = furnished_moment(5, orthographic)
    before, now = frames(still, Motion(boxes=0.125), range(2))
    before = Moment(replace(before.scene), replace(before.camera))
    layers = render(now.scene, now.camera, Sequence(previous=before), layers=4, minimum_separation=0.05, **DEEP).layers
    moving = np.zeros(layers[0].depth.shape, bool)
    for layer in layers:
        static = layer.object_index < 1000
        assert (static & np.isfinite(layer.depth)).any()
        np.testing.assert_array_equal(layer.motion[static], 0.0)
        moving |= ~static & (layer.motion != 0.0).any(axis=-1)
    assert moving.any()


@projections
@pytest.mark.parametrize("variant", list(Variant))
def test_at_rest_motion_is_zero_in_every_sample(session, variant, orthographic):
    """The film shows motion as it shows that of a frame of which no other is known, in jittered samples as well."""
    still = furnished_moment(5, orthographic)
    settings = {**DEEP, "layers": 2, "samples": 4, "filter_radius": 1.5, "variant": variant}
    for layer in range(2):
        shown = {**settings, "debug_view": DebugView.MOTION, "debug_layer": layer}
        alone = session.show(still.scene, still.camera, **shown)
        rest = session.show(still.scene, still.camera, Sequence(previous=still, earlier=still), **shown)
        continued = session.play([still] * 2, **shown)[-1]
        moved = session.play(frames(still, Motion(camera=0.125), range(2)), **shown)[-1]
        for view in (alone, rest, continued):
            assert all(not image.motion.any() for image in view.layers)
            np.testing.assert_array_equal(view.channels[Channel.COMBINED], alone.channels[Channel.COMBINED])
        assert (moved.channels[Channel.COMBINED] != alone.channels[Channel.COMBINED]).any()


def test_what_moves_with_the_camera_has_no_motion(render):
    """Steps of a binary size change no difference between the two; what stands still moves the other way."""
    still = furnished_moment(5, False)
    step = builders.translation(0.25, -0.125, 0.5)
    matrix = step @ still.camera.world_from_camera
    batches = tuple(
        replace(batch, matrices=step @ batch.matrices, version=batch.version + 10**9) if batch.mesh == "box" else batch
        for batch in still.scene.batches
    )
    now = Moment(replace(still.scene, batches=batches), replace(still.camera, world_from_camera=matrix))
    layer = render(now.scene, now.camera, Sequence(previous=still), layers=1, **DEEP).layers[0]
    attached = (layer.object_index >= 1000) & (layer.object_index < 2000)
    others = np.isfinite(layer.depth) & ~attached
    assert attached.sum() > 20
    assert others.sum() > 20
    np.testing.assert_allclose(layer.motion[attached], 0.0, atol=2.0**-12)
    assert (np.abs(layer.motion[others]).max(axis=-1) > 0.1).all()


def test_no_history_and_a_place_behind_the_camera_give_no_motion(render):
    still = furnished_moment(5, False)
    for sequence in (None, Sequence()):
        layers = render(still.scene, still.camera, sequence, layers=2, **DEEP).layers
        assert not any(layer.motion.any() for layer in layers)
    turned = still.camera.world_from_camera.copy()
    turned[:3, :3] = turned[:3, :3] @ rotation(np.array([0.0, 1.0, 0.0]), np.pi)
    behind = Moment(still.scene, replace(still.camera, world_from_camera=turned))
    for layer in render(still.scene, still.camera, Sequence(previous=behind), layers=2, **DEEP).layers:
        assert np.isfinite(layer.motion).all()


def test_motion_is_built_only_where_it_is_read(render):
    still = furnished_moment(5, False)
    view = render(still.scene, still.camera, layers=2, **{**DEEP, "motion_vectors": False})
    assert all(layer.motion is None for layer in view.layers)
    assert "motion" not in {channel.name for channel, _ in view.plan.channels}
