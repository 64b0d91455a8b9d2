# SPDX-License-Identifier: GPL-3.0-or-later
"""Exit surfaces: the first back face behind each layer, where a ray leaves the solid that it entered there."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from layer_checks import assert_identical
from layer_raycast import raycast_layers
from random_scenes import CASES, Case, built, fresh, numbered

from addon.scene import BaseColorSource, ImageTexture, Interpolation, Moment, Sequence, Variant
from blender_tests import builders

SIZE = (32, 24)
DEEP = {"width": SIZE[0], "height": SIZE[1], "deep_output": True, "exit_surfaces": True}
COLORS = {"red": (1.0, 0.0, 0.0), "green": (0.0, 1.0, 0.0), "blue": (0.0, 0.0, 1.0)}
MATERIALS = tuple(builders.material(key, base_color=color) for key, color in COLORS.items())
# A normal of 8 bits per octahedral component is off by less than 2⁻⁵ rad.
NORMAL_STEP = 2.0**-5
SAME_DIRECTION = 1.0 - 0.5 * NORMAL_STEP**2
every_variant = pytest.mark.parametrize("variant", list(Variant))
few_renders = settings(
    max_examples=12, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def colored(case):
    """A random scene of red boxes, as many green mirrored ones, and blue triangles; and a camera."""
    scene, camera = built(case)
    boxes, *soup = scene.batches
    plain, mirrored = boxes.matrices[:4], boxes.matrices[4:] @ np.diag([-1.0, 1.0, 1.0, 1.0])
    batches = (
        replace(numbered("box", plain, 1000, "red"), key="plain"),
        replace(numbered("box", mirrored, 2000, "green"), key="mirrored"),
        *(replace(batch, materials=("blue",)) for batch in soup),
    )
    materials = {item.key: item for item in MATERIALS}
    return fresh(replace(scene, batches=batches, materials=materials)), camera


def color_of(owner):
    """(…, 3) colours of the instances with these pass indices."""
    names = np.where(owner >= 2000, "green", np.where(owner >= 1000, "red", "blue"))
    return np.array([COLORS[name] for name in names.ravel()]).reshape(*owner.shape, 3)


@few_renders
@given(CASES, st.sampled_from(list(Variant)), st.booleans())
@example(Case(5, 3, 0.0, False), Variant.TWO_PASS, False)
@example(Case(5, 3, 0.5, True), Variant.PREPASS, True)
@example(Case(3, 3, 0.05, False), Variant.REPROJECT, True)
def test_exits_equal_ray_caster(shared_session, subpixel_bits, case, variant, mirrored_image):
    scene, camera = colored(case)
    if mirrored_image:
        left, right, bottom, top = camera.window
        camera = replace(camera, window=(right, left, bottom, top))
    still = Moment(scene, camera)
    settings = {**DEEP, "layers": 3, "minimum_separation": case.separation, "variant": variant}
    images = shared_session.show(scene, camera, Sequence(previous=still, earlier=still), **settings).layers
    truth = raycast_layers(scene, camera, SIZE, 3, case.separation, subpixel_bits=subpixel_bits).exits
    certain = ~truth.ambiguous
    for layer, image in enumerate(images):
        expected = truth.depth[layer]
        covered = np.isfinite(expected)
        wrong = certain & (covered != np.isfinite(image.exit_depth))
        assert not wrong.any(), f"layer {layer}: an exit too many or too few at {np.argwhere(wrong)[:4].tolist()}"
        checked = certain & covered
        excess = np.abs(image.exit_depth[checked] - expected[checked]) - truth.tolerance[layer][checked]
        assert excess.max(initial=0.0) <= 0.0, f"layer {layer}: depth off at {np.argwhere(checked)[excess.argmax()]}"
        cosine = np.abs((image.exit_normal[checked] * truth.normal[layer][checked]).sum(axis=-1))
        assert cosine.min(initial=1.0) > SAME_DIRECTION
        np.testing.assert_array_equal(image.exit_albedo[checked], color_of(truth.owner[layer][checked]))
        nothing = ~np.isfinite(image.exit_depth)
        assert not image.exit_normal[nothing].any()
        assert not image.exit_albedo[nothing].any()


def test_the_ray_caster_knows_back_faces_of_boxes_within_boxes():
    """Boxes of half 1, 2 and 4 m, the middle one mirrored, seen from 10 m: fronts at 6, 8 and 9 m, backs at 11 …"""
    scene = boxes_within_boxes()
    truth = raycast_layers(scene, builders.camera(z=10.0, half_width=0.05), (5, 5), 3, 0.0, subpixel_bits=8)
    certain = ~truth.exits.ambiguous
    assert certain.any()
    np.testing.assert_allclose(truth.depth[:, certain].T, [[6.0, 8.0, 9.0]] * certain.sum())
    np.testing.assert_allclose(truth.exits.depth[:, certain], 11.0)


def boxes_within_boxes():
    """Three closed boxes about the origin, the middle one a mirrored instance."""
    matrices = [np.eye(4), np.diag([2.0, -2.0, 2.0, 1.0]), np.diag([4.0, 4.0, 4.0, 1.0])]
    return builders.scene(builders.box("box"), batches=[numbered("box", np.array(matrices), 1)])


@every_variant
@pytest.mark.parametrize(
    ("separation", "layers", "exits"),
    [
        (0.0, (6.0, 8.0, 9.0), (11.0, 11.0, 11.0)),
        (1.5, (6.0, 8.0, 11.0), (11.0, 11.0, 12.0)),  # a back face may be a layer: its exit is behind it
        (4.5, (6.0, 11.0, np.inf), (11.0, 12.0, np.inf)),
        (1e30, (6.0, np.inf, np.inf), (11.0, np.inf, np.inf)),
    ],
)
def test_exits_are_found_before_the_separation_is_applied(render, variant, separation, layers, exits):
    scene, camera = boxes_within_boxes(), builders.camera(z=10.0, half_width=0.3)
    still = Sequence(previous=Moment(scene, camera), earlier=Moment(scene, camera))
    images = render(scene, camera, still, layers=3, minimum_separation=separation, variant=variant, **DEEP).layers
    np.testing.assert_allclose([image.depth[13, 14] for image in images], layers, rtol=1e-6)
    np.testing.assert_allclose([image.exit_depth[13, 14] for image in images], exits, rtol=1e-6)
    for image in images:
        found = np.isfinite(image.exit_depth)
        assert (image.exit_normal[found][:, 2] > -NORMAL_STEP).all(), "exit normals face the viewer"
        length = np.linalg.norm(image.exit_normal[found], axis=-1)
        np.testing.assert_allclose(length, 1.0, atol=1e-6)


@every_variant
@pytest.mark.parametrize("turned", [False, True], ids=["facing", "turned"])
def test_single_sheets(render, variant, turned):
    """A sheet that faces the viewer has no exit of its own; one that is turned away is the exit of what is before."""
    turn = np.diag([-1.0, 1.0, -1.0, 1.0]) if turned else np.eye(4)
    matrices = [builders.translation(z=z) @ turn for z in (1.0, 0.0, -1.0)]
    scene = builders.scene(builders.quad("sheet", half=9.0), batches=[numbered("sheet", np.array(matrices), 1)])
    camera = builders.camera(z=5.0)
    still = Sequence(previous=Moment(scene, camera), earlier=Moment(scene, camera))
    images = render(scene, camera, still, layers=3, minimum_separation=0.5, variant=variant, **DEEP).layers
    expected = (5.0, 6.0, np.inf) if turned else (np.inf, np.inf, np.inf)
    for image, depth, exit_depth in zip(images, (4.0, 5.0, 6.0), expected, strict=True):
        np.testing.assert_allclose(image.depth, depth, rtol=1e-6)
        np.testing.assert_allclose(image.exit_depth, exit_depth, rtol=1e-6)


@every_variant
def test_holes_of_alpha_tested_back_faces_are_no_exits(render, variant):
    """Behind a facing quad a pierced sheet turned away, and behind that a whole one: either, texel by texel."""
    turn = np.diag([-1.0, 1.0, -1.0, 1.0])
    image = builders.pierced(np.random.default_rng(2), size=8)
    texture = ImageTexture(image.key, interpolation=Interpolation.CLOSEST)
    leaf = builders.material("leaf", source=BaseColorSource.TEXTURE, texture=texture, texture_alpha=True)
    batches = [
        numbered("facing", np.array([builders.translation(z=1.0)]), 1),
        numbered("pierced", np.array([turn]), 2, "leaf"),
        numbered("whole", np.array([builders.translation(z=-1.0) @ turn]), 3, "red"),
    ]
    scene = builders.scene(
        *(builders.quad(key, half=9.0) for key in ("facing", "pierced", "whole")),
        materials=(builders.DIFFUSE, leaf, MATERIALS[0]),
        batches=batches,
        images=(image,),
    )
    camera = builders.camera(z=5.0)
    still = Sequence(previous=Moment(scene, camera), earlier=Moment(scene, camera))
    layers = render(scene, camera, still, layers=2, minimum_separation=0.5, variant=variant, **DEEP).layers
    without_leaf = np.isclose(layers[0].exit_depth, 6.0)
    with_leaf = np.isclose(layers[0].exit_depth, 5.0)
    assert (with_leaf | without_leaf).all()
    assert 0.2 < with_leaf.mean() < 0.8
    np.testing.assert_array_equal(layers[1].depth, layers[0].exit_depth)
    np.testing.assert_allclose(layers[0].exit_albedo[without_leaf], [COLORS["red"]] * without_leaf.sum())


def test_exits_are_built_only_where_they_are_read_and_leave_the_layers_as_they_are(render):
    scene, camera = colored(Case(5, 3, 0.05, False))
    settings = {**DEEP, "layers": 3, "minimum_separation": 0.05}
    with_exits = render(scene, camera, **settings)
    without = render(scene, camera, **{**settings, "exit_surfaces": False})
    assert with_exits.plan.find("exit")
    assert not without.plan.find("exit")
    assert all(layer.exit_depth is layer.exit_normal is layer.exit_albedo is None for layer in without.layers)
    bare = [replace(layer, exit_depth=None, exit_normal=None, exit_albedo=None) for layer in with_exits.layers]
    assert_identical(bare, without.layers)
