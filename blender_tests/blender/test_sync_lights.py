# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights have Cycles' radiometry: closed forms, and tiny Cycles renders of a white diffuse floor."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Euler
from sync_scenes import link, make_material, node_tree, only_light, sync

from addon.scene import AreaShape, Light, LightKind
from addon.sync.changes import same_fields

HEIGHT = 2.0


def add_light(kind: str, scale=(1, 1, 1), **properties) -> bpy.types.Object:
    data = bpy.data.lights.new("Lamp", kind)
    for name, value in properties.items():
        setattr(data, name, value)
    lamp = link("Lamp", data)
    lamp.location.z, lamp.scale = HEIGHT, scale
    return lamp


@pytest.mark.parametrize(
    ("kind", "properties", "emission"),
    [
        ("POINT", {"energy": 100.0}, 100 / (4 * math.pi)),
        ("POINT", {"energy": 100.0, "shadow_soft_size": 0.5, "normalize": False}, 25.0),
        ("POINT", {"energy": 100.0, "shadow_soft_size": 0.0, "normalize": False}, 100 / math.pi),
        ("SPOT", {"energy": 8.0}, 2 / math.pi),
        ("SUN", {"energy": 3.0, "angle": 0.2}, 3.0),
        ("SUN", {"energy": 3.0, "angle": 0.2, "normalize": False}, 3 * math.pi * math.sin(0.1) ** 2),
        ("AREA", {"energy": 10.0, "size": 2.0}, 10 / (4 * math.pi)),
        ("AREA", {"energy": 10.0, "size": 2.0, "shape": "DISK"}, 10 / math.pi**2),
        ("AREA", {"energy": 10.0, "size": 2.0, "size_y": 3.0, "shape": "ELLIPSE"}, 10 / (1.5 * math.pi**2)),
        ("AREA", {"energy": 10.0, "size": 2.0, "normalize": False}, 10 / math.pi),
        ("POINT", {"energy": 100.0, "exposure": 2.0}, 400 / (4 * math.pi)),
    ],
)
def test_emission_in_closed_form(empty_scene, kind, properties, emission):
    add_light(kind, **properties)
    np.testing.assert_allclose(only_light(sync().scene).emission, [emission] * 3, rtol=1e-6)


def test_scale_enlarges_area_lights_at_equal_power(empty_scene):
    add_light("AREA", scale=(2, 3, 4), energy=10.0, size=0.5)
    light = only_light(sync().scene)
    np.testing.assert_allclose(light.size, (1.0, 1.5), rtol=1e-6)
    np.testing.assert_allclose(light.emission, [10 / (1.5 * math.pi)] * 3, rtol=1e-6)


@pytest.mark.parametrize("scale", [(1, 1, 1), (2, 3, 0.5), (-1, 1, 1), (0, 1, 1), (1, 1, -1)])
def test_orientation_is_rigid_and_keeps_the_direction(empty_scene, scale):
    lamp = add_light("SPOT", scale=scale)
    lamp.rotation_euler = (0.3, 0.5, 0.7)
    light = only_light(sync().scene)
    rotation = light.world_from_light[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-6)
    direction = Euler(lamp.rotation_euler).to_matrix().col[2] * math.copysign(1.0, scale[2])
    np.testing.assert_allclose(rotation[:, 2], direction, atol=1e-6)
    np.testing.assert_allclose(light.world_from_light[:3, 3], (0, 0, HEIGHT))


def test_a_portal_does_not_shine(empty_scene):
    lamp = add_light("AREA")
    lamp.data.cycles.is_portal = True
    assert sync().scene.lights == ()
    lamp.data.cycles.is_portal = False
    lamp.data.update_tag()
    assert len(sync().scene.lights) == 1


def test_light_without_direction_is_told(empty_scene):
    add_light("SPOT", scale=(1, 1, 0))
    result = sync()
    assert result.scene.lights == ()
    assert any("“Lamp”" in text for text in result.warnings)


def test_light_nodes_multiply(empty_scene):
    lamp = add_light("SUN", energy=2.0)
    tree = node_tree(lamp.data)
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputLight")
    emission.inputs["Color"].default_value, emission.inputs["Strength"].default_value = (1, 0.5, 0.25, 1), 3.0
    tree.links.new(emission.outputs[0], output.inputs[0])
    np.testing.assert_allclose(only_light(sync().scene).emission, (6.0, 3.0, 1.5))


def test_other_properties(empty_scene):
    add_light("SPOT", spot_size=1.1, spot_blend=0.3, shadow_soft_size=0.2, diffuse_factor=0.5, use_shadow=False)
    light = only_light(sync().scene)
    assert (light.kind, light.casts_shadow, light.diffuse_factor) == (LightKind.SPOT, False, 0.5)
    np.testing.assert_allclose((light.angle, light.blend, light.radius), (1.1, 0.3, 0.2), rtol=1e-6)


