# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's Denoise node takes our Diffuse Color and Normal passes as what it calls albedo and normal."""

from pathlib import Path

import bpy
import numpy as np
import OpenEXR
import pytest
from engine_fixtures import registered_fixture  # noqa: F401
from test_agreement_indirect import with_area_light

pytestmark = pytest.mark.usefixtures("registered")


def compositor(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """The scene's empty compositor."""
    if bpy.app.version < (5, 0, 0):
        scene.use_nodes = True
        scene.node_tree.nodes.clear()
        return scene.node_tree
    scene.compositing_node_group = bpy.data.node_groups.new("Compositor", "CompositorNodeTree")
    scene.compositing_node_group.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    return scene.compositing_node_group


def denoise(scene: bpy.types.Scene, *, guided: bool) -> None:
    """Let the compositor denoise the picture, `guided` by the passes that show where surfaces change."""
    tree = compositor(scene)
    layers, node = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeDenoise")
    output = tree.nodes.new("CompositorNodeComposite" if bpy.app.version < (5, 0, 0) else "NodeGroupOutput")
    tree.links.new(layers.outputs["Image"], node.inputs["Image"])
    if guided:
        tree.links.new(layers.outputs["Normal"], node.inputs["Normal"])
        color = layers.outputs.get("Diffuse Color") or layers.outputs["DiffCol"]
        tree.links.new(color, node.inputs["Albedo"])
    tree.links.new(node.outputs["Image"], output.inputs[0])


def picture(scene: bpy.types.Scene, folder: Path) -> np.ndarray:
    """(H, W, 3) what a render writes."""
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(folder / "picture.exr")
    bpy.ops.render.render(write_still=True)
    channels = OpenEXR.File(scene.render.filepath, separate_channels=True).channels()
    return np.stack([channels[name].pixels for name in "RGB"], axis=-1).astype(np.float64)


def test_the_denoise_node_takes_our_passes(tmp_path: Path) -> None:
    """A picture without our own filters comes nearer to one with many rays, and nearer still by the passes."""
    scene = with_area_light()
    scene.render.engine = "DEEP_GBUFFER"
    scene.render.resolution_x = scene.render.resolution_y = 128
    layer, indirect = scene.view_layers[0], scene.deep_gbuffer.indirect
    layer.use_pass_normal = layer.use_pass_diffuse_color = True
    scene.deep_gbuffer.samples = 1
    indirect.spatial_filter, indirect.render.divisor = False, "1"
    indirect.render.rays = 64
    truth = picture(scene, tmp_path)
    indirect.render.rays = 1
    noisy = picture(scene, tmp_path)
    denoise(scene, guided=False)
    plain = picture(scene, tmp_path)
    denoise(scene, guided=True)
    guided = picture(scene, tmp_path)
    noise, left, least = (np.abs(found - truth).mean() for found in (noisy, plain, guided))
    assert left < 0.5 * noise
    assert least < 0.95 * left
