# SPDX-License-Identifier: GPL-3.0-or-later
"""The world by direction against Cycles' own panorama of it, and the sun's disc against a close-up of it."""

import math

import bpy
import mathutils
import numpy as np
import pytest
from world_panorama import IS_5, add, cycles, mean_relative_error, new_world, ours, render, smooth_image

from addon.sync import sky as sky_model
from addon.sync.sky import Air, Sky
from addon.sync.sun import sun_irradiance

CLOSE = 2e-3
"""Mean relative error of maps that are sampled anew; Cycles' own tables and interpolation differ by less than 5e-4."""

ROTATIONS = {"none": (0.0, 0.0, 0.0), "about Z": (0.0, 0.0, 1.1), "oblique": (0.3, -0.5, 1.1)}
GRADIENTS = ("LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "RADIAL", "QUADRATIC_SPHERE", "SPHERICAL")
PHYSICAL_SKIES = ("SINGLE_SCATTERING", "MULTIPLE_SCATTERING") if IS_5 else ("NISHITA",)
BLENDS = ("MIX", "ADD", "MULTIPLY", "SUBTRACT", "SCREEN", "DARKEN", "LIGHTEN", "DIFFERENCE", "OVERLAY")

pytestmark = pytest.mark.usefixtures("empty_scene")


def mapped(tree, texture, *, kind="POINT", coordinates="Generated", **inputs):
    """Give a texture coordinates through a Mapping node with these inputs."""
    mapping = add(tree, "Mapping", vector_type=kind)
    tree.links.new(add(tree, "TexCoord").outputs[coordinates], mapping.inputs["Vector"])
    for name, value in inputs.items():
        mapping.inputs[name].default_value = value
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])


def environment(tree, target, **mapping):
    """An environment texture, mapped, that drives an input."""
    texture = add(tree, "TexEnvironment", image=smooth_image())
    mapped(tree, texture, **mapping)
    tree.links.new(texture.outputs["Color"], target)
    return texture


@pytest.mark.parametrize("rotation", ROTATIONS)
def test_rotated_images_keep_their_pixels(rotation, tmp_path):
    tree, background = new_world()
    environment(tree, background.inputs["Color"], Rotation=ROTATIONS[rotation])
    background.inputs["Strength"].default_value = 1.5
    shown, _, texts = ours()
    # Exactly the same interpolation of the same pixels: only Cycles' float32 directions differ.
    np.testing.assert_allclose(shown, cycles(tmp_path), rtol=1e-4)
    assert texts == ()


@pytest.mark.parametrize("kind", ["POINT", "TEXTURE", "VECTOR", "NORMAL"])
def test_images_that_are_not_merely_rotated(kind, tmp_path):
    tree, background = new_world()
    environment(tree, background.inputs["Color"], kind=kind, Rotation=(0.3, -0.5, 1.1), Scale=(1.4, 1.0, 0.8))
    assert mean_relative_error(ours()[0], cycles(tmp_path)) < CLOSE


@pytest.mark.parametrize("coordinates", ["Generated", "Normal", "Reflection", "Object"])
def test_texture_coordinates(coordinates, tmp_path):
    tree, background = new_world()
    environment(tree, background.inputs["Color"], coordinates=coordinates)
    assert mean_relative_error(ours()[0], cycles(tmp_path)) < CLOSE


def test_coordinates_of_an_object(tmp_path):
    tree, background = new_world()
    texture = add(tree, "TexEnvironment", image=smooth_image())
    target = bpy.data.objects.new("Target", None)
    bpy.context.scene.collection.objects.link(target)
    target.rotation_euler, target.scale, target.location = (0.4, 0.2, 1.0), (1.0, 2.0, 1.0), (0.1, 0.0, 0.2)
    coordinates = add(tree, "TexCoord", object=target)
    tree.links.new(coordinates.outputs["Object"], texture.inputs["Vector"])
    tree.links.new(texture.outputs[0], background.inputs["Color"])
    assert mean_relative_error(ours()[0], cycles(tmp_path)) < CLOSE


def test_mirror_ball(tmp_path):
    tree, background = new_world()
    texture = environment(tree, background.inputs["Color"], Rotation=(0.3, -0.5, 1.1))
    texture.projection = "MIRROR_BALL"
    assert mean_relative_error(ours()[0], cycles(tmp_path)) < CLOSE


