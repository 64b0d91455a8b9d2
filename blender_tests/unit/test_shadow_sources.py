# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever a light shines on in the picture lies on the map that the shader looks it up in."""

from dataclasses import replace
from math import inf, pi, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_receivers import SEEDS, TILE, any_camera, seen_points, tiles_of

from addon.render.atlas import Slot
from addon.render.light_reach import extent
from addon.render.lighting import lamp_point, sun_direction
from addon.render.lighting_plan import LightPlan
from addon.render.memory import Memory
from addon.render.mesh_lights import mesh_lights
from addon.render.receivers import visible_receivers
from addon.render.shadow_sources import shadow_sources
from addon.render.shadow_table import shadow_row
from addon.render.shadow_views import NARROWEST, look_along
from addon.scene import ALL_GROUPS, AreaShape, Light, LightKind
from blender_tests import builders

LARGEST = 512
NO_CASTERS = np.zeros((0, 2, 3))


def smooth_picture(generator, width, height):
    """View depths (1, height, width) of a tilted surface, some of it missing; often a small part of what is around."""
    y, x = np.mgrid[:height, :width] / max(width, height)
    slope = generator.normal(size=2) * 10.0 ** generator.uniform(-3.0, 0.3)
    depths = 10.0 ** generator.uniform(-1.0, 2.0) * np.maximum(1.0 + slope[0] * x + slope[1] * y, 0.05)
    depths[generator.random(depths.shape) < generator.choice([0.0, 0.9])] = inf
    return depths[None].astype(np.float32)


def any_rotation(generator):
    """(3, 3), proper."""
    rotation, _ = np.linalg.qr(generator.normal(size=(3, 3)))
    return rotation * np.sign(np.linalg.det(rotation))


def any_light(generator, kind, near):
    """A light of a kind somewhere about points `near` (N, 3)."""
    center = near[generator.integers(len(near))]
    size = max(float(np.ptp(near, axis=0).max()), 1e-3)
    pose = np.eye(4)
    pose[:3, :3] = any_rotation(generator)
    pose[:3, 3] = center + generator.normal(size=3) * size * 10.0 ** generator.uniform(-2.0, 0.5)
    radius = float(generator.choice([0.0, size * 10.0 ** generator.uniform(-3.0, 0.0)]))
    angles = {LightKind.SPOT: generator.uniform(0.01, pi), LightKind.SUN: generator.uniform(0.0, 0.5)}
    return Light(
        "light",
        "light",
        kind,
        pose,
        (1.0, 1.0, 1.0),
        radius=0.0 if kind in (LightKind.AREA, LightKind.SUN) else radius,
        angle=float(angles.get(kind, 0.0)),
        blend=float(generator.random()),
        shape=generator.choice(list(AreaShape)),
        size=tuple(size * 10.0 ** generator.uniform(-2.0, 0.0, 2)),
        spread=float(generator.uniform(0.002, pi)),
        soft_falloff=bool(generator.random() < 0.5),
    )


def any_offset(generator, light):
    """A place (3,) on the light, as `Lighting.samples` has it: in the square, disk or ball."""
    offset = generator.normal(size=3)
    offset *= generator.random() ** (1.0 / 3.0) / np.linalg.norm(offset)
    if light.kind is not LightKind.AREA:
        return offset
    if light.shape is AreaShape.RECTANGLE:
        offset = generator.uniform(-1.0, 1.0, 3)
    return offset * (1.0, 1.0, 0.0)


def across(axes, vector):
    """The part of a vector (3,) across unit axes (N, 3)."""
    return vector - axes * (axes @ vector)[:, None]


