# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's world as one constant radiance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..scene import World
from .changes import Messages
from .materials import ImageTable, evaluate_emission, has_nodes

if TYPE_CHECKING:
    import bpy


def read_world(depsgraph: bpy.types.Depsgraph, images: ImageTable, messages: Messages) -> World:
    """The radiance of the view layer's world, its own or the scene's.

    Black where the layer has no Environment and without a world or surface; a mean (with a message) where it is not
    constant.
    """
    scene: Any = depsgraph.scene_eval
    view_layer: Any = depsgraph.view_layer_eval
    world = view_layer.world_override or scene.world
    if world is None or not view_layer.use_sky:
        return World()
    if not has_nodes(world):
        red, green, blue = world.color
        return World((red, green, blue))
    owner = f"World “{world.name}”"
    radiance, warnings = evaluate_emission(owner, world.node_tree, "ShaderNodeOutputWorld", images)
    messages.extend("world", warnings)
    return World(radiance)
