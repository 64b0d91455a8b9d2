# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds of shader nodes, as Cycles shows them all around and as they are mirrored."""

from pathlib import Path

import bpy
import numpy as np
from sync_scenes import depsgraph, link, node_tree

from addon.scene import Light, World
from addon.scene.equirectangular import look_up, texel_directions
from addon.sync.changes import Messages
from addon.sync.materials import ImageTable
from addon.sync.world import WorldTable

HEIGHT, WIDTH = 32, 64
IS_5 = bpy.app.version >= (5, 0, 0)


def new_world(name: str = "Sky"):
    """The scene's new world: its node tree and its background node, of strength 1."""
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new(name)
    tree = node_tree(scene.world)
    background, output = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
    background.inputs["Strength"].default_value = 1.0
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    return tree, background


def add(tree, kind: str, **properties):
    """A new node with properties; `kind` without its beginning."""
    node = tree.nodes.new(f"ShaderNode{kind}")
    for name, value in properties.items():
        setattr(node, name, value)
    return node


def read(table: WorldTable | None = None, images: ImageTable | None = None):
    """(world, lights, texts) of the current scene."""
    messages = Messages()
    images = images or ImageTable()
    images.begin(frozenset(), messages)
    world, lights = (table or WorldTable()).read(depsgraph(), images, messages)
    return world, lights, messages.texts()


def radiance(world: World, directions: np.ndarray) -> np.ndarray:
    """(..., 3) of unit directions (..., 3) in world space."""
    if world.environment is None:
        return np.broadcast_to(np.array(world.radiance), directions.shape)
    if world.environment_from_world is not None:
        directions = directions @ world.environment_from_world.T
    return look_up(world.environment.pixels, directions) * world.radiance


def ours() -> tuple[np.ndarray, tuple[Light, ...], tuple[str, ...]]:
    """(HEIGHT, WIDTH, 3) radiance all around as mirrored, lights and texts."""
    world, lights, texts = read()
    return radiance(world, texel_directions(HEIGHT, WIDTH)), lights, texts


def cycles(folder: Path) -> np.ndarray:
    """(HEIGHT, WIDTH, 3) radiance all around as Cycles renders it."""
    scene = bpy.context.scene
    data = bpy.data.cameras.new("All around")
    scene.camera = link("All around", data)
    data.type = "PANO"
    data.panorama_type = "EQUIRECTANGULAR"
    scene.camera.rotation_euler = (np.pi / 2.0, 0.0, -np.pi / 2.0)
    pixels = render(scene, folder)
    assert pixels.shape == (HEIGHT, WIDTH, 3)
    return pixels


def render(scene: bpy.types.Scene, folder: Path, width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    """(height, width, 3) float64 through the centres of pixels by Cycles, row 0 at the bottom."""
    scene.render.engine, scene.render.resolution_percentage = "CYCLES", 100
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.use_compositing = scene.render.use_sequencer = False
    settings = scene.cycles
    settings.samples, settings.use_adaptive_sampling, settings.use_denoising = 1, False, False
    settings.pixel_filter_type, settings.filter_width = "BLACKMAN_HARRIS", 0.01
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    path = folder / "cycles.exr"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path), check_existing=False)
    values = np.array(image.pixels[:]).reshape(height, width, -1)[..., :3]
    bpy.data.images.remove(image)
    return values


def smooth_image(name: str = "Panorama", size=(128, 64)) -> bpy.types.Image:
    """A float image of broad waves, without a seam, whose halves and channels all differ."""
    width, height = size
    image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=True)
    across, up = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    pixels = np.ones((height, width, 4), np.float32)
    for channel in range(3):
        wave = np.sin(2.0 * np.pi * across * (channel + 1)) * np.sin(np.pi * up)
        pixels[..., channel] = 1.0 + 0.7 * wave + channel * up
    image.pixels.foreach_set(pixels.ravel())
    return image


def mean_relative_error(shown: np.ndarray, expected: np.ndarray) -> float:
    """Mean absolute difference over the mean."""
    return float(np.abs(shown - expected).mean() / expected.mean())