def sampled_direction(light, offset, points):
    """(N, 3) unit, from points (N, 3) to where `common/lights.glsl` samples a point or spot light."""
    to_light = light.world_from_light[:3, 3] - points
    distance = np.linalg.norm(to_light, axis=1, keepdims=True)
    axis = to_light / distance
    on_disk = across(axis, offset)
    if light.soft_falloff:
        towards = to_light + light.radius * on_disk
        return towards / np.linalg.norm(towards, axis=1, keepdims=True)
    half = np.arcsin(np.minimum(light.radius / distance[:, 0], 1.0))
    share = (on_disk**2).sum(axis=1)
    drop = share * 2.0 * np.sin(0.5 * half) ** 2
    aside = on_disk * np.sqrt(drop * (2.0 - drop) / np.maximum(share, 1e-300))[:, None]
    return aside + axis * (1.0 - drop)[:, None]


def is_lit(light, offset, point, points):
    """(N,) whether a light's sample sends anything to points (N, 3), by its cone, its spread and the side it faces."""
    axis = -light.world_from_light[:3, 2]
    if light.kind is LightKind.SPOT:
        lit = sampled_direction(light, offset, points) @ -axis > np.cos(0.5 * light.angle) + 1e-9
        # So near that its points are seen at right angles to its axis, a single map from one of them shows nothing.
        distance = np.linalg.norm(points - light.world_from_light[:3, 3], axis=1)
        return lit & (light.radius < distance * np.sin(0.25 * (pi - light.angle)))
    if light.kind is LightKind.AREA:
        away = points - point
        cosine = away @ axis / np.linalg.norm(away, axis=1)
        return cosine > np.cos(min(0.5 * light.spread, 0.5 * pi)) + 1e-9
    return np.ones(len(points), np.bool_)


def within_cone(light, points, point):
    """Points (N, 3) in front of a spot, drawn to the square about its cone.

    One with a radius lights some that are a little aside of that, as seen from its sampled point, for its cone is
    asked for another direction. They have the nearest texel.
    """
    frame = look_along(-light.world_from_light[:3, 2])
    view = (points - point) @ frame
    depth = np.maximum(-view[:, 2], 1e-9)
    half = tan(max(0.5 * light.angle, NARROWEST))
    across = np.clip(view[:, :2] / depth[:, None], -half, half)
    return np.column_stack([across * depth[:, None], -depth]) @ frame.T + point


def looked_up(source, maps, point, points, origin):
    """(N,) whether `find_map` of `common/shadows.glsl` finds each point (N, 3) on a map; faces of a cube never ask."""
    rows = [None if item is None else shadow_row(item.camera, Slot(0, 0, 0, item.size), origin, 0.0) for item in maps]
    relative = np.column_stack([points - origin, np.ones(len(points))])
    found = np.zeros(len(points), np.bool_)
    away = points - point
    axis = np.abs(away).argmax(axis=1)
    face = 2 * axis + (away[np.arange(len(points)), axis] < 0.0)
    for index, row in enumerate(rows):
        if row is None:
            continue
        projected = relative @ row[:4].astype(np.float64).T
        with np.errstate(divide="ignore", invalid="ignore"):
            place = projected[:, :3] / projected[:, 3:]
        size = row[4, 2]
        margin = -1e-3 if source.is_cube else 1.0 - 1e-3
        on_map = ((place[:, :2] >= margin) & (place[:, :2] <= size - margin)).all(axis=1)
        if not source.is_cube:
            on_map &= place[:, 2] > 0.0
        found |= on_map & (face == index) if source.is_cube else on_map
    return found


def assert_all_looked_up(camera, depths, source, point, lit, reach=inf, spot=None):
    """Every point of the picture that the light reaches is found on a map; returns how many there are."""
    _, height, width = depths.shape
    receivers = visible_receivers(tiles_of(depths), TILE, camera, (width, height), 2.0)
    points, _ = seen_points(camera, depths, 0.0)
    reached = lit(points)
    if source.center is not None:
        reached &= np.linalg.norm(points - source.center, axis=1) < reach
        reached &= np.linalg.norm(points - point, axis=1) > 1e-6 * np.abs(points).max()
    maps = source.maps(point, receivers, NO_CASTERS, LARGEST, reach)
    asked = within_cone(spot, points, point) if spot and not source.is_cube else points
    found = looked_up(source, maps, point, asked, camera.position)
    assert found[reached].all(), f"{(~found[reached]).sum()} of {reached.sum()} are beside {len(maps)} maps"
    for item in maps:
        if item is not None:
            assert item.size & (item.size - 1) == 0
            assert 0 < item.size <= LARGEST
            assert item.camera.clip_start >= 0.0
    return int(reached.sum())


