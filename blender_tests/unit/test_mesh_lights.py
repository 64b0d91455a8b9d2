# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.render.memory import Memory
from addon.render.mesh_lights import GREATEST_COUNT, SMALLEST_SHARE, mesh_lights
from addon.render.surfaces import SlotSurface, Surface
from addon.scene import EmissionSampling, SlotRange
from blender_tests import builders

THRESHOLD = 0.5


def glowing(key="glow", emission=(1.0, 2.0, 0.5), **arguments):
    """A material that shines."""
    return builders.material(key, emission=emission, **arguments)


def lights_of(*meshes, materials=(), batches=None, memory=None):
    """(sampled, left out) of a scene whose meshes all have the first material unless batches say otherwise."""
    materials = materials or (glowing(),)
    batches = batches or [builders.batch(item.key, materials=(materials[0].key,)) for item in meshes]
    return mesh_lights(builders.scene(*meshes, materials=materials, batches=batches), THRESHOLD, memory or Memory())


def soup(generator, count, key="soup"):
    """Loose triangles."""
    positions = generator.normal(size=(3 * count, 3)) * generator.lognormal(size=(3 * count, 1))
    return builders.mesh(key, positions, np.arange(3 * count))


@settings(max_examples=20)
@given(st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_points_are_uniform_over_the_area(count, seed):
    """Their mean is the surface's, within 5 standard errors, and each lies on the plane of its normal."""
    (light,), _ = lights_of(soup(np.random.default_rng(seed), count))
    generator = np.random.default_rng(seed + 1)
    u = generator.random((1500, 3))
    points, normals = (np.array(item) for item in zip(*(light.surface.point(row) for row in u), strict=True))
    spread = points.std(axis=0) / sqrt(len(points))
    assert (np.abs(points.mean(axis=0) - light.surface.center) <= 5.0 * spread + 1e-6).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-12)
    index = np.minimum(np.searchsorted(light.surface.cumulative, u[:, 0], side="right"), count - 1)
    away = ((points - np.array([light.surface.triangle(at)[0] for at in index])) * normals).sum(axis=1)
    assert np.abs(away).max() <= 1e-12 * light.surface.radius
    assert np.linalg.norm(points - light.surface.center, axis=1).max() <= light.surface.radius * (1.0 + 1e-12)


@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_points_fill_a_triangle_evenly(seed):
    """Barycentric coordinates of points uniform in a triangle: mean ⅓, variance 1/18, covariance −1/36."""
    (light,), _ = lights_of(soup(np.random.default_rng(seed), 1))
    u = (np.indices((48, 48)).reshape(2, -1).T + 0.5) / 48
    points = np.array([light.surface.point(row)[0] for row in u])
    a, b, c = light.surface.triangle(0)
    edges = np.stack([b - a, c - a], axis=1)
    coordinates = np.linalg.lstsq(edges, (points - a).T, rcond=None)[0]
    assert coordinates.min() >= -1e-6
    assert coordinates.sum(axis=0).max() <= 1.0 + 1e-6
    np.testing.assert_allclose(coordinates.mean(axis=1), 1.0 / 3.0, atol=2e-3)
    np.testing.assert_allclose(np.cov(coordinates), [[1 / 18, -1 / 36], [-1 / 36, 1 / 18]], atol=2e-3)


@pytest.mark.parametrize("u", [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (np.nextafter(1.0, 0.0),) * 3])
def test_points_at_the_ends_lie_on_the_surface(u):
    (light,), _ = lights_of(builders.quad("glow"))
    point, normal = light.surface.point(np.array(u))
    assert (np.abs(point) <= (1.0, 1.0, 0.0)).all()
    np.testing.assert_array_equal(normal, (0, 0, 1))


