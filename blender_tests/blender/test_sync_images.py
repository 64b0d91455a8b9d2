# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of every kind arrive as Cycles shows them, and those that cannot be read are told."""

import bpy
import numpy as np
import pytest
from sync_scenes import (
    assert_texts,
    connect,
    cycles_pixel,
    make_image,
    make_material,
    make_object,
    mirrored_material,
    sync,
    texture_node,
    textured,
)

from addon.scene import BaseColorSource, Extension, Interpolation
from addon.sync import Mirror


def test_image_texture(empty_scene):
    material, _, node = textured(make_image(color=(0.2, 0.4, 0.6, 1.0)))
    node.extension, node.interpolation = "CLIP", "Closest"
    mirrored, scene, texts = mirrored_material(material)
    assert mirrored.source is BaseColorSource.TEXTURE
    assert mirrored.base_color == (1.0, 1.0, 1.0)
    assert (mirrored.texture.extension, mirrored.texture.interpolation) == (Extension.CLIP, Interpolation.CLOSEST)
    assert not mirrored.texture_alpha
    image = scene.images[mirrored.texture.image]
    assert (image.pixels.shape, image.pixels.dtype, image.srgb) == ((2, 3, 4), np.uint8, True)
    np.testing.assert_array_equal(image.pixels[0, 0], (51, 102, 153, 255))
    assert texts == ()


def test_alpha_of_the_same_image(empty_scene):
    material, shader, node = textured(make_image())
    connect(material, node.outputs["Alpha"], shader.inputs["Alpha"])
    mirrored, scene, _ = mirrored_material(material)
    assert mirrored.texture_alpha
    assert len(scene.images) == 1
    assert scene.images[mirrored.texture.image].pixels[0, 0, 3] == 204


def test_alpha_of_another_image_is_combined(empty_scene):
    material, shader, _ = textured(make_image(color=(0.2, 0.4, 0.6, 1.0)))
    mask = make_image("Mask", (1.0, 1.0, 1.0, 1.0), (6, 1), space="Non-Color")
    mask.pixels[0:3] = (0.0, 0.0, 0.0)
    connect(material, texture_node(material.node_tree, mask).outputs["Color"], shader.inputs["Alpha"])
    mirrored, scene, texts = mirrored_material(material)
    assert mirrored.texture_alpha
    pixels = scene.images[mirrored.texture.image].pixels
    assert pixels.shape == (2, 6, 4)
    np.testing.assert_array_equal(pixels[:, :, 3], [[0, 255, 255, 255, 255, 255]] * 2)
    np.testing.assert_array_equal(pixels[0, 0, :3], (51, 102, 153))
    assert texts == ()


@pytest.mark.parametrize(
    ("is_float", "space", "dtype", "srgb", "red"),
    [
        (False, "sRGB", np.uint8, True, 51),
        (False, "Non-Color", np.uint8, False, 51),
        (True, "Linear Rec.709", np.float32, False, 0.2),
    ],
)
def test_pixels_and_colour_space(empty_scene, is_float, space, dtype, srgb, red):
    image = make_image(is_float=is_float, space=space)
    image.alpha_mode = "CHANNEL_PACKED"
    _, scene, texts = mirrored_material(textured(image)[0])
    (mirrored,) = scene.images.values()
    assert (mirrored.pixels.dtype, mirrored.srgb) == (dtype, srgb)
    assert mirrored.pixels[0, 0, 0] == pytest.approx(red)
    assert texts == ()


def test_packed_image(empty_scene):
    image = make_image(color=(0.2, 0.4, 0.6, 1.0))
    image.pack()
    _, scene, texts = mirrored_material(textured(image)[0])
    (mirrored,) = scene.images.values()
    np.testing.assert_array_equal(mirrored.pixels[0, 0], (51, 102, 153, 255))
    assert texts == ()