@pytest.mark.parametrize("kind", list(LightKind))
@given(st.booleans(), st.booleans(), SEEDS)
def test_what_a_lamp_shines_on_is_on_its_maps(kind, orthographic, limited, seed):
    generator = np.random.default_rng(seed)
    camera = any_camera(generator, orthographic=orthographic)
    depths = smooth_picture(generator, 48, 40)
    if not np.isfinite(depths).any():
        return
    points, _ = seen_points(camera, depths, 0.0)
    light = any_light(generator, kind, points)
    (source,) = shadow_sources(LightPlan((light,), reach=(inf,), casts_shadows=True))
    offset = any_offset(generator, light)
    point = lamp_point(light, offset)
    distance = np.linalg.norm(points - light.world_from_light[:3, 3], axis=1)
    reach = float(np.quantile(distance, generator.random())) if limited and kind is not LightKind.SUN else inf
    spot = light if kind is LightKind.SPOT else None
    assert_all_looked_up(camera, depths, source, point, lambda at: is_lit(light, offset, point, at), reach, spot)


@given(st.booleans(), SEEDS)
def test_what_an_emissive_surface_shines_on_is_on_its_maps(orthographic, seed):
    generator = np.random.default_rng(seed)
    camera = any_camera(generator, orthographic=orthographic)
    depths = smooth_picture(generator, 48, 40)
    if not np.isfinite(depths).any():
        return
    points, _ = seen_points(camera, depths, 0.0)
    matrix = np.eye(4)
    matrix[:3, :3] = any_rotation(generator) * np.ptp(points, axis=0).max() * 10.0 ** generator.uniform(-2.0, 0.0)
    matrix[:3, 3] = points[generator.integers(len(points))] + generator.normal(size=3) * np.ptp(points, axis=0).max()
    material = builders.material("glow", emission=(1, 1, 1))
    quad = builders.quad("q", center=generator.normal(size=2))
    batches = [builders.batch("q", [matrix], materials=("glow",))]
    surfaces, _ = mesh_lights(builders.scene(quad, materials=(material,), batches=batches), 0.5, Memory())
    (source,) = shadow_sources(LightPlan((), surfaces, casts_shadows=True))
    point, _ = surfaces[0].surface.point(generator.random(2))
    assert_all_looked_up(camera, depths, source, point, lambda at: np.ones(len(at), np.bool_))


@given(st.booleans(), SEEDS)
def test_all_that_is_seen_is_on_a_map_of_the_worlds_directions(orthographic, seed):
    generator = np.random.default_rng(seed)
    camera = any_camera(generator, orthographic=orthographic)
    depths = smooth_picture(generator, 48, 40)
    sources = shadow_sources(LightPlan(world_directions=2, casts_shadows=True))
    assert [source.index for source in sources] == [0, 1]
    direction = any_rotation(generator)[:, 0]
    assert_all_looked_up(camera, depths, sources[1], direction, lambda at: np.ones(len(at), np.bool_))


