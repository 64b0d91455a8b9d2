# SPDX-License-Identifier: GPL-3.0-or-later
"""Who lights and shadows whom: pictures against rays that are cast at every triangle."""

from dataclasses import replace

import numpy as np
import pytest
from random_scenes import fresh, furnished, random_camera, random_scene

from addon.render.readback import positions
from addon.scene import (
    ALL_GROUPS,
    BaseColorSource,
    Channel,
    EmissionSampling,
    Image,
    ImageTexture,
    Interpolation,
    LightKind,
    Sequence,
    Variant,
)
from addon.scene.versions import new_version
from blender_tests import builders

SIDE = 48
SETTINGS = {"width": SIDE, "height": SIDE, "samples": 2}
"""Two samples: the first of a single one would be a preview. Without pixel filter both see the same points."""

ABOVE = builders.camera(z=6.0, half_width=2.0 / 6.0)
"""Sees 4×4 m of the floor."""


def casting_triangles(scene):
    """(T, 3, 3) world space, of all that casts shadows."""
    found = [np.zeros((0, 3, 3))]
    for batch in scene.batches:
        if batch.casts_shadow:
            mesh = scene.meshes[batch.mesh]
            corners = mesh.positions[mesh.triangles].astype(np.float64)
            found += [corners @ matrix[:3, :3].T + matrix[:3, 3] for matrix in batch.matrices]
    return np.concatenate(found)


def blocked(points, light, triangles):
    """(N,) whether a triangle is between points (N, 3) and a place (3,) (Möller and Trumbore 1997)."""
    a = triangles[:, 0]
    ab, ac = triangles[:, 1] - a, triangles[:, 2] - a
    ray = light - points
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = np.cross(ray[:, None], ac)
        scale = 1.0 / (cross * ab).sum(axis=-1)
        aside = points[:, None] - a
        u = (aside * cross).sum(axis=-1) * scale
        other = np.cross(aside, ab)
        v = (other * ray[:, None]).sum(axis=-1) * scale
        along = (other * ac).sum(axis=-1) * scale
    hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (along > 0.0) & (along < 1.0 - 1e-6)
    return hit.any(axis=1)


def certain(points, normals, light, triangles, margin):
    """(N,) whether a place (3,) is seen from points (N, 3), and (N,) whether from all `margin` (N,) m around, too."""
    towards = np.eye(3)[np.abs(normals).argmin(axis=1)]
    tangent = np.cross(normals, towards)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = np.cross(normals, tangent)
    start = points + 2e-3 * normals
    middle = blocked(start, light, triangles)
    same = np.ones(len(points), np.bool_)
    for angle in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False):
        aside = np.cos(angle) * tangent + np.sin(angle) * bitangent
        same &= blocked(start + margin[:, None] * aside, light, triangles) == middle
    return ~middle, same


def assert_shadowed(view, bare, scene, camera, light, least=0.3):
    """Every layer is the light's without shadows times its visibility, but for two texels along the shadows' edges.

    Of the pixels that edges leave, at least `least` of all lit ones, 99 % agree: thin tips are seen by few rays.
    """
    place = light.world_from_light[:3, 3]
    triangles = casting_triangles(scene)
    compared = wrong = lit = shadowed = 0
    for layer, unshadowed in zip(view.layers, bare.layers, strict=True):
        bright = unshadowed.radiance.max(axis=-1) > 1e-4
        if not bright.any():
            continue
        points = positions(layer.depth, camera)[bright].astype(np.float64)
        normals = layer.normal[bright].astype(np.float64)
        pixel = (camera.window[1] - camera.window[0]) / SIDE * (1.0 if camera.orthographic else layer.depth[bright])
        cosine = np.abs(normals @ camera.rotation[:, 2]).clip(0.1)
        seen, sure = certain(points, normals, place, triangles, 2.0 * pixel / cosine + 5e-3)
        expected = unshadowed.radiance[bright] * seen[:, None]
        agrees = np.isclose(layer.radiance[bright], expected, rtol=1e-3, atol=1e-6).all(axis=-1)
        lit, compared = lit + len(points), compared + int(sure.sum())
        wrong, shadowed = wrong + int((sure & ~agrees).sum()), shadowed + int((sure & ~seen).sum())
    assert compared > least * lit
    assert 0 < shadowed < compared
    assert wrong <= 1 + 0.01 * compared, f"{wrong} of {compared} pixels"


