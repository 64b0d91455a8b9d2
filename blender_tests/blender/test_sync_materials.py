# SPDX-License-Identifier: GPL-3.0-or-later
"""Node graphs become Principled constants and a texture; what cannot is told with material and node."""

import addon_utils
import bpy
import numpy as np
import pytest
from sync_scenes import (
    add,
    assert_texts,
    connect,
    make_image,
    make_material,
    make_object,
    mirrored_material,
    node_tree,
    sync,
    texture_node,
    textured,
)

from addon.scene import BaseColorSource, EmissionSampling, Material
from addon.sync import Mirror
from addon.sync.changes import Messages
from addon.sync.materials import missing_attribute_messages

F0_15 = 0.04


@pytest.mark.parametrize(
    ("shader", "inputs", "expected"),
    [
        (
            "ShaderNodeBsdfPrincipled",
            {"Base_Color": (0.1, 0.2, 0.3, 1), "Metallic": 0.4, "Roughness": 0.7, "IOR": 1.5, "Alpha": 0.0},
            {"base_color": (0.1, 0.2, 0.3), "metallic": 0.4, "roughness": 0.7, "specular": F0_15, "alpha": 0.0},
        ),
        ("ShaderNodeBsdfPrincipled", {"IOR": 1.5, "Specular_IOR_Level": 0.25}, {"specular": F0_15 / 2}),
        (
            "ShaderNodeBsdfPrincipled",
            {"Emission_Color": (1, 0.5, 0.25, 1), "Emission_Strength": 4.0},
            {"emission": (4.0, 2.0, 1.0)},
        ),
        ("ShaderNodeBsdfDiffuse", {"Color": (0.1, 0.2, 0.3, 1)}, {"base_color": (0.1, 0.2, 0.3), "specular": 0.0}),
        ("ShaderNodeBsdfDiffuse", {"Roughness": 0.25}, {"diffuse_roughness": 0.25}),
        ("ShaderNodeBsdfDiffuse", {"Roughness": 2.0}, {"diffuse_roughness": 1.0}),
        ("ShaderNodeBsdfPrincipled", {"Diffuse_Roughness": 0.75}, {"diffuse_roughness": 0.75, "roughness": 0.5}),
        (
            "ShaderNodeBsdfAnisotropic",
            {"Color": (0.1, 0.2, 0.3, 1), "Roughness": 0.25},
            {"base_color": (0.1, 0.2, 0.3), "metallic": 1.0, "roughness": 0.25},
        ),
        (
            "ShaderNodeEmission",
            {"Color": (1, 0, 0, 1), "Strength": 3.0},
            {"emission": (3, 0, 0), "base_color": (0, 0, 0)},
        ),
        ("ShaderNodeBsdfTransparent", {}, {"alpha": 0.0}),
    ],
)
def test_represented_exactly(empty_scene, shader, inputs, expected):
    mirrored, _, texts = mirrored_material(make_material("M", shader, **inputs)[0])
    for name, value in expected.items():
        np.testing.assert_allclose(getattr(mirrored, name), value, rtol=1e-5, atol=1e-7)
    assert texts == ()


@pytest.mark.parametrize(
    ("shader", "inputs", "word"),
    [
        ("ShaderNodeBsdfPrincipled", {"Transmission_Weight": 1.0}, "transmission"),
        ("ShaderNodeBsdfPrincipled", {"Subsurface_Weight": 0.5}, "subsurface"),
        ("ShaderNodeBsdfPrincipled", {"Coat_Weight": 0.5}, "coat"),
        ("ShaderNodeBsdfPrincipled", {"Sheen_Weight": 0.5}, "sheen"),
        ("ShaderNodeBsdfGlass", {}, "transmission"),
        ("ShaderNodeBsdfTranslucent", {}, "diffuse"),
        ("ShaderNodeBsdfHairPrincipled", {}, "not rendered"),
    ],
)
def test_approximated_with_a_warning(empty_scene, shader, inputs, word):
    material, node = make_material("Odd", shader, **inputs)
    _, _, texts = mirrored_material(material)
    assert_texts(texts, "“Odd”", f"“{node.name}”", word)


def test_transmission_takes_the_diffuse_share(empty_scene):
    material, _ = make_material("Glass", "ShaderNodeBsdfPrincipled", Transmission_Weight=0.75, Base_Color=(1, 1, 1, 1))
    assert mirrored_material(material)[0].base_color == pytest.approx((0.25, 0.25, 0.25))


