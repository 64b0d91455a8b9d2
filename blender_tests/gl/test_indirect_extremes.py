# SPDX-License-Identifier: GPL-3.0-or-later
"""Indirect light where numbers, sizes and shapes are at their ends: finite, bounded, and no worse with more samples."""

from dataclasses import replace

import numpy as np
import pytest

from addon.scene import EmissionSampling, IndirectMethod, LightKind, Sequence
from addon.scene.versions import new_version
from blender_tests import builders
from blender_tests.indirect_scenes import (
    CORNELL_CAMERA,
    GRID,
    beside,
    cornell,
    glowing,
    looking,
    of,
    placed,
    radiance,
    rectangle,
    relative_difference,
    seen,
    seen_from,
    wall,
)

METHODS = [method for method in IndirectMethod if method is not IndirectMethod.NONE]
SMALL = replace(GRID, cells=32)
LAMP = builders.light(LightKind.POINT, (0.1, -0.2, 0.6), emission=(1.0, 0.8, 0.6))
every_method = pytest.mark.parametrize("method", METHODS)


def shown(session, scene, camera=CORNELL_CAMERA, indirect=SMALL, **settings):
    """A view (H, W, 3), which must be finite and nowhere negative."""
    picture = radiance(session, scene, camera, indirect, **{"samples": 2, **settings})
    assert np.isfinite(picture).all()
    assert (picture >= 0.0).all()
    return picture


def lit_by_all(scene):
    """The scene under a world as well, so that every method has something to find."""
    return replace(scene, world=replace(scene.world, radiance=(0.2, 0.1, 0.3)))


def direct_of(session, scene, camera=CORNELL_CAMERA, **settings):
    """The view without indirect light."""
    return shown(session, scene, camera, replace(SMALL, method=IndirectMethod.NONE), **settings)


# --- Numbers ----------------------------------------------------------------------------------------------------------


@every_method
def test_normals_that_are_none(shared_session, method):
    """`sync` makes normals that are not finite zero: such surfaces have their faces' instead."""
    scene = lit_by_all(cornell(LAMP))
    flat = {
        key: replace(mesh, normals=np.zeros_like(mesh.normals), version=new_version())
        for key, mesh in scene.meshes.items()
    }
    found, expected = (
        shown(shared_session, one, indirect=replace(SMALL, method=method))
        for one in (replace(scene, meshes=flat), scene)
    )
    assert relative_difference(found, expected) < 0.02


@every_method
@pytest.mark.parametrize("strength", [1e30, 1e-30])
def test_lights_beyond_what_adds_up(shared_session, method, strength):
    """The world's strongest radiance that `sync` lets through, lamps and surfaces likewise, and denormal ones."""
    lamp = replace(LAMP, emission=(strength, strength, 0.0))
    scene = lit_by_all(cornell(lamp))
    panel = rectangle("panel", (0, 0, 0.98), (0.4, 0, 0), (0, -0.4, 0))
    scene = beside(scene, (panel, glowing(emission=strength)))
    picture = shown(shared_session, scene, indirect=replace(SMALL, method=method))
    assert (picture.max() > 1e20) == (strength > 1.0)


@every_method
def test_nothing_reflects_more_than_it_gets(shared_session, method):
    """Reflectance of 1 and, as a material may have it, above: what bounces for ever stays finite, and below what as
    many bounces of one may be."""
    for albedo in (1.0, 4.0):
        material = builders.material(base_color=(albedo,) * 3)
        scene = of(
            (builders.box("furnace"), material), lights=(builders.light(position=(0, 0, 0), emission=(1, 1, 1)),)
        )
        picture = shown(
            shared_session, scene, looking((0.1, -0.2, 0.05), (0, 1, 0)), replace(SMALL, method=method, bounces=None)
        )
        assert picture.max() < 1e6