@pytest.mark.parametrize("kind", GRADIENTS)
def test_gradients(kind, tmp_path):
    tree, background = new_world()
    texture = add(tree, "TexGradient", gradient_type=kind)
    mapped(tree, texture, Rotation=(0.3, 1.2, 0.2), Scale=(0.7, 0.7, 0.7), Location=(0.2, 0.1, 0.0))
    tree.links.new(texture.outputs[0], background.inputs["Color"])
    assert mean_relative_error(ours()[0], cycles(tmp_path)) < CLOSE


def test_ramp_over_height(tmp_path):
    tree, background = new_world()
    split, scaled, ramp = add(tree, "SeparateXYZ"), add(tree, "MapRange"), add(tree, "ValToRGB")
    tree.links.new(add(tree, "TexCoord").outputs["Generated"], split.inputs[0])
    tree.links.new(split.outputs["Z"], scaled.inputs["Value"])
    scaled.inputs[1].default_value = -1.0
    tree.links.new(scaled.outputs["Result"], ramp.inputs[0])
    elements = ramp.color_ramp.elements
    elements[0].color, elements[1].color = (0.1, 0.05, 0.02, 1.0), (0.2, 0.4, 1.0, 1.0)
    elements.new(0.5).color = (1.0, 0.8, 0.6, 1.0)
    tree.links.new(ramp.outputs["Color"], background.inputs["Color"])
    assert mean_relative_error(ours()[0], cycles(tmp_path)) < CLOSE


@pytest.mark.parametrize("blend", BLENDS)
def test_blended_textures(blend, tmp_path):
    tree, background = new_world()
    mix = add(tree, "Mix", data_type="RGBA", blend_type=blend)
    mix.inputs["Factor"].default_value = 0.7
    environment(tree, mix.inputs[6], Rotation=(0.0, 0.0, 0.5))
    tree.links.new(add(tree, "TexGradient").outputs["Color"], mix.inputs[7])
    tree.links.new(mix.outputs[2], background.inputs["Color"])
    # Lighter, darker and different colours have creases, which a map of 64 rows rounds.
    assert mean_relative_error(ours()[0], cycles(tmp_path)) < 2 * CLOSE


def test_adjusted_colours(tmp_path):
    tree, background = new_world()
    adjust, gamma, contrast, invert = (
        add(tree, kind) for kind in ("HueSaturation", "Gamma", "BrightContrast", "Invert")
    )
    for index, value in enumerate((0.6, 1.4, 1.2, 0.8)):
        adjust.inputs[index].default_value = value
    gamma.inputs["Gamma"].default_value = 1.7
    contrast.inputs[1].default_value, contrast.inputs[2].default_value = 0.1, 0.2
    invert.inputs[0].default_value = 0.1
    environment(tree, adjust.inputs["Color"], Rotation=(0.0, 0.0, 1.0))
    for source, target in ((adjust, gamma), (gamma, contrast), (contrast, invert), (invert, background)):
        tree.links.new(source.outputs[0], target.inputs["Color"])
    assert mean_relative_error(ours()[0], cycles(tmp_path)) < CLOSE


def test_mixed_and_added_backgrounds(tmp_path):
    tree, background = new_world()
    environment(tree, background.inputs["Color"])
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputWorld")
    red, mix, total = add(tree, "Background"), add(tree, "MixShader"), add(tree, "AddShader")
    red.inputs["Color"].default_value = (1.0, 0.1, 0.0, 1.0)
    value = add(tree, "TexGradient").outputs[1]
    for source, target in (
        (value, mix.inputs[0]),
        (background.outputs[0], mix.inputs[1]),
        (red.outputs[0], mix.inputs[2]),
        (mix.outputs[0], total.inputs[0]),
        (red.outputs[0], total.inputs[1]),
        (total.outputs[0], output.inputs["Surface"]),
    ):
        tree.links.new(source, target)
    assert mean_relative_error(ours()[0], cycles(tmp_path)) < CLOSE


def sky(kind, **properties):
    """A world of one sky without a disc."""
    tree, background = new_world()
    properties = {"sun_disc": False, **properties}
    aerosols = properties.pop("aerosols", 1.0)
    texture = add(tree, "TexSky", sky_type=kind, **properties)
    setattr(texture, "aerosol_density" if IS_5 else "dust_density", aerosols)
    tree.links.new(texture.outputs[0], background.inputs["Color"])
    return texture


