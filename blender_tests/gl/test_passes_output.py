# SPDX-License-Identifier: GPL-3.0-or-later
"""The film's passes of direct light add up to the picture, and its colours are what surfaces reflect."""

from dataclasses import replace

import numpy as np
import pytest
from random_scenes import fresh, furnished, random_camera, random_scene

from addon.scene import Channel, DebugView, EmissionSampling, EnvironmentMap, LightKind, Sequence
from blender_tests import builders

PASSES = (Channel.DIFFUSE_DIRECT, Channel.GLOSSY_DIRECT, Channel.EMISSION, Channel.ENVIRONMENT)
COLORS = (Channel.DIFFUSE_COLOR, Channel.GLOSSY_COLOR)
SETTINGS = {"width": 40, "height": 40, "filter_radius": 1.5}

ROUNDING = 2e-6
"""Of a sum of four float32 numbers, each a mean over samples."""


def shown(session, scene, camera, channels=PASSES, **settings):
    """{channel: (H, W, C)} of a view."""
    settings = SETTINGS | {"samples": 3} | settings
    return session.show(scene, camera, settings.pop("sequence", Sequence()), channels=channels, **settings).channels


def room(seed=3, **world):
    """Glossy boxes, triangles and leaves, one that shines, a lamp, a sun, a spot and an area light; and a camera."""
    generator = np.random.default_rng(seed)
    scene = furnished(random_scene(generator), generator)
    materials = {
        key: replace(item, specular=0.04, roughness=0.4, version=item.version) for key, item in scene.materials.items()
    }
    lights = (
        *scene.lights,
        builders.light(LightKind.AREA, (0, 0, 4), (5, 4, 3), size=(1, 2)),
        builders.light(LightKind.SPOT, (1, 0, 4), (9, 8, 7), angle=1.0, blend=0.5, specular_factor=0.5),
    )
    camera = replace(random_camera(generator, False), window=(-0.8, 0.8, -0.8, 0.8))
    return replace(scene, materials=materials, lights=lights, world=replace(scene.world, **world)), camera


def assert_adds_up(images):
    """The passes' sum is the picture's colour."""
    total = sum(images[channel][..., :3].astype(np.float64) for channel in PASSES)
    combined = images[Channel.COMBINED][..., :3]
    np.testing.assert_allclose(total, combined, rtol=ROUNDING, atol=ROUNDING * combined.max())


ENVIRONMENT = EnvironmentMap(
    "sky", "sky", 1, np.random.default_rng(0).random((8, 16, 3)).astype(np.float32) + np.float32(0.1)
)


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize(
    "world",
    [{}, {"radiance": (0.2, 0.3, 0.4)}, {"radiance": (1, 1, 1), "environment": ENVIRONMENT}],
    ids=["dark", "colour", "map"],
)
def test_the_passes_add_up_to_the_picture(shared_session, world, samples):
    images = shown(shared_session, *room(**world), samples=samples)
    assert_adds_up(images)
    for channel in PASSES:
        assert images[channel].any() == (channel is not Channel.ENVIRONMENT or bool(world)), channel
        assert not images[channel][..., 3:].any() or channel in (Channel.DIFFUSE_DIRECT, Channel.GLOSSY_DIRECT)
    assert (images[Channel.COMBINED][..., 3] == 1.0).all()


def test_a_viewports_passes_add_up_as_well(shared_session):
    images = shown(shared_session, *room(radiance=(0.2, 0.3, 0.4)), sequence=Sequence(continuous=True))
    assert_adds_up(images)