@every_method
def test_zero_albedo(shared_session, method):
    """Nothing comes back from black walls: the picture has its direct light and its emission alone, to the bit."""
    scene = cornell(LAMP, albedo=0.0)
    with_one = {**scene.materials, "lit": builders.material("lit")}  # so that the plan does not leave it out
    scene = lit_by_all(replace(scene, materials=with_one, world=replace(scene.world, seen_by_diffuse=True)))
    indirect = shown(shared_session, scene, indirect=replace(SMALL, method=method))
    without = direct_of(shared_session, scene)
    np.testing.assert_array_equal(indirect, without)


def test_a_black_world_has_no_light(shared_session):
    assert shown(shared_session, cornell(emission=0.0)).max() == 0.0


# --- Fireflies --------------------------------------------------------------------------------------------------------


def with_spark(sampling):
    """The room with an emitter of 2 cm and 10⁶ W, which is less than a pixel, and the radiance of that."""
    half = 0.01
    spark = rectangle("spark", (0.0, -0.2, 0.9), (half, 0, 0), (0, -half, 0))
    emission = 1e6 / (2.0 * np.pi * (2.0 * half) ** 2)  # of both sides
    return replace(beside(cornell(LAMP), (spark, glowing(emission=emission, sampling=sampling))), lights=()), emission


def test_an_emitter_of_a_pixel_and_a_million_watts(shared_session):
    """Sampled as a light: speckle, the brightest pixel over the mean, does not grow with samples."""
    scene, _ = with_spark(EmissionSampling.AUTO)
    speckle = []
    for samples in (4, 64):
        found, _, _ = seen(shared_session, scene, CORNELL_CAMERA, SMALL, samples=samples, size=32)
        assert np.isfinite(found).all()
        speckle.append(found.max() / found.mean())
    assert speckle[1] <= 1.1 * speckle[0]


def test_such_an_emitter_that_only_rays_find(shared_session):
    """However few of them do: no surface sends more than its albedo of what the emitter does."""
    scene, emission = with_spark(EmissionSampling.NONE)
    for samples in (1, 64):
        found, _, _ = seen(shared_session, scene, CORNELL_CAMERA, SMALL, samples=samples, size=32)
        assert np.isfinite(found).all()
        assert 0.0 < found.max() <= 0.5 * emission


@every_method
def test_no_speckle_grows_over_64_samples(shared_session, method):
    """How far a pixel stands out falls, or stays, as samples add up, or is below a twentieth: filters fade by then."""
    scene, indirect = lit_by_all(cornell()), replace(SMALL, method=method)
    few, many = (
        _speckle(shown(shared_session, scene, indirect=indirect, samples=samples, size=32)) for samples in (4, 64)
    )
    assert many <= max(1.1 * few, 0.05)


def _speckle(picture):
    """How far the pixel that stands out most is above its eight neighbours' greatest, over the picture's mean."""
    luminance = picture.mean(axis=-1)
    middle = luminance[1:-1, 1:-1]
    size = luminance.shape[0]
    around = [
        luminance[1 + y : size - 1 + y, 1 + x : size - 1 + x]
        for y in (-1, 0, 1)
        for x in (-1, 0, 1)
        if (x, y) != (0, 0)
    ]
    return max(float((middle - np.max(around, axis=0)).max()), 0.0) / luminance.mean()


# --- Shapes -----------------------------------------------------------------------------------------------------------


@every_method
def test_a_hundred_cards_in_one_plane(shared_session, method):
    """They look like one of them."""
    room = lit_by_all(cornell(LAMP))
    card = rectangle("card", (-0.3, -0.2, -0.5), (0.4, 0, 0), (0, 0, 0.4))
    pictures = []
    for count in (1, 100):
        scene = beside(room, (card, builders.DIFFUSE), matrices=np.tile(np.eye(4), (count, 1, 1)))
        pictures.append(shown(shared_session, scene, indirect=replace(SMALL, method=method), layers=2))
    assert relative_difference(pictures[1], pictures[0]) < 0.02