def deep_views(session, scene, camera, **settings):
    """Views with and without shadows, with all layers."""
    settings = SETTINGS | {"deep_output": True} | settings
    bare = replace(scene, lights=tuple(replace(light, casts_shadow=False) for light in scene.lights))
    return (session.show(item, camera, Sequence(), **settings) for item in (scene, bare))


@pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("seed", [3, 8])
def test_all_layers_of_a_jumble_are_shadowed_right(shared_session, orthographic, seed):
    """Sixty triangles and eight boxes in all directions about a lamp; three layers of what is seen."""
    generator = np.random.default_rng(seed)
    light = builders.light(position=tuple(generator.uniform((-1.0, -1.0, 1.5), (1.0, 1.0, 3.5))), emission=(50, 50, 50))
    scene = replace(random_scene(generator), lights=(light,))
    camera = replace(random_camera(generator, orthographic), window=(-2, 2, -2, 2) if orthographic else (-0.6, 0.6) * 2)
    view, bare = deep_views(shared_session, scene, camera, layers=3, minimum_separation=0.05)
    assert len(view.layers) == 3
    assert_shadowed(view, bare, scene, camera, light)


@pytest.mark.parametrize("variant", [Variant.TWO_PASS, Variant.REPROJECT])
def test_layers_behind_are_shadowed_by_those_before_them(shared_session, variant):
    """Sheets above one another: only the uppermost has light, whoever generates the layers."""
    sheets = [builders.quad(f"sheet {k}", z=-0.5 * k, half=3.0) for k in range(3)]
    light = builders.light(position=(0.3, 0.2, 4.0))
    scene = fresh(builders.scene(*sheets, lights=(light,)))
    band = 8 if variant is Variant.REPROJECT else 0
    settings = {"layers": 3, "minimum_separation": 0.1, "variant": variant, "guard_band": band}
    view, bare = deep_views(shared_session, scene, builders.camera(half_width=0.3), **settings)
    assert all(layer.radiance.all() for layer in bare.layers)
    np.testing.assert_allclose(view.layers[0].radiance, bare.layers[0].radiance, rtol=1e-5)
    assert not view.layers[1].radiance.any()
    assert not view.layers[2].radiance.any()