@pytest.mark.parametrize("channel", [Channel.DIFFUSE_DIRECT, Channel.EMISSION, Channel.GLOSSY_COLOR])
def test_a_pass_alone_is_what_it_is_with_all_others(shared_session, channel):
    """And the picture is none the wiser: which passes somebody reads changes nothing."""
    scene, camera = room(radiance=(0.2, 0.3, 0.4))
    every = shown(shared_session, scene, camera, (*PASSES, *COLORS))
    alone = shown(shared_session, scene, camera, (channel,))
    none = shown(shared_session, scene, camera, ())
    np.testing.assert_allclose(alone[channel], every[channel], rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(alone[Channel.COMBINED], none[Channel.COMBINED], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("missing", ["lights", "emission", "glossy materials", "geometry"])
def test_what_there_is_none_of_is_black(shared_session, missing):
    scene, camera = room()
    dark = {
        "lights": [Channel.DIFFUSE_DIRECT, Channel.GLOSSY_DIRECT],
        "emission": [Channel.EMISSION],
        "glossy materials": [Channel.GLOSSY_DIRECT],
        "geometry": [Channel.DIFFUSE_DIRECT, Channel.GLOSSY_DIRECT, Channel.EMISSION],
    }[missing]
    materials = scene.materials
    if missing == "emission":
        materials = {key: replace(item, emission=(0.0, 0.0, 0.0)) for key, item in materials.items()}
    if missing == "lights":
        materials = {key: replace(item, emission_sampling=EmissionSampling.NONE) for key, item in materials.items()}
    if missing == "glossy materials":
        materials = {key: replace(item, specular=0.0) for key, item in materials.items()}
    scene = replace(
        scene,
        materials=materials,
        lights=() if missing == "lights" else scene.lights,
        batches=() if missing == "geometry" else scene.batches,
    )
    images = shown(shared_session, scene, camera)
    assert_adds_up(images)
    assert [channel for channel in PASSES[:3] if not images[channel].any()] == dark


def test_lights_factors_are_in_their_own_pass(shared_session):
    scene, camera = room()
    dark = {key: replace(item, emission=(0.0, 0.0, 0.0)) for key, item in scene.materials.items()}
    light = replace(scene.lights[0], casts_shadow=False)
    scene = replace(scene, materials=dark)
    images = {
        factors: shown(
            shared_session,
            replace(scene, lights=(replace(light, diffuse_factor=factors[0], specular_factor=factors[1]),)),
            camera,
        )
        for factors in ((1.0, 1.0), (0.25, 1.0), (1.0, 0.5), (0.0, 1.0))
    }
    for (diffuse, glossy), found in images.items():
        for channel, factor in ((Channel.DIFFUSE_DIRECT, diffuse), (Channel.GLOSSY_DIRECT, glossy)):
            expected = factor * images[1.0, 1.0][channel][..., :3]
            np.testing.assert_allclose(found[channel][..., :3], expected, rtol=1e-5, atol=1e-7)


def test_a_transparent_film_has_no_world_in_the_picture_but_in_its_pass(shared_session):
    scene, camera = room(radiance=(0.2, 0.3, 0.4))
    images = shown(shared_session, scene, camera, transparent_film=True)
    opaque = shown(shared_session, scene, camera)
    alpha = images[Channel.COMBINED][..., 3]
    assert 0.0 < alpha.mean() < 1.0
    assert not images[Channel.COMBINED][alpha == 0.0].any()
    np.testing.assert_array_equal(images[Channel.ENVIRONMENT], opaque[Channel.ENVIRONMENT])
    premultiplied = opaque[Channel.COMBINED][..., :3] - opaque[Channel.ENVIRONMENT][..., :3]
    np.testing.assert_allclose(images[Channel.COMBINED][..., :3], premultiplied, rtol=1e-5, atol=1e-5)


def test_a_world_that_the_camera_does_not_see_is_in_no_pass(shared_session):
    scene, camera = room(radiance=(0.2, 0.3, 0.4), seen_by_camera=False)
    images = shown(shared_session, scene, camera)
    assert not images[Channel.ENVIRONMENT].any()
    assert images[Channel.DIFFUSE_DIRECT].any()
    assert_adds_up(images)


def test_emission_is_what_surfaces_emit(shared_session):
    """The whole picture shows one surface: its colour to the 11 binary digits of the G-buffer."""
    glow = builders.material(emission=(0.25, 2.0, 0.5))
    scene = builders.scene(builders.quad("q", half=9.0), materials=(glow,), lights=(builders.light(),))
    images = shown(shared_session, fresh(scene), builders.camera())
    np.testing.assert_allclose(images[Channel.EMISSION][..., :3], np.full((40, 40, 3), glow.emission), rtol=2**-10)


def furnace(session, **material):
    """Passes of a tilted plane that fills the picture, in a white world that a preview looks up."""
    angle = np.radians(50.0)
    turned = np.eye(4)
    turned[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    scene = builders.scene(
        builders.quad("q", half=9.0),
        materials=(builders.material(**material),),
        batches=[replace(builders.batch("q", [turned]), casts_shadow=False)],
        world=(1, 1, 1),
    )
    return shown(
        session, fresh(scene), builders.camera(half_width=0.05), (*PASSES, *COLORS), samples=1, filter_radius=0.0
    )


@pytest.mark.parametrize("roughness", [0.05, 0.5, 1.0])
@pytest.mark.parametrize(
    "surface",
    [{"base_color": (1, 1, 1), "metallic": 1.0}, {"base_color": (0.8, 0.4, 0.1), "specular": 0.08}, {"specular": 0.0}],
    ids=["metal", "dielectric", "diffuse"],
)
def test_in_a_white_world_each_reflection_is_its_colour(shared_session, surface, roughness):
    """By definition: what is reflected of radiance 1 from everywhere. A white metal's is 1; none is more than that."""
    images = furnace(shared_session, roughness=roughness, **surface)
    pairs = zip(PASSES[:2], COLORS, strict=True)
    for light, color in pairs:
        np.testing.assert_allclose(images[light][..., :3], images[color][..., :3], rtol=5e-3, atol=2e-3)
    total = sum(images[color][20, 20, :3] for color in COLORS)
    assert (total <= 1.0 + 2e-3).all()
    if surface.get("metallic"):
        np.testing.assert_allclose(images[Channel.GLOSSY_COLOR][20, 20, :3], 1.0, atol=5e-3)
        assert not images[Channel.DIFFUSE_COLOR][..., :3].any()
    if surface == {"specular": 0.0}:
        np.testing.assert_allclose(images[Channel.DIFFUSE_COLOR][20, 20, :3], 0.5, atol=1e-3)
        assert not images[Channel.GLOSSY_COLOR][..., :3].any()


def test_colours_and_emission_do_not_depend_on_light(shared_session):
    scene, camera = room()
    channels = (*COLORS, Channel.EMISSION)
    lit, dark = (shown(shared_session, item, camera, channels) for item in (scene, replace(scene, lights=())))
    for channel in channels:
        np.testing.assert_allclose(lit[channel], dark[channel], rtol=1e-6, err_msg=channel)


@pytest.mark.parametrize("view", [DebugView.NORMAL, DebugView.DIRECT])
def test_a_debug_view_shows_no_light_that_was_not_computed(shared_session, view):
    """Passes that are asked for beside it are finite, and direct light's are there where that is shown."""
    scene, camera = room()
    images = shown(shared_session, scene, camera, debug_view=view)
    assert all(np.isfinite(image).all() for image in images.values())
    assert images[Channel.DIFFUSE_DIRECT].any() == (view is DebugView.DIRECT)


def test_passes_of_strange_lights_are_finite(shared_session):
    """Far too bright, and as far away."""
    scene, camera = room()
    lights = tuple(replace(light, emission=(1e38, 1e-38, 0.0)) for light in scene.lights)
    far = replace(scene.lights[0], key="far", world_from_light=builders.translation(x=1e15))
    images = shown(shared_session, replace(scene, lights=(*lights, far)), camera, (*PASSES, *COLORS))
    assert all(np.isfinite(image).all() for image in images.values())
    assert images[Channel.DIFFUSE_DIRECT].max() > 1e20