def test_area_power_and_sides():
    quad = builders.quad("glow", half=0.5)
    for sampling, front, back in (
        (EmissionSampling.AUTO, True, True),
        (EmissionSampling.FRONT, True, False),
        (EmissionSampling.BACK, False, True),
        (EmissionSampling.FRONT_BACK, True, True),
    ):
        (light,), left = lights_of(quad, materials=(glowing(emission_sampling=sampling),))
        assert (light.front, light.back, left) == (front, back, ())
        assert light.surface.area == pytest.approx(1.0)
        assert light.power == pytest.approx(pi * 2.0 * (front + back))
        assert light.marked == (sampling is not EmissionSampling.AUTO)


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_an_instance_is_where_it_is_placed_and_a_mirrored_one_keeps_its_front(seed, mirrored):
    generator = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3, :3], _ = np.linalg.qr(generator.normal(size=(3, 3)))
    matrix[:3, :3] *= np.sign(np.linalg.det(matrix[:3, :3])) * generator.uniform(0.1, 5.0)
    if mirrored:
        matrix[:3, :3] @= np.diag([-1.0, 1.0, 1.0])
    matrix[:3, 3] = generator.uniform(-1e4, 1e4, 3)
    quad = builders.quad("glow", half=1.0)
    (light,), _ = lights_of(quad, batches=[builders.batch("glow", [matrix], materials=("glow",))])
    scale = abs(np.linalg.det(matrix[:3, :3])) ** (1.0 / 3.0)
    assert light.surface.area == pytest.approx(4.0 * scale**2)
    np.testing.assert_allclose(light.surface.center, matrix[:3, 3], atol=1e-6)
    # Normals go by the inverse transposed, which mirrors them as little as it does the front.
    front = np.linalg.inv(matrix[:3, :3]).T @ (0.0, 0.0, 1.0)
    np.testing.assert_allclose(
        light.surface.point(np.array([0.3, 0.4, 0.5]))[1], front / np.linalg.norm(front), atol=1e-9
    )


def test_triangles_without_area_are_never_chosen():
    flat = builders.mesh(
        "flat", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0)], [(0, 1, 3), (0, 0, 0), (0, 1, 2), (1, 1, 2), (3, 1, 0)]
    )
    (light,), _ = lights_of(flat)
    assert light.surface.area == 0.5
    assert set(light.surface.cumulative.tolist()) == {0.0, 1.0}
    assert light.surface.radius == pytest.approx(sqrt(5.0) / 3.0), "only of the triangle that has an area"
    for share in (0.0, 0.5, np.nextafter(1.0, 0.0)):
        np.testing.assert_array_equal(light.surface.point(np.array([share, 0.5, 0.5]))[1], (0, 0, 1))
    point, normal = light.surface.point(np.array([1.0, 0.5, 0.5]))
    assert np.isfinite([point, normal]).all()
    assert lights_of(builders.mesh("none", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)])) == ((), ())


@pytest.mark.parametrize("size", [1e-18, 1e-6, 1e6, 1e18])
def test_any_size_is_finite(size):
    (light,), _ = lights_of(builders.quad("glow", half=size))
    assert light.surface.area == pytest.approx(4.0 * size**2, rel=1e-6)
    point, normal = light.surface.point(np.array([0.7, 0.2, 0.9]))
    assert (np.abs(point[:2]) <= size * (1 + 1e-6)).all()
    np.testing.assert_array_equal(normal, (0, 0, 1))


def many(areas, **arguments):
    """(sampled, left out) of one quad per area (m²)."""
    quads = [builders.quad(f"q{index:03}", half=0.5 * sqrt(area)) for index, area in enumerate(areas)]
    return lights_of(*quads, materials=(glowing(**arguments),))


def test_the_faint_are_left_to_indirect_light():
    sampled, left = many([1.0, 1.5 * SMALLEST_SHARE, 0.5 * SMALLEST_SHARE])
    assert [light.surface.area for light in sampled] == pytest.approx([1.0, 1.5 * SMALLEST_SHARE])
    assert [light.surface.area for light in left] == pytest.approx([0.5 * SMALLEST_SHARE])


