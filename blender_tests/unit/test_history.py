# SPDX-License-Identifier: GPL-3.0-or-later
"""When one picture says nothing about the next."""

import math
from dataclasses import replace

import numpy as np
import pytest

from addon.scene import BaseColorSource, Image, ImageTexture, Interpolation, Moment, SlotRange
from addon.scene.history import is_cut, same_population
from addon.scene.versions import new_version
from blender_tests import builders

ROOM = builders.scene(
    builders.mesh("q", [(-5, -5, -5), (5, -5, 5), (5, 5, -5), (-5, 5, 5)], [(0, 1, 2)]),
)
"""Its middle is the origin, its radius 8.66 m."""


def camera(position=(0.0, 0.0, 20.0), angle=0.0, window=(-1, 1, -0.5, 0.5), orthographic=False):
    """A camera that looks along −Z, turned left by an angle."""
    turned = builders.translation(*position)
    cosine, sine = math.cos(angle), math.sin(angle)
    turned[:3, :3] = [(cosine, 0, sine), (0, 1, 0), (-sine, 0, cosine)]
    return replace(builders.camera(), world_from_camera=turned, window=window, orthographic=orthographic)


def cut(before, now, scene=ROOM):
    return is_cut(Moment(scene, before), Moment(scene, now))


CHANGES = {
    # what, the most that is no cut, the least that is one
    "turn": ({"angle": math.radians(44.0)}, {"angle": math.radians(46.0)}),
    "turn back": ({"angle": math.radians(-44.0)}, {"angle": math.radians(-46.0)}),
    "wider": ({"window": (-1.9, 1.9, -0.9, 0.9)}, {"window": (-2.1, 2.1, -1.05, 1.05)}),
    "closer": ({"window": (-0.6, 0.6, -0.3, 0.3)}, {"window": (-0.4, 0.4, -0.2, 0.2)}),
    "shift": ({"window": (-0.4, 1.6, -0.5, 0.5)}, {"window": (1.0, 3.0, -0.5, 0.5)}),
    "step": ({"position": (0.0, 0.0, 11.0)}, {"position": (0.0, 0.0, 60.0)}),
    "sidestep": ({"position": (10.0, 0.0, 20.0)}, {"position": (12.0, 0.0, 20.0)}),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_camera_that_jumps_makes_a_cut(change):
    small, large = CHANGES[change]
    assert not cut(camera(), camera(**small))
    assert cut(camera(), camera(**large))


def test_a_camera_that_rests_makes_no_cut_whatever_the_scene():
    assert not cut(camera(), camera())
    assert not cut(camera(), camera(), builders.scene())


def test_another_projection_makes_a_cut():
    assert cut(camera(), camera(orthographic=True))
    assert cut(camera(orthographic=True), camera())


def test_walking_through_the_middle_of_a_scene_makes_no_cut():
    assert not cut(camera((0.0, 0.0, 0.1)), camera((0.0, 0.0, -0.1)))
    assert cut(camera((0.0, 0.0, 2.5)), camera((0.0, 0.0, -2.5)))


def test_the_middle_is_that_of_everything_that_is_placed():
    mesh = builders.quad("q")
    far = builders.batch("q", [builders.translation(z=-400.0), builders.translation(z=-200.0)])
    scene = builders.scene(mesh, batches=(far, builders.batch("q", np.empty((0, 4, 4)), key="empty")))
    assert not cut(camera((0.0, 0.0, 0.0)), camera((100.0, 0.0, 0.0)), scene)
    assert cut(camera((0.0, 0.0, 0.0)), camera((200.0, 0.0, 0.0)), scene)


def test_the_middle_is_that_of_what_cameras_see():
    mesh = builders.quad("q")
    near = builders.batch("q", [builders.translation(z=-10.0)])
    unseen = replace(builders.batch("q", [builders.translation(z=-900.0)], key="unseen"), seen_by_camera=False)
    before, now = camera((0.0, 0.0, 0.0)), camera((8.0, 0.0, 0.0))
    assert cut(before, now, builders.scene(mesh, batches=(near, unseen)))
    assert not cut(before, now, builders.scene(mesh, batches=(near, replace(unseen, seen_by_camera=True))))


def test_an_orthographic_view_pans_by_half_a_window_without_a_cut():
    window = (-4, 4, -2, 2)
    before = camera(window=window, orthographic=True)
    assert not cut(before, camera((3.9, 0.0, 20.0), window=window, orthographic=True))
    assert cut(before, camera((4.1, 0.0, 20.0), window=window, orthographic=True))
    assert not cut(before, camera((0.0, 0.0, 900.0), window=window, orthographic=True))
    assert cut(before, camera(window=(0.1, 8.1, -2, 2), orthographic=True))
    assert not cut(before, camera((3.9, 0.0, 20.0), window=(-7.9, 0.1, -2, 2), orthographic=True))
    assert not cut(before, camera(angle=math.radians(22.0), window=window, orthographic=True))
    assert cut(before, camera(angle=math.radians(23.0), window=window, orthographic=True))


def test_a_mirrored_camera_is_judged_like_any_other():
    mirrored = camera(window=(1, -1, -0.5, 0.5))
    assert not cut(mirrored, camera(angle=math.radians(44.0), window=(1, -1, -0.5, 0.5)))
    assert cut(mirrored, camera(angle=math.radians(46.0), window=(1, -1, -0.5, 0.5)))


LEAF = builders.material("leaf", source=BaseColorSource.TEXTURE, texture=ImageTexture("i"), texture_alpha=True)
IMAGE = Image("i", "i", 1, np.zeros((2, 2, 4), np.uint8), srgb=True)


def population(ids=(1, 2, 3), mesh=None, materials=(builders.DIFFUSE,), batch_materials=("white",), image=IMAGE):
    """Instances of one mesh; everything has a version of its own."""
    mesh = replace(builders.quad("q") if mesh is None else mesh, version=new_version())
    matrices = [builders.translation(x) for x in range(len(ids))]
    batch = builders.batch("q", matrices, batch_materials)
    batch = replace(batch, version=new_version(), ids=np.array(ids, np.int64))
    return builders.scene(mesh, batches=(batch,), materials=materials, images=(image,))


def leaves(**arguments):
    return population(**{"materials": (LEAF,), "batch_materials": ("leaf",), **arguments})


def test_motion_and_order_do_not_change_the_population():
    mesh = builders.quad("q")
    assert same_population(population(), population())
    assert same_population(population((1, 2, 3)), population((3, 1, 2)))
    assert same_population(population(), population(mesh=replace(mesh, positions=mesh.positions * 2, uvs=mesh.uvs * 2)))


def test_colours_do_not_change_the_population():
    red = builders.material("white", base_color=(1.0, 0.0, 0.0))
    assert same_population(population(), population(materials=(red,)))
    painted = builders.material("white", source=BaseColorSource.TEXTURE, texture=ImageTexture("i"))
    assert same_population(population(), population(materials=(painted,)))
    green = builders.material("green")
    assert same_population(population(), population(materials=(green,), batch_materials=("green",)))


@pytest.mark.parametrize("ids", [(1, 2), (1, 2, 4), (1, 2, 3, 3), ()])
def test_instances_that_come_or_go_change_the_population(ids):
    assert not same_population(population(), population(ids))
    assert not same_population(population(ids), population())


def test_instances_may_lie_in_several_batches():
    one = population((1, 2, 3))
    mesh = one.meshes["q"]
    parts = [replace(builders.batch("q", [np.eye(4)] * n, key=f"q{n}"), ids=np.arange(n)) for n in (2, 1)]
    parts = replace(parts[0], ids=np.array([2, 3])), replace(parts[1], ids=np.array([1]))
    assert same_population(one, builders.scene(mesh, batches=parts))


def test_other_triangles_change_the_population():
    mesh = builders.quad("q")
    for other in (
        replace(mesh, triangles=mesh.triangles[::-1]),
        builders.mesh("q", mesh.positions, [(0, 1, 2)]),
        replace(mesh, slots=(SlotRange(0, 0, 1), SlotRange(1, 1, 1))),
    ):
        assert not same_population(population(), population(mesh=other))


def test_holes_change_the_population():
    assert same_population(leaves(), leaves())
    assert not same_population(population(), leaves())
    assert not same_population(leaves(), leaves(materials=(replace(LEAF, alpha=0.4),)))
    assert not same_population(leaves(), leaves(image=replace(IMAGE, version=new_version())))
    closest = replace(LEAF, texture=ImageTexture("i", interpolation=Interpolation.CLOSEST))
    assert not same_population(leaves(), leaves(materials=(closest,)))
    mesh = builders.quad("q")
    assert not same_population(leaves(), leaves(mesh=replace(mesh, uvs=mesh.uvs * 2)))


def test_what_only_casts_shadows_is_nobody():
    scene = population()
    unseen = replace(builders.batch("q", key="unseen"), seen_by_camera=False)
    assert same_population(scene, replace(scene, batches=(*scene.batches, unseen)))
    assert not same_population(scene, replace(scene, batches=(replace(scene.batches[0], seen_by_camera=False),)))


def test_an_empty_batch_is_nobody():
    with_empty = population()
    empty = builders.batch("q", np.empty((0, 4, 4)), key="empty")
    assert same_population(population(), replace(with_empty, batches=(*with_empty.batches, empty)))
    assert same_population(builders.scene(), builders.scene())