def test_each_light_that_casts_shadows_has_a_source():
    lamps = (
        builders.light(),
        builders.light(LightKind.SUN, blocker_groups=0b101, shadow_texel=0.25),
        builders.light(casts_shadow=False),
        builders.light(LightKind.SPOT, radius=0.3, angle=1.0),
        builders.light(LightKind.AREA, size=(3.0, 4.0), spread=1.0, shadow_texel=0.5),
        builders.light(LightKind.SPOT, angle=3.0),
    )
    material = builders.material("glow", emission=(1, 1, 1))
    quad = builders.quad("q")
    batches = [builders.batch("q", materials=("glow",))]
    surfaces, _ = mesh_lights(builders.scene(quad, materials=(material,), batches=batches), 0.5, Memory())
    sources = shadow_sources(LightPlan(lamps, surfaces, (inf,) * len(lamps), world_directions=2, casts_shadows=True))
    assert [source.index for source in sources] == [0, 1, 3, 4, 5, 6, 7, 8]
    point, sun, spot, area, wide, surface, *world = sources
    assert point.is_cube
    assert wide.is_cube
    assert surface.is_cube
    assert not any(source.is_cube for source in (sun, spot, area, *world))
    assert (sun.center, sun.blocker_groups, sun.texel) == (None, 0b101, 0.25)
    assert (area.extent, area.texel, area.blocker_groups) == (2.5, 0.5, ALL_GROUPS)
    assert surface.extent == pytest.approx(2.0**0.5)
    assert all(source.center is None for source in world)


@given(SEEDS, st.sampled_from([LightKind.POINT, LightKind.SPOT, LightKind.AREA]))
def test_no_point_of_a_light_is_farther_from_its_middle_than_its_extent(seed, kind):
    generator = np.random.default_rng(seed)
    light = any_light(generator, kind, generator.normal(size=(4, 3)))
    (source,) = shadow_sources(LightPlan((light,), reach=(inf,), casts_shadows=True))
    points = np.array([lamp_point(light, any_offset(generator, light)) for _ in range(100)])
    away = np.linalg.norm(points - source.center, axis=1)
    assert (away <= source.extent * (1.0 + 1e-9)).all()
    assert source.extent == extent(light)


@given(SEEDS, st.floats(0.0, pi))
def test_the_suns_points_are_directions_within_its_disc(seed, angle):
    """Uniform in solid angle: 1 − cos is to its greatest value as r² of the disk is to 1."""
    generator = np.random.default_rng(seed)
    axis = any_rotation(generator)[:, 0]
    offset = any_offset(generator, builders.light())
    direction = sun_direction(axis, 0.5 * angle, offset)
    assert np.linalg.norm(direction) == pytest.approx(1.0)
    share = ((offset - axis * (axis @ offset)) ** 2).sum()
    assert 1.0 - direction @ axis == pytest.approx(share * (1.0 - np.cos(0.5 * angle)), abs=1e-12)


@pytest.mark.parametrize("kind", list(LightKind))
def test_where_nothing_is_seen_there_is_no_map(kind):
    camera = any_camera(np.random.default_rng(0), orthographic=False)
    tiles = tiles_of(np.full((1, 20, 20), inf, np.float32))
    receivers = visible_receivers(tiles, TILE, camera, (20, 20), 2.0)
    light = builders.light(kind, angle=1.0, size=(1.0, 1.0))
    (source,) = shadow_sources(LightPlan((light,), reach=(inf,), casts_shadows=True))
    assert source.maps(lamp_point(light, np.zeros(3)), receivers, NO_CASTERS, LARGEST, inf) == ()


def test_what_a_light_does_not_reach_has_no_map():
    camera = builders.camera(z=0.0, half_width=0.1)
    depths = np.full((1, 32, 32), 10.0, np.float32)
    receivers = visible_receivers(tiles_of(depths), TILE, camera, (32, 32), 2.0)
    light = builders.light(position=(0.0, 0.0, 0.0))
    (source,) = shadow_sources(LightPlan((light,), reach=(inf,), casts_shadows=True))
    center = np.zeros(3)
    assert source.maps(center, receivers, NO_CASTERS, LARGEST, 5.0) == ()
    assert sum(item is not None for item in source.maps(center, receivers, NO_CASTERS, LARGEST, 15.0)) == 1
    spot = replace(light, kind=LightKind.SPOT, angle=1.0)
    turned = replace(spot, world_from_light=np.diag([1.0, -1.0, -1.0, 1.0]))
    for lamp, count in ((spot, 1), (turned, 0)):
        (source,) = shadow_sources(LightPlan((lamp,), reach=(inf,), casts_shadows=True))
        assert len(source.maps(center, receivers, NO_CASTERS, LARGEST, inf)) == count
