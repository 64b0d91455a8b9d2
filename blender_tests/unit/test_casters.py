# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.render.casters import CasterList, batch_bounds
from addon.render.draws import Draw
from addon.render.frustum import frustum_planes
from addon.scene import ALL_GROUPS, BaseColorSource, Camera, Image, ImageTexture, SlotRange
from blender_tests import builders

PIERCED = frozenset({"TEXTURE", "ALPHA_TEST"})


def draws_of(scene, threshold=0.5):
    """What `SceneDraws` is to casters: a draw per slot and batch, alpha-tested where the material is."""
    draws = []
    for batch in scene.batches:
        for slot in scene.meshes[batch.mesh].slots:
            material = scene.materials[batch.materials[min(slot.slot, len(batch.materials) - 1)]]
            surface = PIERCED if material.is_alpha_tested else frozenset()
            texture = material.texture if surface else None
            draws.append(Draw(batch, 3 * slot.first, 3 * slot.count, 0, surface, texture, material.alpha))
    return SimpleNamespace(scene=scene, draws=tuple(draws), alpha_threshold=threshold)


def boxes(count=3, **arguments):
    """A scene of boxes beside one another."""
    batches = [builders.batch("box", [builders.translation(x=4.0 * k)], key=f"box {k}") for k in range(count)]
    return builders.scene(builders.box("box"), batches=[replace(item, **arguments) for item in batches])


def any_matrices(generator, count):
    """Turned, skewed, mirrored and placed anywhere."""
    matrices = np.tile(np.eye(4), (count, 1, 1))
    matrices[:, :3, :3] = generator.normal(size=(count, 3, 3))
    matrices[:, :3, 3] = generator.normal(size=(count, 3)) * 20.0
    return matrices


@given(st.integers(1, 20), st.integers(0, 2**32 - 1))
def test_bounds_hold_every_vertex_of_every_instance(count, seed):
    generator = np.random.default_rng(seed)
    soup = builders.mesh("soup", generator.normal(size=(9, 3)), np.arange(9))
    batch = builders.batch("soup", any_matrices(generator, count))
    vertices = soup.positions.astype(np.float64) @ batch.matrices[:, :3, :3].transpose(0, 2, 1)
    vertices += batch.matrices[:, None, :3, 3]
    low, high = batch_bounds(soup, batch)
    assert (vertices >= low - 1e-9).all()
    assert (vertices <= high + 1e-9).all()


@given(st.booleans(), st.integers(0, 2**32 - 1))
def test_nothing_between_a_light_and_what_it_lights_is_culled(orthographic, seed):
    """Every caster that has a point in the map's frustum is among those it sees."""
    generator = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(generator.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3] = rotation * np.sign(np.linalg.det(rotation))
    pose[:3, 3] = generator.normal(size=3) * 5.0
    camera = Camera(pose, (-1.0, 0.5, -0.3, 1.2), 1e-6, 30.0, orthographic)
    batches = [
        builders.batch("soup", any_matrices(generator, 2), key=f"soup {index}") for index in range(int(seed % 20) + 1)
    ]
    soup = builders.mesh("soup", generator.normal(size=(9, 3)), np.arange(9))
    casters = CasterList().of(draws_of(builders.scene(soup, batches=batches)))
    seen = set(casters.seen(camera, ALL_GROUPS).tolist())
    planes = frustum_planes(camera)
    weights = generator.dirichlet(np.ones(3), 40)
    for index, draw in enumerate(casters.draws):
        corners = soup.positions[soup.triangles].astype(np.float64)
        points = np.einsum("wk,tkc->wtc", weights, corners).reshape(-1, 3)
        for matrix in draw.batch.matrices:
            world = points @ matrix[:3, :3].T + matrix[:3, 3]
            if (world @ planes[:, :3].T + planes[:, 3] >= 0.0).all(axis=1).any():
                assert index in seen


@pytest.mark.parametrize("group", [0, 15, 16, 31, 32, 63])
def test_only_the_groups_that_block_a_light_are_seen_by_it(group):
    scene = boxes()
    first, *others = scene.batches
    casters = CasterList().of(draws_of(replace(scene, batches=(replace(first, link_group=group), *others))))
    camera = replace(builders.camera(z=20.0, half_width=2.0), clip_end=100.0)
    alone = [0, 1, 2] if group == 0 else [0]
    assert casters.seen(camera, 1 << group).tolist() == alone
    assert casters.seen(camera, ALL_GROUPS).tolist() == [0, 1, 2]
    assert casters.seen(camera, ALL_GROUPS ^ 1 << group).tolist() == [k for k in range(3) if k not in alone]
    assert casters.seen(camera, 0).tolist() == []