@given(st.lists(st.floats(1e-6, 1e6), min_size=1, max_size=40), st.booleans())
def test_every_emissive_surface_is_sampled_or_named(areas, is_marked):
    sampling = EmissionSampling.FRONT if is_marked else EmissionSampling.AUTO
    sampled, left = many(areas, emission_sampling=sampling)
    keys = [light.key for light in (*sampled, *left)]
    assert len(set(keys)) == len(keys) == len(areas)
    assert len(sampled) == len(areas) if is_marked else 1 <= len(sampled) <= GREATEST_COUNT
    powers = [light.power for light in (*sampled, *left)]
    assert powers == sorted(powers, reverse=True)


@pytest.mark.parametrize("count", [GREATEST_COUNT, GREATEST_COUNT + 5, 3 * GREATEST_COUNT])
def test_every_marked_instance_is_sampled(count):
    matrices = [builders.translation(x=float(index)) for index in range(count)]
    batches = [builders.batch("glow", matrices, materials=("glow",))]
    material = glowing(emission_sampling=EmissionSampling.FRONT_BACK)
    sampled, left = lights_of(builders.quad("glow", half=0.1), materials=(material,), batches=batches)
    assert sorted(light.surface.center[0] for light in sampled) == pytest.approx(np.arange(count))
    assert left == ()


def test_of_many_instances_the_largest_are_sampled():
    matrices = [np.diag([size, size, size, 1.0]) for size in np.linspace(1.0, 2.0, 50)]
    sampled, left = lights_of(builders.quad("glow"), batches=[builders.batch("glow", matrices, materials=("glow",))])
    areas = [light.surface.area for light in sampled]
    assert areas == pytest.approx(4.0 * np.linspace(1.0, 2.0, 50)[: -GREATEST_COUNT - 1 : -1] ** 2)
    assert left, "the others are named"


def test_marked_surfaces_come_first_and_others_only_up_to_the_limit():
    materials = (glowing("auto", (100.0,) * 3), glowing("marked", emission_sampling=EmissionSampling.FRONT))
    quads = [builders.quad(f"q{index:02}", half=0.5) for index in range(2 * GREATEST_COUNT)]
    batches = [
        builders.batch(quad.key, materials=("marked" if index % 4 == 0 else "auto",))
        for index, quad in enumerate(quads)
    ]
    sampled, left = lights_of(*quads, materials=materials, batches=batches)
    marked = GREATEST_COUNT // 2
    assert [light.marked for light in sampled] == [True] * marked + [False] * (GREATEST_COUNT - marked)
    assert len(left) == GREATEST_COUNT


def test_none_and_what_is_not_there_shine_on_nothing():
    quad = builders.quad("glow")
    assert lights_of(quad, materials=(glowing(emission_sampling=EmissionSampling.NONE),)) == ((), ())
    assert lights_of(quad, materials=(glowing(emission=(0.0, 0.0, 0.0)),)) == ((), ())
    assert lights_of(quad, materials=(glowing(alpha=0.9 * THRESHOLD),)) == ((), ())
    assert len(lights_of(quad, materials=(glowing(alpha=THRESHOLD),))[0]) == 1


def test_each_slot_is_a_light_of_its_own():
    quad = replace(builders.quad("q"), slots=(SlotRange(0, 0, 1), SlotRange(1, 1, 1)))
    materials = (glowing("a"), builders.material("dark"), glowing("b", (3.0, 0.0, 0.0)))
    for names, emissions in ((("a", "b"), {(1.0, 2.0, 0.5), (3.0, 0.0, 0.0)}), (("dark", "b"), {(3.0, 0.0, 0.0)})):
        sampled, _ = lights_of(quad, materials=materials, batches=[builders.batch("q", materials=names)])
        assert {light.emission for light in sampled} == emissions
        assert all(light.surface.area == pytest.approx(2.0) for light in sampled)
    sampled, _ = lights_of(quad, materials=materials, batches=[builders.batch("q", materials=("a",))])
    assert len(sampled) == 2, "the last material goes on to slots that have none"


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_a_uniformly_scaled_surface_is_as_one_that_is_worked_out(seed, mirrored):
    """Area, shares, centre and radius from those of the mesh are those of its triangles where they are."""
    generator = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3, :3] = np.linalg.qr(generator.normal(size=(3, 3)))[0] * generator.uniform(0.01, 100.0)
    matrix[:3, 0] *= -1.0 if mirrored else 1.0
    matrix[:3, 3] = generator.normal(size=3)
    mesh = soup(generator, 7)
    (light,), _ = lights_of(mesh, batches=[builders.batch("soup", [matrix], materials=("glow",))])
    placed = Surface(SlotSurface(mesh, mesh.slots[0]), matrix)
    assert light.surface.area == pytest.approx(placed.area)
    np.testing.assert_allclose(light.surface.cumulative, placed.cumulative, atol=1e-6)
    np.testing.assert_allclose(light.surface.center, placed.center, atol=1e-5 * placed.radius)
    assert light.surface.radius == pytest.approx(placed.radius, rel=1e-5)