@pytest.mark.parametrize("shift", [0.0, 0.02, 0.06])
def test_a_panel_close_to_a_ceiling(shared_session, shift):
    """A panel 2 cm below a ceiling, in cells of 12 cm, gives as much light as where it is sampled as a light: the
    ceiling behind it takes nothing of it, wherever cells begin."""
    indirect = replace(SMALL, cell_size=0.125, contact_steps=0, bounces=None)
    matrix = builders.translation(z=shift)
    found, sampled = (
        shown(
            shared_session,
            placed(cornell(sampling=sampling, height=0.98), matrix),
            seen_from(CORNELL_CAMERA, matrix),
            indirect,
            samples=16,
        ).mean()
        for sampling in (EmissionSampling.NONE, EmissionSampling.FRONT_BACK)
    )
    assert found == pytest.approx(sampled, rel=0.05)


@pytest.mark.parametrize("thickness", [0.0, 0.02], ids=["a sheet", "a wall thinner than a cell"])
@pytest.mark.parametrize("kind", ["lamp", "emission"])
def test_light_does_not_pass_through_thin_walls(shared_session, thickness, kind):
    """A closed room of 2 m, cut in two; light in one half, the camera in the other, and cells several times as large as
    the wall. What leaks is less than 2 % of what the lit half has."""
    white = builders.material(base_color=(0.7,) * 3)
    parts = [(builders.box("room"), white), (wall("middle", thickness), white)]
    lights = (builders.light(position=(0.5, 0.0, 0.0), emission=(1.0, 1.0, 1.0)),) if kind == "lamp" else ()
    if kind == "emission":
        parts.append((rectangle("panel", (0.5, 0, 0.95), (0.2, 0, 0), (0, -0.2, 0)), glowing(emission=20.0)))
    scene = of(*parts, lights=lights)
    indirect = replace(SMALL, cell_size=0.125, bounces=None)
    dark, lit = (
        seen(shared_session, scene, looking((x, -0.8, 0.1), (x, 0.8, -0.1)), indirect, samples=8)[0].mean()
        for x in (-0.5, 0.5)
    )
    assert lit > 0.01
    assert dark < 0.02 * lit


@pytest.mark.parametrize("method", [IndirectMethod.MARCH_GRID, IndirectMethod.DEEP_MARCH])
@pytest.mark.parametrize("size", [1e-3, 1e5])
def test_tiny_and_huge_scenes(shared_session, method, size):
    """A room of a millimetre and of a hundred kilometres look like one of 2 m, with cells of equal share in it; those
    that are chosen for it are rounded, and may be finer by up to a fifth."""
    matrix = np.diag([0.5 * size] * 3 + [1.0])
    for cell, limit in ((0.09, 0.02), (0.0, 0.1)):
        one, other = (
            shown(
                shared_session,
                placed(cornell(), change),
                seen_from(CORNELL_CAMERA, change),
                replace(SMALL, method=method, cell_size=cell * change[0, 0]),
                minimum_separation=0.5 * change[0, 0],
            )
            for change in (np.eye(4), matrix)
        )
        assert relative_difference(other, one) < limit


@every_method
def test_far_from_the_origin(shared_session, method):
    """10⁵ m away, where floats are 8 mm apart, the light is what it is here."""
    matrix = builders.translation(1e5, -1e5, 5e4)
    scene, indirect = lit_by_all(cornell(LAMP)), replace(SMALL, method=method)
    there = shown(shared_session, placed(scene, matrix), seen_from(CORNELL_CAMERA, matrix), indirect, samples=8)
    assert relative_difference(there, shown(shared_session, scene, indirect=indirect, samples=8)) < 0.05


def test_one_small_thing_on_a_large_plane(shared_session):
    """The grid has to be where the camera looks, not all over the plane."""
    room = cornell()
    plane = rectangle("plane", (0, 0, -1.01), (40, 0, 0), (0, 40, 0))
    picture = shown(shared_session, beside(room, (plane, builders.DIFFUSE)))
    alone = shown(shared_session, room)
    assert picture.sum() > 0.95 * alone.sum()


