# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour and value nodes: exact where the scene can hold it, told where not, and never a reason to have no picture."""

import math

import bpy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sync_scenes import (
    add,
    assert_texts,
    connect,
    cycles_pixel,
    make_image,
    make_material,
    mirrored_material,
    texture_node,
)

from addon.scene import BaseColorSource
from addon.sync.materials import expressions, surfaces
from addon.sync.materials.images import linear
from addon.sync.materials.operations import (
    BLENDS,
    LARGEST,
    MATH,
    compute,
    gamma,
    hue_saturation,
    limited,
    per_channel,
    reflectance,
)


def math_node(material, operation, *values, clamp=False):
    node = add(material, "ShaderNodeMath")
    node.operation, node.use_clamp = operation, clamp
    for entry, value in zip(node.inputs, values, strict=False):
        entry.default_value = value
    return node


def color_of(material, *channels):
    """An output with any colour, which a socket's own value could not hold."""
    node = add(material, "ShaderNodeCombineColor")
    for entry, channel in zip(node.inputs, channels, strict=True):
        connect(material, math_node(material, "ADD", channel, 0.0).outputs[0], entry)
    return node.outputs[0]


def image_on(material, **options):
    return texture_node(material.node_tree, make_image(**options))


def power(material, shader):
    node = math_node(material, "POWER", 1000.0, 200.0)
    connect(material, node.outputs[0], shader.inputs["Roughness"])
    return node


def huge_gamma(material, shader):
    node = add(material, "ShaderNodeGamma")
    connect(material, color_of(material, 1000.0, 0.5, 0.0), node.inputs["Color"])
    connect(material, math_node(material, "ADD", 300.0, 0.0).outputs[0], node.inputs["Gamma"])
    connect(material, node.outputs[0], shader.inputs["Base Color"])
    return node


def negative_ior(material, shader):
    connect(material, math_node(material, "ADD", -1.0, 0.0).outputs[0], shader.inputs["IOR"])


def negative_hue(material, shader):
    node = add(material, "ShaderNodeHueSaturation", Saturation=0.5)
    connect(material, color_of(material, 0.0, -1.0, 0.0), node.inputs["Color"])
    connect(material, node.outputs[0], shader.inputs["Base Color"])


@pytest.mark.parametrize(
    ("build", "expected"),
    [
        (power, {"roughness": 1.0}),
        (huge_gamma, {"base_color": (LARGEST, 0.0, 0.0)}),
        (negative_ior, {"specular": 1.0}),
        (negative_hue, {"base_color": (0.0, 0.0, 0.0)}),
    ],
)
def test_values_without_bounds(empty_scene, build, expected):
    material, shader = make_material("Wild", "ShaderNodeBsdfPrincipled")
    node = build(material, shader)
    mirrored, _, texts = mirrored_material(material)
    for name, value in expected.items():
        np.testing.assert_allclose(getattr(mirrored, name), value, atol=1e-4)
    if node is None:
        assert texts == ()
    else:
        assert_texts(texts, "“Wild”", f"“{node.name}”", "too large")


def test_emission_is_never_infinite(empty_scene):
    material, _ = make_material("Sun", "ShaderNodeEmission", Strength=1e6, Color=(1e38, 0.0, 0.0, 1.0))
    mirrored, _, texts = mirrored_material(material)
    assert mirrored.emission == (LARGEST, 0.0, 0.0)
    assert_texts(texts, "“Sun”", "“Emission”", "too large")


wild = st.floats(-LARGEST, LARGEST) | st.sampled_from([-1.0, 0.0, 1.0, 2.0, 300.0, -300.0, 1e-300, LARGEST, -LARGEST])
color = st.tuples(wild, wild, wild)


@given(first=color, second=color, values=st.tuples(wild, wild, wild, wild))
def test_no_operation_raises(first, second, values):
    results = [reflectance(values[0])]
    for name, operation in MATH.items():
        count = {"MULTIPLY_ADD": 3, "SQRT": 1, "ABSOLUTE": 1}.get(name, 2)
        results.append(compute(operation, *values[:count]))
    for operation in BLENDS.values():
        results.extend(per_channel(operation, first, second))
    results.extend(gamma(first, values[0]))
    results.extend(hue_saturation(first, *values))
    assert all(math.isfinite(limited(result)) for result in results)
    assert 0.0 <= results[0] <= 1.0


def hue(material):
    node = add(material, "ShaderNodeHueSaturation", Saturation=0.5, Fac=0.5)
    connect(material, color_of(material, 0.5, -1.0, 0.25), node.inputs["Color"])
    return node.outputs[0]


def white_gamma(material):
    node = add(material, "ShaderNodeGamma", Gamma=0.0)
    connect(material, color_of(material, 0.5, -1.0, 0.0), node.inputs["Color"])
    return node.outputs[0]