def test_what_casts_no_shadow_is_no_caster_and_what_no_camera_sees_is_one():
    scene = boxes()
    first, second, third = scene.batches
    changed = (replace(first, casts_shadow=False), replace(second, seen_by_camera=False), third)
    casters = CasterList().of(draws_of(replace(scene, batches=changed)))
    assert [draw.batch.key for draw in casters.draws] == ["box 1", "box 2"]


def test_equal_casters_keep_their_numbers_and_changed_ones_get_new_ones():
    scene = boxes()
    held = CasterList()
    before = held.of(draws_of(scene)).versions
    assert len(set(before.tolist())) == 3
    np.testing.assert_array_equal(held.of(draws_of(scene)).versions, before)
    first, second, third = scene.batches
    moved = replace(second, version=2, matrices=second.matrices + 1.0)
    after = held.of(draws_of(replace(scene, batches=(first, moved, third)))).versions
    assert (after == before).tolist() == [True, False, True]
    assert after[1] not in before


def test_numbers_are_never_used_again():
    """Not even for a caster that comes back as it was: what was drawn in between may still be there."""
    scene = boxes()
    held = CasterList()
    seen = set()
    for count in (3, 1, 3, 0, 2):
        versions = held.of(draws_of(replace(scene, batches=scene.batches[:count]))).versions
        new = set(versions.tolist())
        assert len(new) == count
        seen |= new
    assert len(seen) == 3 + 2 + 2


def test_a_mesh_that_changes_shape_is_another_caster():
    scene = boxes()
    held = CasterList()
    before = held.of(draws_of(scene)).versions
    mesh = replace(scene.meshes["box"], version=2)
    after = held.of(draws_of(replace(scene, meshes={"box": mesh}))).versions
    assert not set(before.tolist()) & set(after.tolist())


def leaf(texture="leaf", pixels=1, **arguments):
    """A card whose alpha comes from an image."""
    image = Image("leaf", "leaf", pixels, np.zeros((2, 2, 4), np.uint8), srgb=True)
    source = {"source": BaseColorSource.TEXTURE, "texture": ImageTexture(texture), "texture_alpha": True}
    material = builders.material(**source, **arguments)
    return builders.scene(builders.quad("card"), materials=(material,), images=(image, replace(image, key="other")))


@pytest.mark.parametrize(
    ("changed", "threshold", "is_new"),
    [
        (leaf(), 0.5, False),
        (leaf(base_color=(1.0, 0.0, 0.0), roughness=0.1, emission=(1.0, 1.0, 1.0)), 0.5, False),
        (leaf(), 0.25, True),
        (leaf(alpha=0.9), 0.5, True),
        (leaf(pixels=2), 0.5, True),
        (leaf("other"), 0.5, True),
        (replace(leaf(), materials={"white": builders.DIFFUSE}), 0.5, True),
    ],
)
def test_a_pierced_caster_is_another_where_its_holes_may_be(changed, threshold, is_new):
    held = CasterList()
    (before,) = held.of(draws_of(leaf())).versions.tolist()
    (after,) = held.of(draws_of(changed, threshold)).versions.tolist()
    assert (after != before) == is_new


@given(st.integers(0, 3))
def test_each_slot_is_a_caster_of_its_own(unseen):
    slots = tuple(SlotRange(index, 3 * index, 3) for index in range(4))
    box = builders.box("box", slots=slots)
    draws = draws_of(builders.scene(box))
    kept = tuple(draw for index, draw in enumerate(draws.draws) if index != unseen)
    held = CasterList()
    before = held.of(draws).versions
    after = held.of(SimpleNamespace(scene=draws.scene, draws=kept, alpha_threshold=0.5)).versions
    np.testing.assert_array_equal(after, np.delete(before, unseen))


def test_a_scene_without_casters():
    casters = CasterList().of(draws_of(builders.scene()))
    assert casters.bounds.shape == (0, 2, 3)
    assert casters.seen(builders.camera(), ALL_GROUPS).tolist() == []