@given(st.integers(0, 2**32 - 1))
def test_an_unevenly_scaled_surface_has_the_area_of_its_triangles(seed):
    generator = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3, :3] = generator.normal(size=(3, 3))
    (light,), _ = lights_of(soup(generator, 5), batches=[builders.batch("soup", [matrix], materials=("glow",))])
    areas = []
    for index in range(5):
        a, b, c = light.surface.triangle(index)
        areas.append(0.5 * np.linalg.norm(np.cross(b - a, c - a)))
    assert light.surface.area == pytest.approx(sum(areas))
    np.testing.assert_allclose(light.surface.cumulative, np.cumsum(areas) / sum(areas), atol=1e-6)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 6.0))
def test_float32_puts_no_triangle_farther_off_than_the_rounding_allows(seed, far):
    """By a sixth at least: places as the shaders compute them, `relative_to`, in any order of the sum."""
    generator = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3, :3] = generator.normal(size=(3, 3))
    mesh = soup(generator, 5)
    mesh = replace(mesh, positions=(mesh.positions + generator.normal(size=3) * 10.0**far).astype(np.float32))
    (light,), _ = lights_of(mesh, batches=[builders.batch("soup", [matrix], materials=("glow",))])
    rows = matrix[:3, :3].astype(np.float32)
    exact = mesh.positions.astype(np.float64) @ matrix[:3, :3].T
    for order in ((0, 1, 2), (2, 1, 0), (1, 2, 0)):
        x, y, z = (rows[:, axis] * mesh.positions[:, axis, None] for axis in order)
        error = np.linalg.norm((x + y + z).astype(np.float64) - exact, axis=1).max()
        assert error <= light.surface.rounding / 6.0


def test_what_did_not_change_is_not_worked_out_again():
    quad, bent = builders.quad("quad"), builders.quad("bent", half=0.9)
    materials, memory = (glowing(),), Memory()
    batches = [builders.batch(mesh.key, materials=("glow",)) for mesh in (quad, bent)]
    scenes = [
        builders.scene(quad, bent, materials=materials, batches=batches),
        builders.scene(quad, bent, materials=materials, batches=[batches[0], replace(batches[1], version=2)]),
    ]
    first, second = (mesh_lights(scene, THRESHOLD, memory)[0] for scene in scenes)
    assert first is mesh_lights(scenes[0], THRESHOLD, memory)[0]
    assert [one.surface is other.surface for one, other in zip(first, second, strict=True)] == [True, False]


def test_a_scene_from_memory_is_lit_by_what_it_is_made_of():
    """However many scenes came before: one with other lights, one without any, one with another threshold."""
    memory = Memory()
    for size, emission in ((1.0, (1, 1, 1)), (2.0, (1, 1, 1)), (1.0, (5, 5, 5)), (1.0, (0, 0, 0)), (1.0, (1, 1, 1))):
        arguments = {"materials": (glowing(emission=emission),)}
        with_memory, fresh = (
            lights_of(builders.quad("quad", half=size), memory=each, **arguments)[0] for each in (memory, Memory())
        )
        assert [(light.power, light.key) for light in with_memory] == [(light.power, light.key) for light in fresh]
        memory.forget_unused()
