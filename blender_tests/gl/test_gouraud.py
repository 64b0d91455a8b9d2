# SPDX-License-Identifier: GPL-3.0-or-later
"""Gouraud shading: what vertices reflect in closed form, blended over triangles; Phong's where vertices are."""

from dataclasses import replace

import numpy as np
import pytest

from addon.scene import (
    BaseColorSource,
    Channel,
    EmissionSampling,
    EnvironmentMap,
    ImageTexture,
    Interpolation,
    LightKind,
    ShadingModel,
    Variant,
    World,
)
from blender_tests import builders

SIZE = 32
ALBEDO, F0, ROUGHNESS = 0.5, 0.25, 0.4  # exact in the G-buffer's formats
GLOSSY = builders.material(base_color=(ALBEDO,) * 3, specular=F0, roughness=ROUGHNESS)
WINDOW = 1 / 3
"""Half width of a window at depth 1 whose picture from z = 3 is exactly the square −1…1."""


def picture(render, scene, model=ShadingModel.GOURAUD, **settings):
    camera = builders.camera(half_width=WINDOW)
    return render(scene, camera, shading_model=model, **settings).channels[Channel.COMBINED]


def pixel_places():
    """(SIZE, SIZE, 2) x and y of the pixels' centres on the plane z = 0."""
    centers = (np.arange(SIZE) + 0.5) * 2.0 / SIZE - 1.0
    return np.stack(np.meshgrid(centers, centers), axis=-1)


def lattice(rows, columns):
    """Triangles between vertices that are numbered row by row."""
    numbers = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1]
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def grid(key, xs, z=0.0, **arguments):
    """A plane with vertices at all x and y of a list."""
    x, y = np.meshgrid(xs, xs)
    return builders.mesh(key, np.stack([x, y, np.full_like(x, z)], -1), lattice(*x.shape), **arguments)


def pixel_grid(key="floor", **arguments):
    """A plane with a vertex at every pixel's centre, and a frame of them around the picture."""
    return grid(key, (np.arange(-1, SIZE + 1) + 0.5) * 2.0 / SIZE - 1.0, **arguments)


def sphere(key, segments, radius=1.0, center=(0.0, 0.0, 0.0)):
    """A smooth sphere of so many segments and half as many rings."""
    theta, phi = np.meshgrid(np.linspace(0, np.pi, segments // 2 + 1), np.linspace(0, 2 * np.pi, segments + 1))
    normals = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1).reshape(-1, 3)
    return builders.mesh(key, radius * normals + np.array(center), lattice(*theta.shape), normals=normals)


def reflected(place, light, eye=(0.0, 0.0, 3.0)):
    """Radiance of GLOSSY at (x, y, 0) lit by an intensity of 10 W/sr at `light`: Lambert, and Blinn and Phong's
    (n + 8)/(8π) (n·h)ⁿ with n = 2/α² − 2."""
    place = np.concatenate([place, np.zeros_like(place[..., :1])], -1)
    to_light, to_eye = np.array(light) - place, np.array(eye) - place
    distance = np.linalg.norm(to_light, axis=-1, keepdims=True)
    direction = to_light / distance
    half = direction + to_eye / np.linalg.norm(to_eye, axis=-1, keepdims=True)
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    n = 2.0 / ROUGHNESS**4 - 2.0
    brdf = ALBEDO * (1 - F0) / np.pi + F0 * (n + 8) / (8 * np.pi) * half[..., 2] ** n
    return brdf * direction[..., 2] * 10.0 / distance[..., 0] ** 2


def test_vertex_values_are_blended_by_the_barycentric_coordinates(render):
    """The classic error: a lamp above the middle of a coarse quad lights its corners, and these light the middle."""
    light = (0.5, 0.25, 1.0)
    scene = builders.scene(
        builders.quad("q"), materials=(GLOSSY,), lights=(builders.light(position=light, casts_shadow=False),)
    )
    lower_left, lower_right, upper_right, upper_left = reflected(
        np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]), light
    )
    x, y = np.moveaxis(0.5 * pixel_places() + 0.5, -1, 0)
    below = lower_left + x * (lower_right - lower_left) + y * (upper_right - lower_right)
    above = lower_left + y * (upper_left - lower_left) + x * (upper_right - upper_left)
    image = picture(render, scene)
    # float32, and a power of 77.
    np.testing.assert_allclose(image[..., 0], np.where(x > y, below, above), rtol=1e-4)
    assert image[16, 20, 0] < 0.5 * reflected(pixel_places()[16, 20], light), "which is far from the truth"