SKIES = {
    "noon": {"sun_elevation": 1.2, "sun_rotation": 1.0},
    "evening": {"sun_elevation": 0.05, "sun_rotation": -0.5, "altitude": 100.0},
    "past the zenith": {"sun_elevation": 2.5 - 4.0 * np.pi, "sun_rotation": 1.0},
    "dusk": {"sun_elevation": -0.05, "sun_rotation": 3.0},
    "mountain haze": {"sun_elevation": 0.4, "altitude": 3000.0, "aerosols": 4.0, "ozone_density": 2.0},
    "thin air": {"sun_elevation": 0.7, "altitude": 30000.0, "air_density": 0.5, "aerosols": 0.0, "ozone_density": 0.0},
}


@pytest.mark.parametrize("case", SKIES)
@pytest.mark.parametrize("kind", PHYSICAL_SKIES)
def test_physical_skies(kind, case, tmp_path):
    sky(kind, **SKIES[case])
    shown, lights, texts = ours()
    assert mean_relative_error(shown, cycles(tmp_path)) < CLOSE
    assert lights == ()
    assert texts == ()


@pytest.mark.parametrize("turbidity", [2.2, 6.0])
def test_preetham(turbidity, tmp_path):
    sky("PREETHAM", sun_direction=(0.3, 0.9, 0.2), turbidity=turbidity)
    assert mean_relative_error(ours()[0], cycles(tmp_path)) < CLOSE


def disc_by_cycles(texture, folder):
    """(3,) irradiance of the disc: a close-up with it minus one without, times cosine⁴: it is flat."""
    scene, side = bpy.context.scene, 160
    camera = bpy.data.cameras.new("Close-up")
    camera.angle = 1.2 * texture.sun_size
    scene.camera = bpy.data.objects.new("Close-up", camera)
    scene.collection.objects.link(scene.camera)
    towards = mathutils.Vector(sun_direction(texture))
    scene.camera.rotation_euler = towards.to_track_quat("-Z", "Y").to_euler()
    pictures = []
    for shown in (True, False):
        texture.sun_disc = shown
        pictures.append(render(scene, folder, side, side))
    half = math.tan(0.5 * camera.angle)
    across = ((np.arange(side) + 0.5) / side * 2.0 - 1.0) * half
    cosine = 1.0 / np.sqrt(1.0 + across[:, None] ** 2 + across**2)
    return ((pictures[0] - pictures[1]) * cosine[..., None] ** 4).sum(axis=(0, 1)) * (2.0 * half / side) ** 2


def sun_direction(texture):
    """Clockwise from +Y."""
    horizontal = math.cos(texture.sun_elevation)
    return (
        math.sin(texture.sun_rotation) * horizontal,
        math.cos(texture.sun_rotation) * horizontal,
        math.sin(texture.sun_elevation),
    )


@pytest.mark.parametrize("case", [(0.5, 0.0095, 100.0), (0.003, 0.0095, 1.0), (0.3, 0.1, 5000.0), (2.5, 0.02, 0.0)])
@pytest.mark.parametrize("kind", PHYSICAL_SKIES)
def test_sun_disc(kind, case, tmp_path):
    elevation, size, altitude = case
    texture = sky(
        kind,
        sun_elevation=elevation,
        sun_size=size,
        altitude=altitude,
        sun_rotation=0.7,
        sun_disc=True,
        sun_intensity=0.8,
    )
    _, (sun,), _ = ours()
    assert sun.angle == pytest.approx(size)
    np.testing.assert_allclose(sun.world_from_light[:3, 2], sun_direction(texture), atol=1e-6)
    # The picture's 160² pixels have an edge of the disc between them: 0.3 %; setting, the horizon's row too.
    expected = disc_by_cycles(texture, tmp_path)
    np.testing.assert_allclose(sun.emission, expected, rtol=5e-3, atol=2e-3 * expected.max())


def test_a_sun_without_haze_and_air_is_the_one_in_space():
    """Far above the atmosphere's bulk nothing absorbs: irradiance is the darkened disc's mean, 0.8 of a flat one's."""
    space = Sky(Air(59000.0, 0.0, 0.0, 0.0), 1.0, 0.0, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), False, False)
    flat = sky_model._XYZ_FROM_IRRADIATED.sum(axis=0)
    # A wide sun: of narrower ones Cycles knows the solid angle less well.
    np.testing.assert_allclose(sun_irradiance(space, 0.1), 0.8 * flat, rtol=1e-3)