@pytest.mark.parametrize("instanced", [False, True], ids=["lamp", "instancer"])
@pytest.mark.parametrize(
    ("attribute", "factors"),
    [("visible_diffuse", (0.0, 0.75)), ("visible_glossy", (0.5, 0.0))],
    ids=["diffuse", "glossy"],
)
def test_rays_that_miss_a_light_get_nothing_from_it(empty_scene, attribute, factors, instanced):
    lamp = add_light("POINT", diffuse_factor=0.5, specular_factor=0.75)
    owner = placed_by_instancer(lamp) if instanced else lamp
    light = only_light(sync().scene)
    assert (light.diffuse_factor, light.specular_factor) == (0.5, 0.75)
    setattr(owner, attribute, False)
    light = only_light(sync().scene)
    assert (light.diffuse_factor, light.specular_factor) == factors


def placed_by_instancer(lamp: bpy.types.Object) -> bpy.types.Object:
    """An empty that instances a lamp which is nowhere else in the scene."""
    collection = bpy.data.collections.new("Lamps")
    collection.objects.link(lamp)
    bpy.context.scene.collection.objects.unlink(lamp)
    empty = link("Placer", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    return empty


@pytest.mark.parametrize(
    ("kind", "absolute", "texel"),
    [("SUN", False, 0.25), ("POINT", True, 0.25), ("AREA", True, 0.25), ("SPOT", False, 0.0)],
)
def test_a_resolution_limit_at_a_fixed_distance_limits_shadow_maps(empty_scene, kind, absolute, texel):
    lamp = add_light(kind, shadow_maximum_resolution=0.25)
    if kind != "SUN":
        lamp.data.use_absolute_resolution = absolute
    assert only_light(sync().scene).shadow_texel == texel


def test_eevees_custom_distance_changes_nothing(empty_scene):
    lamp = add_light("POINT", energy=10.0)
    before = only_light(sync().scene)
    lamp.data.use_custom_distance, lamp.data.cutoff_distance = True, 0.1
    assert same_fields(only_light(sync().scene), before)


def irradiance_below(light: Light) -> np.ndarray:
    """RGB irradiance of a floor `HEIGHT` metres below a light that points down at it."""
    emission = np.array(light.emission)
    if light.kind is LightKind.SUN:
        return emission
    if light.kind is not LightKind.AREA:
        return emission / HEIGHT**2
    steps = (np.arange(300) + 0.5) / 300 - 0.5
    x, y = np.meshgrid(steps * light.size[0], steps * light.size[1])
    inside = np.ones_like(x)
    if light.shape is AreaShape.ELLIPSE:
        inside = ((2 * x / light.size[0]) ** 2 + (2 * y / light.size[1]) ** 2 <= 1.0).astype(float)
    squared = x**2 + y**2 + HEIGHT**2
    return emission * (HEIGHT**2 / squared**2 * inside).mean() * light.size[0] * light.size[1]


@pytest.mark.parametrize(
    ("kind", "scale", "properties"),
    [
        ("POINT", (1, 1, 1), {"energy": 10.0, "shadow_soft_size": 0.0, "use_temperature": True, "temperature": 3000.0}),
        ("SPOT", (3, 3, 3), {"energy": 10.0, "shadow_soft_size": 0.0, "color": (1.0, 0.5, 0.25), "exposure": 1.0}),
        ("SUN", (1, 1, 1), {"energy": 3.0, "angle": 0.1, "normalize": False}),
        ("AREA", (2, 3, 1), {"energy": 10.0, "size": 0.5}),
        ("AREA", (1, 2, 1), {"energy": 10.0, "size": 1.0, "size_y": 0.5, "shape": "ELLIPSE"}),
        ("AREA", (1, 1, 1), {"energy": 10.0, "size": 1.5, "shape": "DISK", "normalize": False}),
    ],
)
def test_same_irradiance_as_cycles(empty_scene, tmp_path, kind, scale, properties):
    add_light(kind, scale, **properties)
    bpy.ops.mesh.primitive_plane_add(size=100)
    material, _ = make_material("White", "ShaderNodeBsdfDiffuse", Color=(1, 1, 1, 1))
    bpy.context.object.data.materials.append(material)
    camera = link("Camera", bpy.data.cameras.new("Camera"))
    camera.location.z, camera.data.type, camera.data.ortho_scale = 1.5, "ORTHO", 0.002
    empty_scene.camera = camera
    render = empty_scene.render
    render.engine, render.resolution_x, render.resolution_y = "CYCLES", 4, 4
    empty_scene.cycles.samples, empty_scene.cycles.use_denoising = 64, False
    empty_scene.cycles.sample_clamp_indirect, empty_scene.cycles.max_bounces = 0.0, 0
    empty_scene.view_settings.view_transform = "Raw"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.filepath = str(tmp_path / "floor.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(render.filepath)
    radiance = np.array(image.pixels[:]).reshape(-1, 4)[:, :3].mean(axis=0)
    np.testing.assert_allclose(irradiance_below(only_light(sync().scene)), radiance * math.pi, rtol=0.01)