def test_vertices_reflect_by_the_closed_form(render):
    light = (0.5, 0.25, 1.0)
    scene = builders.scene(
        pixel_grid(), materials=(GLOSSY,), lights=(builders.light(position=light, casts_shadow=False),)
    )
    np.testing.assert_allclose(picture(render, scene)[..., 0], reflected(pixel_places(), light), rtol=2e-4)


METAL = builders.material(base_color=(1.0, 0.5, 0.25), metallic=1.0, roughness=0.2)
DIFFUSE = builders.material(base_color=(1.0, 0.5, 0.25))
_SKY = np.linspace(0.0, 4.0, 16 * 32 * 3, dtype=np.float32).reshape(16, 32, 3)
SKY = World((1.0, 0.5, 0.25), environment=EnvironmentMap("sky", "sky", 1, _SKY))


@pytest.mark.parametrize(
    ("material", "samples"), [(GLOSSY, 1), (METAL, 1), (DIFFUSE, 1), (DIFFUSE, 5)], ids=["glossy", "metal", "1", "5"]
)
@pytest.mark.parametrize(
    "lit",
    [
        {"lights": (builders.light(LightKind.SUN, angle=0.3),)},
        {"lights": (builders.light(LightKind.AREA, (0.5, 0, 1), size=(1, 2), spread=2.0, specular_factor=0.5),)},
        {"lights": (builders.light(LightKind.SPOT, (0.25, 0, 1), radius=0.1, angle=1.2, blend=0.5),)},
        {"lights": (builders.light(position=(0.25, 0, 1), radius=0.2, soft_falloff=True, diffuse_factor=0.5),)},
        {"lights": tuple(builders.light(position=(x / 10, 0, 1), emission=(1, 2, 3)) for x in range(20))},
        {"world": (0.5, 1.0, 2.0)},
        {"sky": SKY},
    ],
    ids=["sun", "area", "spot", "disk", "many", "world", "sky"],
)
def test_where_vertices_are_it_is_phong_shading(render, lit, material, samples):
    """For every light, in previews and, of what has no highlights, by samples: those move from pixel to pixel.

    Phong's normals have 16 bits a component; many lights are sampled by chance unless the threshold is 0.
    """
    sky = lit.get("sky")
    lights = tuple(replace(light, casts_shadow=False) for light in lit.get("lights", ()))
    scene = builders.scene(pixel_grid(), materials=(material,), lights=lights, world=lit.get("world", (0, 0, 0)))
    if sky:
        scene = replace(scene, world=sky)
    settings = {"samples": samples, "light_threshold": 0.0}
    gouraud, phong = (picture(render, scene, model, **settings) for model in (ShadingModel.GOURAUD, ShadingModel.PHONG))
    assert phong[..., :3].max() > 0.1
    np.testing.assert_allclose(gouraud, phong, rtol=2e-3, atol=1e-4 * phong.max())


def test_finer_meshes_converge_to_phong_shading(render):
    """The error of linear interpolation falls with the square of the triangles' size."""
    lights = (builders.light(position=(0.5, 0.25, 1.0), casts_shadow=False),)

    def image(count, model):
        scene = builders.scene(grid("g", np.linspace(-1.1, 1.1, count + 1)), materials=(GLOSSY,), lights=lights)
        return picture(render, scene, model)[..., 0]

    phong = image(8, ShadingModel.PHONG)
    errors = [np.sqrt(((image(count, ShadingModel.GOURAUD) - phong) ** 2).mean()) for count in (16, 32, 64)]
    assert errors[1] < errors[0] / 3
    assert errors[2] < errors[1] / 3
    assert errors[2] < 0.01 * phong.mean()


@pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])
@pytest.mark.parametrize(
    "axes",
    [(1, 1, 1), (-1, 1, 1), (1, -1, -1), (1, 1, -1), (-1, -1, -1)],
    ids=["front", "mirrored", "back", "mirrored back", "inside out"],
)
def test_the_side_that_is_seen_is_lit(render, axes, orthographic):
    light = builders.light(position=(0.25, 0.25, 1.0), casts_shadow=False)
    scene = builders.scene(
        pixel_grid(), materials=(GLOSSY,), lights=(light,), batches=[builders.batch("floor", np.diag([*axes, 1.0]))]
    )
    camera = builders.camera(half_width=1.0 if orthographic else WINDOW, orthographic=orthographic)
    gouraud, phong = (
        render(scene, camera, shading_model=model).channels[Channel.COMBINED]
        for model in (ShadingModel.GOURAUD, ShadingModel.PHONG)
    )
    assert phong[..., 0].min() > 0.1
    np.testing.assert_allclose(gouraud, phong, rtol=2e-3)


def test_without_normals_vertices_face_the_viewer(render):
    """From where the view is along the normal, that is no difference."""
    scenes = (
        builders.scene(pixel_grid(**normals), materials=(GLOSSY,), lights=(builders.light(casts_shadow=False),))
        for normals in ({}, {"normals": np.zeros(((SIZE + 2) ** 2, 3))})
    )
    camera = builders.camera(orthographic=True)
    images = [render(scene, camera, shading_model=ShadingModel.GOURAUD).channels[Channel.COMBINED] for scene in scenes]
    assert images[0][..., 0].min() > 0.1
    np.testing.assert_allclose(images[1], images[0], rtol=1e-5)


@pytest.mark.parametrize("variant", [Variant.TWO_PASS, Variant.PREPASS])
@pytest.mark.parametrize("segments", [12, 64])
def test_every_layer_is_shaded_to_the_last_pixel(render, segments, variant):
    """Also along silhouettes, where depth is steep and rounds differently in another program."""
    glowing = builders.material(emission=(1.0, 1.0, 1.0), emission_sampling=EmissionSampling.NONE)
    scene = builders.scene(
        sphere("front", segments),
        sphere("back", segments, 0.5, (0.1, 0.2, -1.6)),
        materials=(glowing,),
        lights=(builders.light(position=(2, 2, 3)),),
    )
    settings = {"width": 192, "height": 192, "layers": 4, "minimum_separation": 0.01, "deep_output": True}
    camera = builders.camera(half_width=0.45)
    view = render(scene, camera, shading_model=ShadingModel.GOURAUD, variant=variant, **settings)
    for layer in view.layers[:3]:
        covered = np.isfinite(layer.depth)
        assert covered.any()
        np.testing.assert_array_equal(layer.radiance.max(axis=-1) >= 1.0, covered)
        assert not layer.radiance[~covered].any()


def test_deeper_layers_have_their_own_light(render):
    light = builders.light(position=(0, 0, 3.0), casts_shadow=False)
    scene = builders.scene(pixel_grid("front", z=0.5), grid("back", np.linspace(-3, 3, 193), z=-1.0), lights=(light,))
    camera = builders.camera(z=3.0)
    view = render(scene, camera, deep_output=True, shading_model=ShadingModel.GOURAUD)
    for layer, distance in zip(view.layers, (2.5, 4.0), strict=True):
        np.testing.assert_allclose(layer.radiance[16, 16], 0.5 / np.pi * 10 / distance**2, rtol=5e-3)