def powers(material):
    node = add(material, "ShaderNodeCombineColor")
    for entry, values in zip(node.inputs, [(0.0, 0.0), (-0.5, 2.0), (-0.5, 0.5)], strict=True):
        connect(material, math_node(material, "POWER", *values).outputs[0], entry)
    return node.outputs[0]


@pytest.mark.parametrize("build", [hue, white_gamma, powers])
def test_odd_values_are_as_in_cycles(empty_scene, tmp_path, build):
    material, shader = make_material("Lamp", "ShaderNodeEmission")
    connect(material, build(material), shader.inputs["Color"])
    bpy.ops.mesh.primitive_plane_add(size=20)
    bpy.context.object.data.materials.append(material)
    rendered = cycles_pixel(empty_scene, tmp_path / "plane.exr")
    bpy.data.objects.remove(bpy.context.object)
    np.testing.assert_allclose(mirrored_material(material)[0].emission, rendered, atol=1e-3)


def math_chain(material, shader, count):
    last = None
    for _ in range(count):
        node = math_node(material, "SUBTRACT", 1.0, 0.25)
        if last is not None:
            connect(material, last.outputs[0], node.inputs[0])
            connect(material, last.outputs[0], node.inputs[1])
        last = node
    connect(material, last.outputs[0], shader.inputs["Roughness"])


def shader_chain(material, shader, count):
    last = shader
    for _ in range(count):
        node = add(material, "ShaderNodeMixShader")
        connect(material, last.outputs[0], node.inputs[1])
        connect(material, last.outputs[0], node.inputs[2])
        last = node
    connect(material, last.outputs[0], material.node_tree.nodes["Material Output"].inputs[0])


@pytest.mark.parametrize("build", [math_chain, shader_chain])
def test_shared_nodes_are_read_once(empty_scene, monkeypatch, build):
    material, shader = make_material("Chain", "ShaderNodeBsdfPrincipled")
    build(material, shader, 12)
    read, find_source = [], expressions.find_source

    def counted(socket, groups):
        read.append(socket)
        return find_source(socket, groups)

    for module in (expressions, surfaces):
        monkeypatch.setattr(module, "find_source", counted)
    mirrored_material(material)
    assert 24 <= len(read) < 150


@pytest.mark.parametrize("build", [math_chain, shader_chain])
def test_endless_chain_is_cut_and_told(empty_scene, build):
    material, shader = make_material("Chain", "ShaderNodeBsdfPrincipled")
    build(material, shader, 400)
    assert_texts(mirrored_material(material)[2], "“Chain”", "nodes follow one another")


def to_grey(material, output):
    node = add(material, "ShaderNodeRGBToBW")
    connect(material, output, node.inputs[0])
    return node.outputs[0]


def green(material, output):
    node = add(material, "ShaderNodeSeparateColor")
    connect(material, output, node.inputs[0])
    return node.outputs["Green"]


def times_one(material, output):
    node = math_node(material, "MULTIPLY", 0.0, 1.0)
    connect(material, output, node.inputs[0])
    return node.outputs[0]


@pytest.mark.parametrize("space", ["sRGB", "Non-Color"])
@pytest.mark.parametrize("is_float", [False, True])
@pytest.mark.parametrize("convert", [to_grey, green, times_one])
def test_value_of_an_image_as_colour_is_grey(empty_scene, convert, is_float, space):
    material, shader = make_material("Grey", "ShaderNodeBsdfPrincipled")
    image = make_image(color=(0.2, 0.4, 0.6, 1.0), is_float=is_float, space="Linear Rec.709" if is_float else space)
    source = texture_node(material.node_tree, image)
    connect(material, convert(material, source.outputs["Color"]), shader.inputs["Base Color"])
    mirrored, scene, texts = mirrored_material(material)
    assert mirrored.source is BaseColorSource.TEXTURE
    encoded = not is_float and space == "sRGB"
    colors = [((c + 0.055) / 1.055) ** 2.4 if encoded else c for c in (0.2, 0.4, 0.6)]
    expected = colors[1] if convert is green else np.dot(colors, (0.2126, 0.7152, 0.0722))
    shown = linear(scene.images[mirrored.texture.image])
    np.testing.assert_allclose(shown[0, 0], (expected, expected, expected, 1.0), atol=0.004)
    assert texts == ()


def test_grey_image_keeps_its_cutout(empty_scene):
    material, shader = make_material("Leaf", "ShaderNodeBsdfPrincipled")
    source = image_on(material, color=(0.2, 0.4, 0.6, 0.8), space="Non-Color")
    connect(material, green(material, source.outputs["Color"]), shader.inputs["Base Color"])
    connect(material, source.outputs["Alpha"], shader.inputs["Alpha"])
    mirrored, scene, texts = mirrored_material(material)
    assert mirrored.texture_alpha
    np.testing.assert_array_equal(scene.images[mirrored.texture.image].pixels[0, 0], (102, 102, 102, 204))
    assert texts == ()


