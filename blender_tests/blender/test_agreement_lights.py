# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light of every light type against Cycles, on a sphere over a plane, without shadows or bounces."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from agreement_fixtures import Pair, render_pair
from engine_fixtures import registered_fixture  # noqa: F401

CYCLES_SAMPLES = 256
OUR_SAMPLES = 512
"""Samples of the light are the same in all pixels, so their error is not averaged over the picture."""


@dataclass(frozen=True)
class LightCase:
    """A light type and the properties that are set on it."""

    kind: str
    properties: dict[str, Any] = field(default_factory=dict)
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


LIGHTS = {
    "point without size": LightCase("POINT", {"energy": 120.0, "shadow_soft_size": 0.0}),
    "point with radius": LightCase("POINT", {"energy": 120.0, "shadow_soft_size": 0.4}),
    "point as a sphere": LightCase("POINT", {"energy": 120.0, "shadow_soft_size": 0.4, "use_soft_falloff": False}),
    "coloured point": LightCase("POINT", {"energy": 120.0, "color": (1.0, 0.4, 0.1), "shadow_soft_size": 0.0}),
    "spot": LightCase(
        "SPOT", {"energy": 300.0, "spot_size": math.radians(70), "spot_blend": 0.4, "shadow_soft_size": 0.0}
    ),
    "spot with radius": LightCase(
        "SPOT", {"energy": 300.0, "spot_size": math.radians(70), "spot_blend": 0.4, "shadow_soft_size": 0.2}
    ),
    "spot as a sphere": LightCase(
        "SPOT",
        {
            **{"energy": 300.0, "spot_size": math.radians(70), "spot_blend": 0.4},
            **{"shadow_soft_size": 0.2, "use_soft_falloff": False},
        },
    ),
    "sharp sun": LightCase("SUN", {"energy": 3.0, "angle": 0.0}),
    "wide sun": LightCase("SUN", {"energy": 3.0, "angle": math.radians(30)}),
    "square": LightCase("AREA", {"energy": 80.0, "shape": "SQUARE", "size": 1.2}),
    "rectangle": LightCase("AREA", {"energy": 80.0, "shape": "RECTANGLE", "size": 2.0, "size_y": 0.5}),
    "disk": LightCase("AREA", {"energy": 80.0, "shape": "DISK", "size": 1.2}),
    "ellipse": LightCase("AREA", {"energy": 80.0, "shape": "ELLIPSE", "size": 2.0, "size_y": 0.6}),
    "scaled rectangle": LightCase(
        "AREA", {"energy": 80.0, "shape": "RECTANGLE", "size": 1.0, "size_y": 0.5}, scale=(2.0, 1.5, 1.0)
    ),
    "area with spread": LightCase("AREA", {"energy": 80.0, "shape": "SQUARE", "size": 1.2, "spread": math.radians(80)}),
}

# Cycles' plastic compensates the energy that a rough dielectric layer loses; ours does to first order.
MATERIALS = {
    "diffuse": {"Base Color": (0.7, 0.5, 0.3, 1.0), "Roughness": 1.0, "Specular IOR Level": 0.0},
    "metal": {"Base Color": (0.9, 0.7, 0.4, 1.0), "Roughness": 0.45, "Metallic": 1.0},
    "plastic": {"Base Color": (0.3, 0.5, 0.7, 1.0), "Roughness": 0.5},
}

# Lights that the glossy surfaces are lit by; the diffuse one sees them all.
GLOSSY = ("point without size", "point with radius", "spot", "sharp sun", "wide sun", "rectangle")


def sphere_over_plane(case: LightCase, values: dict[str, Any]) -> bpy.types.Scene:
    """A lit scene that nothing shadows: Cycles' shadows are off too, and light does not bounce."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 40, 100
    scene.cycles.max_bounces = 0
    material = bpy.data.materials.new("Surface")
    material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    for name, value in values.items():
        inputs[name].default_value = value
    bpy.ops.mesh.primitive_plane_add(size=6.0)
    bpy.context.object.data.materials.append(material)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=0.7, location=(0.3, 0.2, 0.7))
    bpy.context.object.data.shade_smooth()
    bpy.context.object.data.materials.append(material)
    light = bpy.data.lights.new("Light", case.kind)
    for name, value in case.properties.items():
        setattr(light, name, value)
    light.use_shadow = False
    lamp = bpy.data.objects.new("Light", light)
    lamp.location, lamp.rotation_euler, lamp.scale = (-1.0, -0.8, 2.6), (-0.35, 0.45, 0.3), case.scale
    scene.collection.objects.link(lamp)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -4.6, 3.4), (math.radians(56), 0.0, 0.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene


@pytest.mark.usefixtures("registered")
@pytest.mark.parametrize(
    ("name", "surface"),
    [(name, "diffuse") for name in LIGHTS] + [(name, item) for name in GLOSSY for item in ("metal", "plastic")],
)
def test_direct_light_is_cycles(name: str, surface: str, tmp_path: Path) -> None:
    scene = sphere_over_plane(LIGHTS[name], MATERIALS[surface])
    pair = render_pair(scene, tmp_path, cycles_samples=CYCLES_SAMPLES, our_samples=OUR_SAMPLES)
    assert_same_light(pair, surface)


@pytest.mark.usefixtures("registered")
@pytest.mark.parametrize("surface", MATERIALS)
def test_world_light_is_cycles(surface: str, tmp_path: Path) -> None:
    """A world of one colour on a sphere by itself, which nothing hides from any part of the world."""
    scene = sphere_over_plane(LIGHTS["sharp sun"], MATERIALS[surface])
    for name in ("Plane", "Light"):
        bpy.data.objects.remove(bpy.data.objects[name])
    scene.cycles.max_bounces = 1  # Cycles finds a world of one colour by bouncing
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.2, 0.5, 0.9, 1.0)
    background.inputs["Strength"].default_value = 1.5
    assert_same_light(render_pair(scene, tmp_path, cycles_samples=CYCLES_SAMPLES, our_samples=1), surface)


def assert_same_light(pair: Pair, surface: str) -> None:
    """The light that the surfaces reflect: its sum, and where it is."""
    theirs, ours = (passes["Combined"][pair.covered][:, :3].astype(np.float64) for passes in (pair.cycles, pair.ours))
    assert theirs.mean() > 0.02, "the case must be lit"
    total = ours.sum(axis=0) / theirs.sum(axis=0) - 1.0
    spread = np.abs(ours - theirs).sum() / theirs.sum()
    assert np.abs(total).max() < (0.025 if surface == "plastic" else 0.01), (
        f"total light differs by {total} (per colour channel)"
    )
    assert spread < 0.02, f"light is distributed differently: {spread:.1%} of it is elsewhere"