@every_method
def test_meshes_without_area(shared_session, method):
    """A point and a line change nothing."""
    room = lit_by_all(cornell(LAMP))
    corners = {"point": (0, 0, 0), "line": (0.1, 0.2, 0.3)}
    meshes = [builders.mesh(key, [(x, -0.5, 0) for x in xs], [(0, 1, 2)]) for key, xs in corners.items()]
    scene = beside(room, *((mesh, builders.DIFFUSE) for mesh in meshes))
    indirect = replace(SMALL, method=method)
    found, expected = (shown(shared_session, one, indirect=indirect) for one in (scene, room))
    assert relative_difference(found, expected) < 0.02


def test_a_hundred_thousand_tiny_triangles(shared_session):
    """Dust of 10⁵ triangles, needles and such without area among them; light stays below what the lamp gives."""
    generator = np.random.default_rng(5)
    corners = generator.uniform(-0.8, 0.8, (100_000, 1, 3)) + generator.uniform(-2e-3, 2e-3, (100_000, 3, 3))
    corners[:30_000, 2] = corners[:30_000, 1]
    dust = builders.mesh("dust", corners, np.arange(300_000), normals=generator.normal(size=(300_000, 3)))
    picture = shown(shared_session, beside(cornell(), (dust, builders.DIFFUSE)))
    assert np.median(picture) > 0.0
    assert picture.max() <= 5.0 * 1.01, "no more than the panel's radiance"


@every_method
@pytest.mark.parametrize(
    ("eye", "sees_the_lamp"),
    [((0.3, 0.3, -0.6), False), ((0.0, 1.0 - 1e-4, 0.0), True)],
    ids=["in a block", "at a wall"],
)
def test_a_camera_where_none_should_be(shared_session, method, eye, sees_the_lamp):
    """A block's inside has no more than all of the world's light, 0.3, reflected by half; the room has the lamp's."""
    camera = looking(eye, np.add(eye, (0.0, -1.0, 0.0)), half_width=1.0)
    picture = shown(shared_session, lit_by_all(cornell(LAMP)), camera, replace(SMALL, method=method), layers=2)
    assert (picture.max() > 0.5 * 0.3 * 1.001) == sees_the_lamp


@every_method
@pytest.mark.parametrize("size", [(1, 1), (1, 17), (33, 1), (31, 23)], ids=str)
@pytest.mark.parametrize("divisor", [1, 2, 4])
def test_odd_resolutions(shared_session, method, size, divisor):
    """Every pixel gets light, the last row and column as well."""
    scene = lit_by_all(cornell(LAMP))
    view = shared_session.show(
        scene,
        CORNELL_CAMERA,
        width=size[0],
        height=size[1],
        guard_band=3,
        indirect=replace(SMALL, method=method, divisor=divisor),
    )
    (picture,) = view.channels.values()
    assert picture.shape[:2] == size[::-1]
    assert np.isfinite(picture).all()


@every_method
def test_what_an_earlier_picture_left_behind_is_gone(session, method):
    """A view of a bright scene, then another of a dark one, as a viewport shows them: nothing of the first is left
    after one frame."""
    indirect = replace(SMALL, method=method)
    bright, dark = lit_by_all(cornell(replace(LAMP, emission=(1e6,) * 3))), cornell(replace(LAMP, emission=(1e-3,) * 3))
    elsewhere = looking((0.0, -2.0, 0.5), (0.5, 0.0, -0.5))
    expected = radiance(session, dark, elsewhere, indirect, samples=4)
    session.show(bright, CORNELL_CAMERA, Sequence(continuous=True), width=48, height=48, indirect=indirect, samples=2)
    found = radiance(session, dark, elsewhere, indirect, samples=4, sequence=Sequence(continuous=True))
    assert found.mean() < 1.2 * max(expected.mean(), 1e-6)
