# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's world as one constant radiance."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..scene import World
from .changes import Messages
from .materials import ImageTable, evaluate_emission, has_nodes

if TYPE_CHECKING:
    import bpy


def read_world(world: bpy.types.World | None, images: ImageTable, messages: Messages) -> World:
    """The world's radiance: black without a world or surface, a mean (with a message) where it is not constant."""
    if world is None:
        return World()
    if not has_nodes(world):
        red, green, blue = world.color
        return World((red, green, blue))
    owner = f"World “{world.name}”"
    radiance, warnings = evaluate_emission(owner, world.node_tree, "ShaderNodeOutputWorld", images)
    messages.extend("world", warnings)
    return World(radiance)