def shadow_of(session, scene, camera=ABOVE, **settings):
    """(H, W) COMBINED, green, over that without shadows; NaN where that is dark."""
    settings = SETTINGS | settings
    bare = replace(scene, lights=tuple(replace(light, casts_shadow=False) for light in scene.lights))
    shadowed, unshadowed = (
        session.show(item, camera, Sequence(), **settings).channels[Channel.COMBINED][..., 1] for item in (scene, bare)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        return shadowed / unshadowed


def floor_under(*batches, meshes=(), lights=None, materials=(builders.DIFFUSE,), images=()):
    """A floor, a lamp 4 m above it and things in between, which no camera sees."""
    lights = lights or (builders.light(position=(0.0, 0.0, 4.0), emission=(50, 50, 50)),)
    every = (builders.batch("floor"), *(replace(batch, seen_by_camera=False) for batch in batches))
    floor = builders.quad("floor", half=6.0)
    return fresh(builders.scene(floor, *meshes, lights=lights, batches=every, materials=materials, images=images))


def floor_points():
    """x and y (H, W) of what the pixels of `ABOVE` show of the floor."""
    at = ((np.arange(SIDE) + 0.5) / SIDE * 2.0 - 1.0) * 2.0
    return np.meshgrid(at, at)


TEXEL = 2.5 * 4.0 / SIDE
"""Two and a half pixels, m: what an edge may be off."""


def assert_is(shares, expected, near):
    """Where no edge is `near`, shares are 0 and 1 as expected."""
    assert not np.isnan(shares).any()
    assert (expected & ~near).any()
    assert (~expected & ~near).any()
    np.testing.assert_allclose(shares[~near], expected[~near], atol=1e-3)


def test_what_the_camera_does_not_see_casts_a_shadow_and_is_not_there(shared_session):
    scene = floor_under(builders.batch("card"), meshes=(builders.quad("card", z=2.0, half=0.5),))
    x, y = floor_points()
    edge = np.maximum(np.abs(x), np.abs(y)) - 1.0
    view = shared_session.show(scene, ABOVE, Sequence(), channels=(Channel.POSITION,), **SETTINGS)
    np.testing.assert_allclose(view.channels[Channel.POSITION][..., 2], 0.0, atol=1e-5)
    assert_is(shadow_of(shared_session, scene), edge > 0.0, np.abs(edge) < TEXEL)


@pytest.mark.parametrize("where", ["caster", "light"])
def test_what_casts_no_shadow_casts_none(shared_session, where):
    scene = floor_under(builders.batch("card"), meshes=(builders.quad("card", z=2.0, half=0.5),))
    if where == "caster":
        floor, card = scene.batches
        scene = replace(scene, batches=(floor, replace(card, casts_shadow=False)))
    else:
        scene = replace(scene, lights=tuple(replace(light, casts_shadow=False) for light in scene.lights))
    assert shadow_of(shared_session, scene) == pytest.approx(np.ones((SIDE, SIDE)), abs=1e-5)


def test_a_pierced_card_lets_light_through_its_holes(shared_session):
    """Two of its four texels are holes: light falls through them, enlarged to twice their size."""
    pixels = np.full((2, 2, 4), 255, np.uint8)
    pixels[0, 0, 3] = pixels[1, 1, 3] = 0
    texture = ImageTexture("holes", interpolation=Interpolation.CLOSEST)
    leaf = builders.material("leaf", source=BaseColorSource.TEXTURE, texture=texture, texture_alpha=True)
    scene = floor_under(
        builders.batch("card", materials=("leaf",)),
        meshes=(builders.quad("card", z=2.0, half=0.7),),
        materials=(builders.DIFFUSE, leaf),
        images=(Image("holes", "holes", 1, pixels, srgb=False),),
    )
    x, y = floor_points()
    outside = np.maximum(np.abs(x), np.abs(y)) - 1.4
    near = (np.abs(outside) < TEXEL) | (np.minimum(np.abs(x), np.abs(y)) < TEXEL)
    shares = shadow_of(shared_session, scene)
    assert_is(shares, (outside > 0.0) | (x * y > 0.0), near)
    opaque = shadow_of(shared_session, scene, alpha_threshold=0.0)
    assert_is(opaque, outside > 0.0, near)


def test_every_instance_casts_a_shadow(shared_session):
    """Some of them mirrored, turned or stretched."""
    generator = np.random.default_rng(2)
    matrices = np.tile(np.eye(4), (12, 1, 1))
    matrices[:, :3, :3] = generator.normal(size=(12, 3, 3)) * 0.15
    matrices[:, :2, 3] = generator.uniform(-1.0, 1.0, (12, 2))
    matrices[:, 2, 3] = generator.uniform(1.0, 3.0, 12)
    scene = floor_under(builders.batch("box", matrices), meshes=(builders.box("box"),))
    x, y = floor_points()
    points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    normals = np.tile((0.0, 0.0, 1.0), (len(points), 1))
    triangles = casting_triangles(scene)
    seen, sure = certain(points, normals, np.array([0.0, 0.0, 4.0]), triangles, np.full(len(points), TEXEL))
    shares = shadow_of(shared_session, scene).ravel()
    assert_is(shares, seen, ~sure)


@pytest.mark.parametrize("group", [15, 16, 31, 48, 63])
def test_each_of_64_groups_is_told_from_all_others(shared_session, group):
    """A floor of a group with a card above of the same: one lamp lights only it, one only others; so with blockers."""
    scene = floor_under(builders.batch("card"), meshes=(builders.quad("card", z=2.0, half=0.5),))
    lamp = scene.lights[0]
    floor, card = scene.batches
    linked = (replace(floor, link_group=group, version=new_version()), card)

    def picture(batches, **change):
        changed = replace(scene, batches=batches, lights=(replace(lamp, **change),))
        return shared_session.show(changed, ABOVE, Sequence(), **SETTINGS).channels[Channel.COMBINED][..., :3]

    expected = picture(scene.batches)
    np.testing.assert_array_equal(picture(linked, receiver_groups=1 << group), expected)
    assert not picture(linked, receiver_groups=ALL_GROUPS ^ 1 << group).any()
    blockers = (floor, replace(card, link_group=group, version=new_version()))
    whole = picture((floor,))
    np.testing.assert_array_equal(picture(blockers, blocker_groups=1 << group), expected)
    np.testing.assert_allclose(picture(blockers, blocker_groups=ALL_GROUPS ^ 1 << group), whole, rtol=1e-5)


def test_linked_lights_among_many(shared_session):
    """Lights that pixels find by tiles are linked as well."""
    scene = floor_under(meshes=())
    lamps = tuple(
        replace(scene.lights[0], key=f"lamp {index}", receiver_groups=1 << 40 if index % 2 else ALL_GROUPS)
        for index in range(40)
    )
    half = replace(scene, lights=lamps[::2])
    pictures = [
        shared_session.show(item, ABOVE, Sequence(), light_threshold=0.0, **SETTINGS).channels[Channel.COMBINED]
        for item in (replace(scene, lights=lamps), half)
    ]
    np.testing.assert_allclose(pictures[0], pictures[1], rtol=1e-5)
    assert pictures[0][..., :3].all()


@pytest.mark.parametrize(("kind", "continuous"), list(zip(LightKind, (False, True, False, True), strict=True)))
def test_a_scene_without_casters_or_receivers_is_lit_and_empty(shared_session, kind, continuous):
    """Nothing that casts shadows, nothing in view, no geometry at all: neither fails."""
    light = builders.light(kind, (0, 0, 4), (5, 5, 5), angle=1.0, size=(1, 1), radius=0.0)
    scene = floor_under(lights=(light,))
    floor = scene.batches[0]
    away = replace(ABOVE, world_from_camera=builders.translation(x=500.0, z=6.0))
    unshadowed = replace(scene, batches=(replace(floor, casts_shadow=False),))
    sequence = Sequence(continuous=continuous)
    for changed, camera, is_lit in (
        (scene, ABOVE, True),
        (unshadowed, ABOVE, True),
        (scene, away, False),
        (replace(scene, batches=()), ABOVE, False),
    ):
        picture = shared_session.show(changed, camera, sequence, **SETTINGS).channels[Channel.COMBINED][..., :3]
        assert np.isfinite(picture).all()
        assert picture.any() == is_lit
    lit, bare = (
        shared_session.show(item, ABOVE, sequence, **SETTINGS).channels[Channel.COMBINED]
        for item in (scene, unshadowed)
    )
    np.testing.assert_allclose(lit, bare, rtol=1e-5, err_msg="a floor shadows itself")


@pytest.mark.parametrize("half", [1e3, 1e4, 1e6])
def test_a_ground_to_the_horizon_does_not_shadow_itself(shared_session, half):
    """Its corners are rounded to millimetres or decimetres, and its plane in the map is off by as much."""
    direction = np.array([1.0, 0.1, -1.0]) / np.sqrt(2.01)
    aside = np.cross([0.0, 1.0, 0.0], -direction) / np.linalg.norm(np.cross([0.0, 1.0, 0.0], -direction))
    pose = builders.translation(z=2.0)
    pose[:3, :3] = np.stack([aside, np.cross(-direction, aside), -direction], axis=1)
    for kind in (LightKind.SUN, LightKind.SPOT):
        light = replace(builders.light(kind, angle=0.8 * (kind is LightKind.SPOT)), world_from_light=pose)
        scene = fresh(builders.scene(builders.quad("ground", half=half), lights=(light,)))
        shares = shadow_of(shared_session, scene, builders.camera(z=6.0, half_width=0.05))
        np.testing.assert_allclose(shares[~np.isnan(shares)], 1.0, rtol=1e-4)


@pytest.mark.parametrize("samples", [1, 2])
@pytest.mark.parametrize(
    ("kind", "radius"), [(LightKind.POINT, 0.0), (LightKind.POINT, 0.2), (LightKind.SPOT, 0.0), (LightKind.AREA, 0.0)]
)
def test_a_light_inside_a_box_lights_nothing_outside(shared_session, kind, radius, samples):
    light = builders.light(kind, (0, 0, 2), (50, 50, 50), radius=radius, angle=1.0, size=(0.3, 0.3))
    scene = floor_under(
        builders.batch("box", [builders.translation(z=2.0)]), meshes=(builders.box("box", half=0.4),), lights=(light,)
    )
    picture = shared_session.show(scene, ABOVE, Sequence(), **SETTINGS | {"samples": samples})
    assert not picture.channels[Channel.COMBINED][..., :3].any()


def test_a_light_on_a_surface_is_finite(shared_session):
    """In it, a hair above it, and at the very point that a pixel shows."""
    x = 2.0 / SIDE
    for place in ((0.0, 0.0, 0.0), (x, x, 0.0), (x, x, 1e-30), (x, x, 1e-6)):
        for radius in (0.0, 0.1):
            light = builders.light(position=place, radius=radius)
            picture = shared_session.show(floor_under(lights=(light,)), ABOVE, Sequence(), **SETTINGS)
            assert np.isfinite(picture.channels[Channel.COMBINED]).all()


@pytest.mark.parametrize("radius", [0.3, 0.6])
def test_no_light_passes_beside_the_map_of_a_large_spot(shared_session, radius):
    """A spot with a hard edge behind a lid that covers all of it: from no point of it is any of the floor lit."""
    light = builders.light(LightKind.SPOT, (0, 0, 3), (50, 50, 50), angle=0.8, radius=radius)
    lid = builders.quad("lid", z=1.0, half=5.0)
    scene = floor_under(builders.batch("lid"), meshes=(lid,), lights=(light,))
    picture = shared_session.show(scene, ABOVE, Sequence(), **SETTINGS | {"samples": 64})
    assert not picture.channels[Channel.COMBINED][..., :3].any()


def test_a_wide_filter_sees_no_light_around_the_picture(shared_session):
    """What sub-pixel jitter shows beyond the edge is on the maps as well: a lid above keeps the sun off all of it."""
    lights = (builders.light(LightKind.SUN, (0, 0, 4), (5, 5, 5), angle=0.1), builders.light(LightKind.SPOT, angle=1.0))
    scene = floor_under(builders.batch("lid"), meshes=(builders.quad("lid", z=1.0, half=5.5),), lights=lights)
    settings = SETTINGS | {"samples": 24, "filter_radius": 16.0}
    assert not shared_session.show(scene, ABOVE, Sequence(), **settings).channels[Channel.COMBINED][..., :3].any()


@pytest.mark.parametrize("band", [0, 8, 30])
def test_a_guard_band_changes_no_shadow(shared_session, band):
    """Layers of a jumble with lamps, a sun and leaves: those within the band are those without."""
    generator = np.random.default_rng(5)
    scene = furnished(random_scene(generator), generator)
    camera = replace(random_camera(generator, False), window=(-0.6, 0.6, -0.6, 0.6))
    settings = SETTINGS | {"deep_output": True, "layers": 2, "minimum_separation": 0.05, "variant": Variant.REPROJECT}
    without, within = (
        shared_session.show(scene, camera, Sequence(), guard_band=size, **settings).layers for size in (0, band)
    )
    for one, other in zip(without, within, strict=True):
        same = np.isclose(one.radiance, other.radiance, rtol=1e-3, atol=1e-4).all(axis=-1)
        assert same.mean() >= (1.0 if band == 0 else 0.97), "rounding decides at edges of shadows"


def test_an_emissive_surface_that_is_not_there_lights_nothing(shared_session):
    """Its alpha is below the threshold: neither it nor its light is in the picture."""
    for alpha, is_lit in ((0.4, False), (0.6, True)):
        glow = builders.material("glow", emission=(9, 9, 9), alpha=alpha, emission_sampling=EmissionSampling.FRONT_BACK)
        panel = replace(builders.batch("panel", materials=("glow",)), key=f"panel {alpha}")
        scene = builders.scene(
            builders.quad("floor", half=6.0),
            builders.quad("panel", z=2.0, half=0.5),
            materials=(builders.DIFFUSE, glow),
            batches=[builders.batch("floor"), replace(panel, seen_by_camera=False)],
        )
        picture = shared_session.show(fresh(scene), ABOVE, Sequence(), **SETTINGS).channels[Channel.COMBINED][..., :3]
        assert picture.any() == is_lit


def test_every_marked_instance_lights_the_floor_below_it(shared_session):
    """More lamps of one batch than are sampled unless they are marked."""
    at = [(0.4 * (k % 5) - 0.8, 0.4 * (k // 5) - 0.8) for k in range(25)]
    glow = builders.material("glow", emission=(9, 9, 9), emission_sampling=EmissionSampling.BACK)
    panels = builders.batch("panel", [builders.translation(x, y, 0.1) for x, y in at], materials=("glow",))
    scene = builders.scene(
        builders.quad("floor", half=6.0),
        builders.quad("panel", half=0.02),
        materials=(builders.DIFFUSE, glow),
        batches=[builders.batch("floor"), replace(panels, seen_by_camera=False)],
    )
    view = shared_session.show(fresh(scene), builders.camera(half_width=1.0 / 3.0), Sequence(), **SETTINGS)
    picture = view.channels[Channel.COMBINED][..., 0]
    spots = [picture[int((y + 1.0) * SIDE / 2), int((x + 1.0) * SIDE / 2)] for x, y in at]
    assert min(spots) > 0.5 * max(spots)
