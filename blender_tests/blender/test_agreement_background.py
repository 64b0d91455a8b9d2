# SPDX-License-Identifier: GPL-3.0-or-later
"""The world behind everything, rendered by this engine through a camera, against Cycles."""

import bpy
import numpy as np
import pytest
from agreement_fixtures import render_pair
from agreement_measures import difference, write_sheet
from engine_fixtures import registered_fixture  # noqa: F401
from sync_scenes import link
from world_panorama import IS_5, add, new_world, smooth_image

pytestmark = pytest.mark.usefixtures("registered", "empty_scene")


def constant(tree, background):
    background.inputs["Color"].default_value = (0.2, 0.5, 1.0, 1.0)


def gradient(tree, background):
    texture = add(tree, "TexGradient", gradient_type="RADIAL")
    tree.links.new(texture.outputs[0], background.inputs["Color"])


def turned_image(tree, background):
    texture, mapping = add(tree, "TexEnvironment", image=smooth_image()), add(tree, "Mapping")
    tree.links.new(add(tree, "TexCoord").outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    mapping.inputs["Rotation"].default_value = (0.3, -0.5, 1.1)
    background.inputs["Strength"].default_value = 2.0


def evening(tree, background):
    kind = "SINGLE_SCATTERING" if IS_5 else "NISHITA"
    texture = add(tree, "TexSky", sky_type=kind, sun_disc=False, sun_elevation=0.1, sun_rotation=0.4)
    tree.links.new(texture.outputs[0], background.inputs["Color"])


VIEWS = {"across the seam": (1.6, 0.2, 1.5), "the zenith": (3.0, 0.0, 0.3)}


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("build", [constant, gradient, turned_image, evening])
def test_background_is_cycles(build, view, tmp_path):
    scene = bpy.context.scene
    build(*new_world())
    camera = bpy.data.cameras.new("Camera")
    camera.angle = 1.9
    scene.camera = link("Camera", camera)
    scene.camera.rotation_euler = VIEWS[view]
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 48, 32, 100
    pair = render_pair(scene, tmp_path, passes=("z", "environment"))
    ours, theirs = (passes["Environment"][..., :3] for passes in (pair.ours, pair.cycles))
    measured = difference(ours, theirs, np.ones(ours.shape[:2], bool))
    sheet = write_sheet(tmp_path / "background.png", ours, theirs)
    # Maps are as in test_agreement_world; the rest is 8-bit weights of the texture unit and the film's half floats.
    assert measured.mean < 3e-3, f"{measured}; see {sheet}"
    np.testing.assert_allclose(pair.ours["Combined"][..., :3], ours, rtol=1e-5)