def test_mix_shader_averages(empty_scene):
    material, first = make_material("Mix", "ShaderNodeBsdfDiffuse", Color=(1, 0, 0, 1))
    second = add(material, "ShaderNodeBsdfDiffuse", Color=(0, 0, 1, 1))
    mix = add(material, "ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.25
    connect(material, first.outputs[0], mix.inputs[1])
    connect(material, second.outputs[0], mix.inputs[2])
    connect(material, mix.outputs[0], material.node_tree.nodes["Material Output"].inputs[0])
    mirrored, _, texts = mirrored_material(material)
    assert mirrored.base_color == pytest.approx((0.75, 0, 0.25))
    assert texts == ()


@pytest.mark.parametrize(("roughness", "told"), [(0.0, False), (0.5, True)])
def test_mixed_diffuse_roughness_is_averaged_and_told(empty_scene, roughness, told):
    material, first = make_material("Mix", "ShaderNodeBsdfDiffuse", Roughness=roughness)
    second, mix = add(material, "ShaderNodeBsdfDiffuse"), add(material, "ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.25
    connect(material, first.outputs[0], mix.inputs[1])
    connect(material, second.outputs[0], mix.inputs[2])
    connect(material, mix.outputs[0], material.node_tree.nodes["Material Output"].inputs[0])
    mirrored, _, texts = mirrored_material(material)
    assert mirrored.diffuse_roughness == pytest.approx(0.75 * roughness)
    assert any("averages" in text for text in texts) == told


@pytest.mark.parametrize("sampling", list(EmissionSampling))
def test_emission_sampling_is_cycles(empty_scene, sampling):
    material, _ = make_material("Glow", "ShaderNodeEmission")
    assert material.cycles.emission_sampling == EmissionSampling.AUTO
    material.cycles.emission_sampling = sampling.value
    assert mirrored_material(material)[0].emission_sampling is sampling


def test_without_cycles_emission_is_sampled_where_it_is_worth_it(empty_scene):
    material, _ = make_material("Glow", "ShaderNodeEmission")
    material.cycles.emission_sampling = "NONE"
    addon_utils.disable("cycles")
    try:
        assert not hasattr(material, "cycles")
        assert mirrored_material(material)[0].emission_sampling is EmissionSampling.AUTO
    finally:
        addon_utils.enable("cycles")


@pytest.mark.parametrize(("shader", "expected"), [("ShaderNodeBsdfTransparent", 0.7), ("ShaderNodeEmission", 1.0)])
def test_mix_with_transparent_or_emission(empty_scene, shader, expected):
    material, first = make_material("Mix", "ShaderNodeBsdfDiffuse", Color=(0.5, 0.5, 0.5, 1))
    second = add(material, shader)
    mix = add(material, "ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.3
    connect(material, first.outputs[0], mix.inputs[1])
    connect(material, second.outputs[0], mix.inputs[2])
    connect(material, mix.outputs[0], material.node_tree.nodes["Material Output"].inputs[0])
    mirrored, _, _ = mirrored_material(material)
    assert mirrored.alpha == pytest.approx(expected)
    if shader == "ShaderNodeEmission":
        assert mirrored.emission == pytest.approx((0.3, 0.3, 0.3))
        assert mirrored.base_color == pytest.approx((0.35, 0.35, 0.35))
    else:
        assert mirrored.base_color == pytest.approx((0.5, 0.5, 0.5))


def test_add_shader_adds_emission(empty_scene):
    material, first = make_material("Add", "ShaderNodeBsdfDiffuse", Color=(0.5, 0.5, 0.5, 1))
    second = add(material, "ShaderNodeEmission", Strength=2.0)
    total = add(material, "ShaderNodeAddShader")
    connect(material, first.outputs[0], total.inputs[0])
    connect(material, second.outputs[0], total.inputs[1])
    connect(material, total.outputs[0], material.node_tree.nodes["Material Output"].inputs[0])
    mirrored, _, texts = mirrored_material(material)
    assert mirrored.base_color == pytest.approx((0.5, 0.5, 0.5))
    assert mirrored.emission == pytest.approx((2, 2, 2))
    assert texts == ()


def through_reroute(material, output):
    node = material.node_tree.nodes.new("NodeReroute")
    connect(material, output, node.inputs[0])
    return node.outputs[0]


def through_muted_gamma(material, output):
    node = add(material, "ShaderNodeGamma", Gamma=5.0)
    node.mute = True
    connect(material, output, node.inputs[0])
    return node.outputs[0]


def through_neutral_gamma(material, output):
    node = add(material, "ShaderNodeGamma", Gamma=1.0)
    connect(material, output, node.inputs[0])
    return node.outputs[0]


def through_mix(material, output):
    node = material.node_tree.nodes.new("ShaderNodeMix")
    node.data_type = "RGBA"
    node.inputs[0].default_value = 1.0
    connect(material, output, node.inputs[7])
    return node.outputs[2]


def through_group(material, output):
    """Two groups, one in the other."""
    for depth in range(2):
        group = bpy.data.node_groups.new(f"Group{depth}", "ShaderNodeTree")
        group.interface.new_socket("In", in_out="INPUT", socket_type="NodeSocketColor")
        group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
        entry, leave = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
        if depth == 0:
            group.links.new(entry.outputs[0], leave.inputs[0])
        else:
            inner = group.nodes.new("ShaderNodeGroup")
            inner.node_tree = bpy.data.node_groups["Group0"]
            group.links.new(entry.outputs[0], inner.inputs[0])
            group.links.new(inner.outputs[0], leave.inputs[0])
    node = material.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = bpy.data.node_groups["Group1"]
    connect(material, output, node.inputs[0])
    return node.outputs[0]


@pytest.mark.parametrize(
    "through", [through_reroute, through_muted_gamma, through_neutral_gamma, through_mix, through_group]
)
def test_texture_through_what_changes_nothing(empty_scene, through):
    material, shader, node = textured(make_image())
    connect(material, through(material, node.outputs["Color"]), shader.inputs["Base Color"])
    mirrored, _, texts = mirrored_material(material)
    assert mirrored.source is BaseColorSource.TEXTURE
    assert texts == ()


def test_texture_times_constant(empty_scene):
    material, shader, node = textured(make_image())
    mix = material.node_tree.nodes.new("ShaderNodeMix")
    mix.data_type, mix.blend_type = "RGBA", "MULTIPLY"
    mix.inputs[0].default_value = 0.5
    mix.inputs[7].default_value = (0.5, 0.0, 1.0, 1.0)
    connect(material, node.outputs["Color"], mix.inputs[6])
    connect(material, mix.outputs[2], shader.inputs["Base Color"])
    mirrored, _, texts = mirrored_material(material)
    assert mirrored.source is BaseColorSource.TEXTURE
    assert mirrored.base_color == pytest.approx((0.75, 0.5, 1.0))
    assert texts == ()


def test_cutout_by_mix_with_transparent(empty_scene):
    material, shader, node = textured(make_image())
    mix, transparent = add(material, "ShaderNodeMixShader"), add(material, "ShaderNodeBsdfTransparent")
    connect(material, node.outputs["Alpha"], mix.inputs[0])
    connect(material, transparent.outputs[0], mix.inputs[1])
    connect(material, shader.outputs[0], mix.inputs[2])
    connect(material, mix.outputs[0], material.node_tree.nodes["Material Output"].inputs[0])
    mirrored, _, texts = mirrored_material(material)
    assert mirrored.texture_alpha
    assert mirrored.alpha == 1.0
    assert texts == ()


def test_colour_attribute(empty_scene):
    material, shader = make_material("Vertex", "ShaderNodeBsdfPrincipled")
    node = add(material, "ShaderNodeVertexColor")
    node.layer_name = "Second"
    connect(material, node.outputs["Color"], shader.inputs["Base Color"])
    thing = make_object()
    thing.data.materials.append(material)
    for name, value in (("First", 0.1), ("Second", 0.7)):
        attribute = thing.data.color_attributes.new(name=name, type="FLOAT_COLOR", domain="POINT")
        for entry in attribute.data:
            entry.color = (value, value, value, 1.0)
    scene = sync().scene
    assert [m.source for m in scene.materials.values()] == [BaseColorSource.ATTRIBUTE]
    (mesh,) = scene.meshes.values()
    assert mesh.colors[0, 0] == pytest.approx(0.7)


def test_texture_for_roughness_becomes_its_mean(empty_scene):
    material, shader = make_material("Rough", "ShaderNodeBsdfPrincipled")
    image = make_image(color=(0.25, 0.25, 0.25, 1.0), space="Non-Color")
    connect(material, texture_node(material.node_tree, image).outputs["Color"], shader.inputs["Roughness"])
    mirrored, scene, texts = mirrored_material(material)
    assert mirrored.roughness == pytest.approx(0.25, abs=0.003)
    assert scene.images == {}
    assert_texts(texts, "“Rough”", "“Principled BSDF”", "Roughness")


def test_empty_slot_is_blenders_default(empty_scene):
    """Diffuse until 4.5, a Principled BSDF since 5.0; test_agreement_default_material compares it with Cycles'."""
    mirrored, _, texts = mirrored_material(None)
    assert mirrored.base_color == (0.8, 0.8, 0.8)
    assert mirrored.specular == (F0_15 if bpy.app.version >= (5, 0, 0) else 0.0)
    assert texts == ()


@pytest.mark.skipif(bpy.app.version >= (5, 0, 0), reason="from 5.0 on every material has nodes")
def test_material_without_nodes(empty_scene):
    material = bpy.data.materials.new("Plain")
    material.diffuse_color = (0.1, 0.2, 0.3, 1.0)
    mirrored, _, texts = mirrored_material(material)
    assert mirrored.base_color == pytest.approx((0.1, 0.2, 0.3))
    assert_texts(texts, "“Plain”", "no nodes")


@pytest.mark.parametrize(("alpha", "words"), [(0.75, "drawn opaque"), (0.25, "left out")])
def test_blended_transparency_is_told(empty_scene, alpha, words):
    mirrored, _, texts = mirrored_material(make_material("Film", "ShaderNodeBsdfPrincipled", Alpha=alpha)[0])
    assert mirrored.alpha == alpha
    assert_texts(texts, "“Film”", "“Principled BSDF”", "blended transparency is not rendered yet", words)


def test_blended_transparency_of_a_mix_is_told(empty_scene):
    material, first = make_material("Film", "ShaderNodeBsdfDiffuse")
    mix = add(material, "ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.25
    connect(material, first.outputs[0], mix.inputs[1])
    connect(material, add(material, "ShaderNodeBsdfTransparent").outputs[0], mix.inputs[2])
    connect(material, mix.outputs[0], material.node_tree.nodes["Material Output"].inputs[0])
    assert_texts(mirrored_material(material)[2], "“Film”", "“Mix Shader”", "blended transparency", "drawn opaque")


def test_mesh_without_uv_map_is_told(empty_scene):
    make_object("Bare").data.materials.append(textured(make_image())[0])
    messages = Messages()
    missing_attribute_messages(sync().scene, messages)
    assert_texts(messages.texts(), "“Painted”", "no UV map", "“Bare”")


def test_mesh_without_colour_attribute_is_told(empty_scene):
    material, shader = make_material("Vertex", "ShaderNodeBsdfPrincipled")
    connect(material, add(material, "ShaderNodeVertexColor").outputs["Color"], shader.inputs["Base Color"])
    make_object("Bare").data.materials.append(material)
    messages = Messages()
    missing_attribute_messages(sync().scene, messages)
    assert_texts(messages.texts(), "“Vertex”", "no colour attribute", "“Bare”")


def test_output_without_surface_is_black_and_told(empty_scene):
    mirrored, _, texts = mirrored_material(make_material("Hollow")[0])
    assert (mirrored.base_color, mirrored.specular) == ((0, 0, 0), 0)
    assert_texts(texts, "“Hollow”", "black")


def test_unknown_nodes_never_stop_a_sync(empty_scene):
    """Every shader node type plugged into base colour, roughness and surface."""
    kinds = [name for name in dir(bpy.types) if name.startswith("ShaderNode")]
    tried = 0
    for number, kind in enumerate(kinds):
        material, shader = make_material(f"M{number}", "ShaderNodeBsdfPrincipled")
        try:
            node = material.node_tree.nodes.new(kind)
        except RuntimeError:
            continue  # an abstract base class
        for output in node.outputs:
            target = shader.inputs["Base Color" if output.type in {"RGBA", "VECTOR"} else "Roughness"]
            if output.type == "SHADER":
                target = material.node_tree.nodes["Material Output"].inputs["Surface"]
            connect(material, output, target)
        make_object(kind).data.materials.append(material)
        tried += 1
    assert tried > 80
    for mirrored in sync().scene.materials.values():
        values = [*mirrored.base_color, mirrored.metallic, mirrored.roughness, mirrored.specular, mirrored.alpha]
        assert np.isfinite([*values, *mirrored.emission]).all(), mirrored.name


def world_radiance(scene: bpy.types.Scene, build) -> tuple[tuple[float, ...], tuple[str, ...]]:
    scene.world = bpy.data.worlds.new("Sky")
    tree = node_tree(scene.world)
    background, output = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs[0])
    build(tree, background)
    result = sync()
    return result.scene.world.radiance, result.warnings


def test_constant_world(empty_scene):
    def build(tree, background):
        background.inputs["Color"].default_value = (0.1, 0.2, 0.4, 1.0)
        background.inputs["Strength"].default_value = 2.0

    radiance, texts = world_radiance(empty_scene, build)
    assert radiance == pytest.approx((0.2, 0.4, 0.8))
    assert texts == ()


def test_no_world_is_black(empty_scene):
    assert sync().scene.world.radiance == (0, 0, 0)


def test_default_material_is_stable(empty_scene):
    make_object()
    mirror = Mirror()
    (first,) = sync(mirror).scene.materials.values()
    (second,) = sync(mirror).scene.materials.values()
    assert first is second
    assert isinstance(first, Material)
