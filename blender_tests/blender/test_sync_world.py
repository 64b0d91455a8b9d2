# SPDX-License-Identifier: GPL-3.0-or-later
"""What becomes of Blender's world besides its colours: maps that are kept, suns, ray visibility, messages."""

import bpy
import numpy as np
import pytest
from sync_scenes import assert_texts, make_image, sync
from world_panorama import IS_5, add, new_world, radiance, read, smooth_image

from addon.scene import LightKind
from addon.scene.equirectangular import texel_directions
from addon.sync import Mirror
from addon.sync.materials import ImageTable
from addon.sync.world import WorldTable
from addon.sync.world_fields import LARGEST_SIZE, Constant, computed, in_order, linear_shares, multiply
from addon.sync.world_fields import add as added
from addon.sync.world_vectors import DIRECTION

pytestmark = pytest.mark.usefixtures("empty_scene")

SCATTERING = "SINGLE_SCATTERING" if IS_5 else "NISHITA"


def image_world(image=None):
    """A world that shows an image through a Mapping node: tree, background, texture and mapping."""
    tree, background = new_world()
    texture = add(tree, "TexEnvironment", image=image or smooth_image(size=(16, 8)))
    mapping = add(tree, "Mapping")
    tree.links.new(add(tree, "TexCoord").outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    return tree, background, texture, mapping


def sky_world(**properties):
    """A world of one sky with a sun: tree, background and texture."""
    tree, background = new_world()
    properties = {"sky_type": SCATTERING, "sun_disc": True, "sun_elevation": 0.6, **properties}
    texture = add(tree, "TexSky", **properties)
    tree.links.new(texture.outputs[0], background.inputs["Color"])
    return tree, background, texture


def test_constants_stay_constants():
    tree, background = new_world()
    mix = add(tree, "Mix", data_type="RGBA", blend_type="ADD")
    mix.inputs["Factor"].default_value = 1.0
    mix.inputs[6].default_value, mix.inputs[7].default_value = (0.1, 0.2, 0.3, 1.0), (1.0, 1.0, 1.0, 1.0)
    tree.links.new(mix.outputs[2], background.inputs["Color"])
    background.inputs["Strength"].default_value = 2.0
    world, lights, texts = read()
    assert world.radiance == pytest.approx((2.2, 2.4, 2.6))
    assert world.environment is None
    assert (lights, texts) == ((), ())


def test_an_image_is_its_own_map():
    _, background, texture, mapping = image_world()
    background.inputs["Strength"].default_value = 3.0
    mapping.inputs["Rotation"].default_value = (0.0, 0.0, np.pi / 2)
    world, _, texts = read()
    pixels = np.array(texture.image.pixels[:], np.float32).reshape(8, 16, 4)[..., :3]
    assert np.array_equal(world.environment.pixels, pixels)
    assert world.environment.pixels.dtype == np.float32
    assert world.radiance == pytest.approx((3.0, 3.0, 3.0))
    # The coordinates are turned a quarter about Z: +X in the world is +Y of the map.
    np.testing.assert_allclose(world.environment_from_world @ (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), atol=1e-6)
    assert texts == ()


def test_unchanged_worlds_keep_their_map():
    _, background, _, mapping = image_world()
    table, images = WorldTable(), ImageTable()
    first, _, _ = read(table, images)
    assert read(table, images)[0] is first
    background.inputs["Strength"].default_value = 5.0
    mapping.inputs["Rotation"].default_value = (0.1, 0.2, 0.3)
    turned, _, _ = read(table, images)
    assert turned.environment is first.environment  # strength and rotation are the world's, not the map's
    assert turned.environment_from_world is not None
    mapping.inputs["Location"].default_value = (0.0, 0.0, 0.4)
    moved, _, _ = read(table, images)
    assert moved.environment.version != first.environment.version


def test_a_changed_sky_is_another_map():
    _, _, texture = sky_world()
    table = WorldTable()
    first, lights, _ = read(table)
    assert read(table)[0].environment is first.environment
    texture.sun_intensity = 0.5  # the sun's alone
    dimmed, dimmed_lights, _ = read(table)
    assert dimmed.environment is first.environment
    assert dimmed.sun_disc.highest == pytest.approx(tuple(0.5 * value for value in first.sun_disc.highest))
    assert dimmed_lights[0].emission == pytest.approx(tuple(0.5 * value for value in lights[0].emission))
    texture.sun_elevation = 0.7
    assert read(table)[0].environment.version != first.environment.version


def test_the_mirror_keeps_an_unchanged_scene_and_tells_changes():
    _, background, texture = sky_world()
    mirror = Mirror()
    first = sync(mirror).scene
    assert sync(mirror).scene is first
    assert [light.key for light in first.lights] == ["world/sun"]
    background.inputs["Strength"].default_value = 2.0
    second = sync(mirror).scene
    assert second.versions.world != first.versions.world
    assert second.versions.lights != first.versions.lights
    texture.sun_disc = False
    third = sync(mirror).scene
    assert third.lights == ()
    assert third.world.sun_disc is None
    assert third.versions.world != second.versions.world
    assert third.world.environment is second.world.environment


def test_the_sun_of_a_sky():
    tree, background, _ = sky_world(sun_rotation=0.4, sun_size=0.02)
    background.inputs["Strength"].default_value = 3.0
    alone, (light_alone,), _ = read()
    mix, other = add(tree, "MixShader"), add(tree, "Background")
    mix.inputs[0].default_value = 0.25
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], mix.inputs[1])
    tree.links.new(other.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    world, (sun,), texts = read()
    assert sun.kind is LightKind.SUN
    assert sun.angle == pytest.approx(0.02)
    assert sun.emission == pytest.approx(tuple(0.75 * value for value in light_alone.emission))
    assert world.sun_disc.half_angle == pytest.approx(0.01)
    assert world.sun_disc.direction == pytest.approx(sun.world_from_light[:3, 2])
    for end in ("lowest", "highest"):
        expected = 0.75 * np.array(getattr(alone.sun_disc, end))
        np.testing.assert_allclose(getattr(world.sun_disc, end), expected, rtol=1e-6)
    assert texts == ()


def test_of_several_suns_one_is_seen():
    tree, background, _ = sky_world(sun_size=0.02)
    other, sky = add(tree, "Background"), add(tree, "TexSky", sky_type=SCATTERING, sun_disc=True, sun_size=0.04)
    total = add(tree, "AddShader")
    tree.links.new(sky.outputs[0], other.inputs["Color"])
    tree.links.new(background.outputs[0], total.inputs[0])
    tree.links.new(other.outputs[0], total.inputs[1])
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputWorld")
    tree.links.new(total.outputs[0], output.inputs["Surface"])
    world, lights, texts = read()
    assert sorted(light.angle for light in lights) == pytest.approx([0.02, 0.04])
    assert world.sun_disc.half_angle == pytest.approx(0.5 * lights[0].angle)
    assert_texts(texts, "“Sky”", "only one sun")


def test_a_sun_that_no_light_can_be_is_told():
    tree, background, texture = sky_world()
    gamma = add(tree, "Gamma")
    gamma.inputs["Gamma"].default_value = 2.0
    tree.links.new(texture.outputs[0], gamma.inputs["Color"])
    tree.links.new(gamma.outputs[0], background.inputs["Color"])
    world, lights, texts = read()
    assert lights == ()
    assert world.sun_disc is None
    assert_texts(texts, "sun", "left out")


@pytest.mark.parametrize("kind", ["camera", "diffuse", "glossy"])
def test_ray_visibility(kind):
    sky_world()
    setattr(bpy.context.scene.world.cycles_visibility, kind, False)
    world, (sun,), _ = read()
    seen = {name: getattr(world, f"seen_by_{name}") for name in ("camera", "diffuse", "glossy")}
    assert seen == {name: name != kind for name in seen}
    assert sun.diffuse_factor == float(kind != "diffuse")
    assert sun.specular_factor == float(kind != "glossy")


@pytest.mark.skipif(bpy.app.version < (5, 2, 0), reason="Blender 5.2 lets a world cast no shadows")
def test_a_world_without_shadows():
    sky_world()
    assert read()[1][0].casts_shadow
    bpy.context.scene.world.cycles.use_shadows = False
    bpy.context.scene.world.update_tag()
    _, (sun,), texts = read()
    assert not sun.casts_shadow
    assert_texts(texts, "“Sky”", "shadows")


def test_encoded_images_are_decoded():
    image_world(make_image(color=(0.5, 0.5, 0.5, 1.0), size=(4, 2)))
    world, _, _ = read()
    np.testing.assert_allclose(world.environment.pixels, ((0.5 + 0.055) / 1.055) ** 2.4, rtol=1e-2)


def test_huge_images_are_halved():
    image_world(make_image(color=(0.25, 0.5, 1.0, 1.0), size=(LARGEST_SIZE + 2, 3), is_float=True))
    world, _, texts = read()
    assert world.environment.pixels.shape == (2, LARGEST_SIZE // 2 + 1, 3)
    np.testing.assert_allclose(
        world.environment.pixels, np.broadcast_to((0.25, 0.5, 1.0), (2, LARGEST_SIZE // 2 + 1, 3))
    )
    assert_texts(texts, "Environment Texture", "halved")


def test_broken_pixels_are_black():
    image = make_image(size=(4, 2), is_float=True)
    pixels = np.ones((2, 4, 4), np.float32)
    pixels[0, 0, 0], pixels[1, 2, 1] = -3.0, np.nan
    image.pixels.foreach_set(pixels.ravel())
    image_world(image)
    shown = read()[0].environment.pixels
    assert np.isfinite(shown).all()
    assert shown.min() == 0.0


@pytest.mark.parametrize(
    ("build", "parts"),
    [
        (lambda tree: add(tree, "TexNoise").outputs["Color"], ("Noise Texture", "not rendered yet")),
        (lambda tree: add(tree, "TexSky", sky_type="HOSEK_WILKIE").outputs[0], ("Hosek", "Preetham")),
        (lambda tree: add(tree, "TexEnvironment").outputs[0], ("Environment Texture", "no image")),
        (lambda tree: add(tree, "TexCoord").outputs["Camera"], ("Camera", "zeros")),
    ],
)
def test_what_is_not_rendered_is_named(build, parts):
    tree, background = new_world()
    tree.links.new(build(tree), background.inputs["Color"])
    world, _, texts = read()
    assert np.isfinite(radiance(world, texel_directions(4, 8))).all()
    assert_texts(texts, "“Sky”", *parts)


def test_an_unknown_vector_is_the_direction():
    tree, _, texture, _ = image_world()
    expected = radiance(read()[0], texel_directions(8, 16))
    tree.links.new(add(tree, "VectorCurve").outputs[0], texture.inputs["Vector"])
    world, _, texts = read()
    np.testing.assert_allclose(radiance(world, texel_directions(8, 16)), expected)
    assert_texts(texts, "Vector Curves", "direction itself")


def test_every_kind_of_node_gives_finite_radiance():
    """All shader nodes of this Blender, each once as the world's colour: nothing raises, nothing is broken."""
    kinds = [name.removeprefix("ShaderNode") for name in dir(bpy.types) if name.startswith("ShaderNode")]
    tried = 0
    for kind in kinds:
        tree, background = new_world(kind)
        try:
            node = add(tree, kind)
        except RuntimeError:
            continue  # an abstract base class
        for output in node.outputs:
            shader = output.type == "SHADER"
            target = tree.nodes["World Output"].inputs["Surface"] if shader else background.inputs["Color"]
            tree.links.new(output, target)
            world, _, _ = read()
            assert np.isfinite(world.radiance).all(), kind
            if world.environment is not None:
                assert np.isfinite(world.environment.pixels).all(), kind
        tried += 1
    assert tried > 80


def test_shared_inputs_are_read_once():
    """A graph of two hundred doublings, each the sum of one output with itself: 2²⁰⁰ paths, but two hundred nodes."""
    field = computed(multiply, Constant((1.0, 1.0, 1.0)), Constant((1e-30, 1e-30, 1e-30)))
    total = field = computed(added, field, DIRECTION)
    for _ in range(200):
        total = computed(added, total, total)
    assert len(in_order(total)) == 203
    shares = {id(part): share for part, share in linear_shares(total)}
    assert shares[id(DIRECTION)] == pytest.approx((2.0**200,) * 3)