@pytest.mark.parametrize("linked", [False, True], ids=["colour alone", "with alpha"])
@pytest.mark.parametrize(("is_float", "space"), [(False, "sRGB"), (False, "Non-Color"), (True, "Linear Rec.709")])
@pytest.mark.parametrize("alpha_mode", ["STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE"])
def test_transparent_image_looks_as_in_cycles(empty_scene, tmp_path, alpha_mode, is_float, space, linked):
    """The colour of an emitting plane, which Cycles multiplies by alpha or not depending on all of these."""
    image = make_image(color=(0.2, 0.3, 0.4, 0.5), is_float=is_float, space=space)
    image.alpha_mode = alpha_mode
    material, shader = make_material("Lamp", "ShaderNodeEmission")
    node = texture_node(material.node_tree, image)
    connect(material, node.outputs["Color"], shader.inputs["Color"])
    if linked:  # used, but without effect: strength = alpha · 0 + 1
        math = material.node_tree.nodes.new("ShaderNodeMath")
        math.operation = "MULTIPLY_ADD"
        math.inputs[1].default_value, math.inputs[2].default_value = 0.0, 1.0
        connect(material, node.outputs["Alpha"], math.inputs[0])
        connect(material, math.outputs[0], shader.inputs["Strength"])
    bpy.ops.mesh.primitive_plane_add(size=20)
    bpy.context.object.data.materials.append(material)
    rendered = cycles_pixel(empty_scene, tmp_path / "plane.exr")
    bpy.data.objects.remove(bpy.context.object)
    mirrored, _, _ = mirrored_material(material)
    np.testing.assert_allclose(mirrored.emission, rendered, atol=0.012)


@pytest.mark.parametrize("content", [None, b"this is no picture"], ids=["missing", "unreadable"])
def test_image_file_that_cannot_be_read(empty_scene, tmp_path, content):
    path = tmp_path / "lost.png"
    path.write_bytes(content or b"x")
    image = bpy.data.images.new("Lost", 1, 1)
    image.source, image.filepath = "FILE", str(path)
    if content is None:
        path.unlink()
    image.reload()
    mirrored, scene, texts = mirrored_material(textured(image)[0])
    np.testing.assert_array_equal(scene.images[mirrored.texture.image].pixels, [[(255, 0, 255, 255)]])
    assert sum("lost.png" in text and "magenta" in text for text in texts) == 1


def test_texture_node_without_image(empty_scene):
    mirrored, scene, texts = mirrored_material(textured(None)[0])
    np.testing.assert_array_equal(scene.images[mirrored.texture.image].pixels, [[(255, 0, 255, 255)]])
    assert_texts(texts, "“Painted”", "“Image Texture”", "no image")


def test_only_the_first_udim_tile_is_read_and_told(empty_scene, tmp_path):
    for number, color in ((1001, (1.0, 0.0, 0.0, 1.0)), (1002, (0.0, 1.0, 0.0, 1.0))):
        tile = make_image(f"Tile {number}", color)
        tile.filepath_raw, tile.file_format = str(tmp_path / f"wall.{number}.png"), "PNG"
        tile.save()
    image = bpy.data.images.load(str(tmp_path / "wall.1001.png"))
    image.source = "TILED"
    material = textured(image)[0]
    _, scene, texts = mirrored_material(material)
    (mirrored,) = scene.images.values()
    np.testing.assert_array_equal(mirrored.pixels, np.full((2, 3, 4), (255, 0, 0, 255)))
    assert_texts(texts, f"“{image.name}”", "2 UDIM tiles", "only the first")


def test_added_udim_tile_is_told(empty_scene):
    image = bpy.data.images.new("Wall", 2, 2, tiled=True)
    make_object().data.materials.append(textured(image)[0])
    mirror = Mirror()
    assert not any("UDIM" in text for text in sync(mirror).warnings)
    image.tiles.new(tile_number=1002)
    assert_texts(sync(mirror).warnings, "“Wall”", "2 UDIM tiles")


@pytest.mark.parametrize("modes", [("STRAIGHT", "CHANNEL_PACKED"), ("CHANNEL_PACKED", "STRAIGHT")])
def test_alpha_mode_changed_later_is_like_from_the_start(empty_scene, modes):
    """The pixels as Blender stores them stay equal, but what is shown does not."""
    image = make_image(color=(0.5, 0.5, 0.5, 0.5))
    image.pack()
    make_object().data.materials.append(textured(image)[0])
    mirror, shown = Mirror(), []
    for mode in modes:
        image.alpha_mode = mode
        (kept,) = sync(mirror).scene.images.values()
        (fresh,) = sync().scene.images.values()
        np.testing.assert_array_equal(kept.pixels, fresh.pixels)
        shown.append(int(kept.pixels[0, 0, 0]))
    assert shown == [64 if mode == "STRAIGHT" else 128 for mode in modes]


def test_painting_on_an_image_is_seen(empty_scene):
    image = make_image(color=(0.2, 0.4, 0.6, 1.0))
    make_object().data.materials.append(textured(image)[0])
    mirror = Mirror()
    before = sync(mirror).scene
    assert sync(mirror).scene is before
    image.pixels[0] = 1.0
    image.update()
    after = sync(mirror).scene
    (key,) = after.images
    assert after.images[key].pixels[0, 0, 0] == 255
    assert after.images[key].version != before.images[key].version
    assert after.versions.materials != before.versions.materials
    assert after.versions.geometry == before.versions.geometry