def test_diffuse_and_glossy_add_up_to_the_picture(render):
    light = builders.light(position=(0.25, 0.25, 1.0), casts_shadow=False)
    scene = builders.scene(pixel_grid(), materials=(replace(GLOSSY, emission=(0.5, 1.0, 2.0)),), lights=(light,))
    channels = (Channel.DIFFUSE_DIRECT, Channel.GLOSSY_DIRECT, Channel.EMISSION)
    view = render(scene, builders.camera(half_width=WINDOW), channels=channels, shading_model=ShadingModel.GOURAUD)
    parts = [view.channels[channel][..., :3] for channel in channels]
    assert all(part.max() > 0.1 for part in parts)
    np.testing.assert_allclose(sum(parts), view.channels[Channel.COMBINED][..., :3], rtol=1e-5)


def test_lights_are_linked_to_groups(render):
    light = builders.light(position=(0.5, 0.25, 1.0), casts_shadow=False, receiver_groups=0b10)
    left, right = (builders.quad(name, half=0.5, center=(x, 0.0)) for name, x in (("left", -0.5), ("right", 0.5)))
    batches = [builders.batch("left"), replace(builders.batch("right"), link_group=1)]
    image = picture(render, builders.scene(left, right, lights=(light,), batches=batches))
    assert not image[8:24, :16, :3].any()
    assert image[8:24, 16:, :3].all()


def test_nothing_is_in_the_way(render):
    light = builders.light(position=(0.0, 0.0, 1.0))
    plain = builders.scene(builders.quad("floor"), lights=(light,))
    blocked = builders.scene(builders.quad("floor"), builders.quad("hidden", half=0.5, z=0.5), lights=(light,))
    unseen = replace(blocked.batches[1], seen_by_camera=False)
    blocked = replace(blocked, batches=(blocked.batches[0], unseen))
    np.testing.assert_array_equal(picture(render, blocked), picture(render, plain))


def test_holes_show_the_light_of_what_is_in_them(render):
    """Two surfaces in one place, of which the first to be drawn is pierced; normals tell which one was lit."""
    image = builders.pierced(np.random.default_rng(5))
    texture = ImageTexture(image.key, interpolation=Interpolation.CLOSEST)
    leaf = builders.material("leaf", source=BaseColorSource.TEXTURE, texture=texture, texture_alpha=True)
    scene = builders.scene(
        builders.quad("a"),
        builders.quad("b", normals=np.tile((0.6, 0.0, 0.8), (4, 1))),
        materials=(replace(leaf, base_color=(1.0, 1.0, 1.0)), builders.DIFFUSE),
        images=(image,),
        lights=(builders.light(LightKind.SUN, casts_shadow=False),),
        batches=[builders.batch("a", materials=("leaf",)), builders.batch("b")],
    )
    gouraud, phong = (picture(render, scene, model) for model in (ShadingModel.GOURAUD, ShadingModel.PHONG))
    assert 0.2 < np.isclose(phong[..., 0], 0.8 * ALBEDO * 10 / np.pi, rtol=1e-3).mean() < 0.8, "holes and leaf are seen"
    np.testing.assert_allclose(gouraud, phong, rtol=1e-3)


def test_extremes_stay_finite(render):
    """Lamps at a vertex, infinitely bright, and normals of no length."""
    lights = (
        builders.light(position=(1.0, 1.0, 0.0), emission=(1e38, 0.0, 1.0)),
        builders.light(position=(-1.0, 1.0, 0.0), radius=0.1, soft_falloff=True),
        builders.light(LightKind.AREA, (1.0, -1.0, 0.0), size=(1.0, 1.0)),
    )
    for normals in (None, np.zeros((4, 3))):
        scene = builders.scene(builders.quad("q", normals=normals), materials=(GLOSSY,), lights=lights)
        for samples in (1, 3):
            image = picture(render, scene, samples=samples)
            assert np.isfinite(image).all()
            assert (image[..., 3] == 1.0).all()