def test_alpha_of_an_image_as_colour(empty_scene):
    material, shader = make_material("Mask", "ShaderNodeBsdfPrincipled")
    source = image_on(material, color=(0.2, 0.4, 0.6, 0.8))
    connect(material, source.outputs["Alpha"], shader.inputs["Base Color"])
    mirrored, scene, texts = mirrored_material(material)
    image = scene.images[mirrored.texture.image]
    assert not image.srgb
    np.testing.assert_array_equal(image.pixels[0, 0], (204, 204, 204, 255))
    assert texts == ()


def test_grey_of_a_tinted_image_is_its_mean_and_told(empty_scene):
    material, shader = make_material("Tinted", "ShaderNodeBsdfPrincipled")
    source = image_on(material, color=(0.2, 0.4, 0.6, 1.0), space="Non-Color")
    tint = add(material, "ShaderNodeMixRGB", Fac=1.0, Color2=(1.0, 0.0, 0.5, 1.0))
    tint.blend_type = "MULTIPLY"
    connect(material, source.outputs["Color"], tint.inputs["Color1"])
    connect(material, to_grey(material, tint.outputs[0]), shader.inputs["Base Color"])
    mirrored, _, texts = mirrored_material(material)
    assert mirrored.source is BaseColorSource.CONSTANT
    np.testing.assert_allclose(mirrored.base_color, 0.2126 * 0.2 + 0.0722 * 0.3, atol=1e-3)
    assert_texts(texts, "“Tinted”", "“RGB to BW”", "mean")


@pytest.mark.parametrize("convert", [to_grey, green, times_one])
def test_value_of_a_colour_attribute_is_told(empty_scene, convert):
    material, shader = make_material("Vertex", "ShaderNodeBsdfPrincipled")
    source = add(material, "ShaderNodeVertexColor")
    output = convert(material, source.outputs["Color"])
    connect(material, output, shader.inputs["Base Color"])
    mirrored, _, texts = mirrored_material(material)
    assert mirrored.source is BaseColorSource.CONSTANT
    assert mirrored.base_color == pytest.approx((1.0, 1.0, 1.0))
    assert_texts(texts, "“Vertex”", f"“{output.node.name}”", "colour attribute", "white")


def clamped_math(material, output, factor):
    node = math_node(material, "MULTIPLY", 0.0, factor, clamp=True)
    connect(material, output, node.inputs[0])
    return node.outputs[0]


def clamped_mix(material, output, factor):
    node = material.node_tree.nodes.new("ShaderNodeMix")
    node.data_type, node.blend_type, node.clamp_result = "RGBA", "MULTIPLY", True
    node.inputs[0].default_value = 1.0
    connect(material, color_of(material, factor, factor, factor), node.inputs[7])
    connect(material, output, node.inputs[6])
    return node.outputs[2]


def clamped_legacy_mix(material, output, factor):
    node = add(material, "ShaderNodeMixRGB", Fac=1.0)
    node.blend_type, node.use_clamp = "MULTIPLY", True
    connect(material, color_of(material, factor, factor, factor), node.inputs["Color2"])
    connect(material, output, node.inputs["Color1"])
    return node.outputs[0]


@pytest.mark.parametrize("multiply", [clamped_math, clamped_mix, clamped_legacy_mix])
@pytest.mark.parametrize(("factor", "exact"), [(0.5, True), (4.0, False)])
def test_clamped_product_with_a_texture(empty_scene, multiply, factor, exact):
    material, shader = make_material("Clamp", "ShaderNodeBsdfPrincipled")
    source = image_on(material, color=(0.6, 0.6, 0.6, 1.0), space="Non-Color")
    output = multiply(material, source.outputs["Color"], factor)
    connect(material, output, shader.inputs["Base Color"])
    mirrored, _, texts = mirrored_material(material)
    if exact:
        assert mirrored.source is BaseColorSource.TEXTURE
        assert mirrored.base_color == pytest.approx((0.5, 0.5, 0.5))
        assert texts == ()
    else:
        assert mirrored.source is BaseColorSource.CONSTANT
        assert mirrored.base_color == pytest.approx((1.0, 1.0, 1.0))
        assert_texts(texts, "“Clamp”", f"“{output.node.name}”", "clamped", "mean")


def test_clamped_mix_of_constants(empty_scene):
    material, shader = make_material("Clamp", "ShaderNodeBsdfPrincipled")
    connect(material, clamped_mix(material, color_of(material, 2.0, 0.5, -1.0), 1.0), shader.inputs["Base Color"])
    assert mirrored_material(material)[0].base_color == pytest.approx((1.0, 0.5, 0.0))
