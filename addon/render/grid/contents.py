# SPDX-License-Identifier: GPL-3.0-or-later
"""What the radiance grid holds of a scene, so that two scenes can be compared."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass

import numpy as np

from ...scene import Scene
from ...scene.arrays import Float32Array
from ..casters import instance_bounds
from ..draws import Draw
from ..geometry import drawing_order
from ..mesh_lights import MeshLight
from ..passes.base import Frame
from .changes import Surfaces


@dataclass(frozen=True)
class GridContents:
    """`key`: equal where grids hold the same surfaces. `surfaces`: what of each draw."""

    key: Hashable
    surfaces: Mapping[Hashable, Surfaces]


def contents_key(frame: Frame) -> Hashable:
    """Equal where a grid of the same cells holds the same surfaces."""
    scene = frame.scene
    surfaces = tuple(
        (draw.batch.key, draw.batch.version, draw.batch.mesh, scene.meshes[draw.batch.mesh].version, draw.first_index)
        for draw in frame.draws.of(scene).draws
    )
    materials = tuple((material.key, material.version) for material in scene.materials.values())
    images = tuple((image.key, image.version) for image in scene.images.values())
    sampled = tuple((light.key, light.front, light.back) for light in frame.plan.lights.mesh_lights)
    return surfaces, materials, images, sampled, frame.settings.alpha_threshold


def grid_contents(frame: Frame) -> GridContents:
    """What a grid holds of a frame's scene."""
    scene = frame.scene
    sampled = {light.key: light for light in frame.plan.lights.mesh_lights}
    surfaces: dict[Hashable, Surfaces] = {}
    for draw in frame.draws.of(scene).draws:
        batch, mesh = draw.batch, scene.meshes[draw.batch.mesh]
        surfaces[batch.key, draw.first_index] = Surfaces(
            (_appearance(scene, draw, sampled), frame.settings.alpha_threshold),
            batch.ids,
            batch.matrices,
            instance_bounds(mesh, batch),
        )
    return GridContents(contents_key(frame), surfaces)


def unsampled_emission(scene: Scene, draw: Draw, sampled: Mapping[str, MeshLight]) -> Float32Array | None:
    """(N, 2) float32 in drawing order: 1 where an instance's front and back emit light that no light is sampled for.

    `sampled`: emissive surfaces that are lights, by key. None where the draw's material emits nothing.
    """
    batch, mesh = draw.batch, scene.meshes[draw.batch.mesh]
    slot = next(slot for slot in mesh.slots if 3 * slot.first == draw.first_index)
    if not scene.materials[batch.materials[min(slot.slot, len(batch.materials) - 1)]].is_emissive:
        return None
    glow = np.ones((batch.count, 2), np.float32)
    for row, identity in enumerate(batch.ids.tolist()):
        light = sampled.get(f"{batch.key}/{slot.slot}/{identity}")
        if light is not None:
            glow[row] = (not light.front, not light.back)
    return glow[drawing_order(batch)]


def _appearance(scene: Scene, draw: Draw, sampled: Mapping[str, MeshLight]) -> Hashable:
    mesh, batch = scene.meshes[draw.batch.mesh], draw.batch
    slot = next(slot for slot in mesh.slots if 3 * slot.first == draw.first_index)
    material = scene.materials[batch.materials[min(slot.slot, len(batch.materials) - 1)]]
    image = None if draw.texture is None else (draw.texture, scene.images[draw.texture.image].version)
    glow = unsampled_emission(scene, draw, sampled)
    glows = None if glow is None else glow.tobytes()
    return mesh.key, mesh.version, draw.index_count, material.key, material.version, image, glows
