# SPDX-License-Identifier: GPL-3.0-or-later
"""Emissive surfaces that are sampled as lights."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..scene import EmissionSampling, InstanceBatch, Material, Mesh, Scene, SlotRange
from ..scene.arrays import Color, Int64Array
from .memory import Memory
from .surfaces import SlotSurface, Surface

GREATEST_COUNT = 16
"""How many emissive surfaces are sampled as lights, unless more are marked so: each costs shadow maps every sample."""

SMALLEST_SHARE = 0.01
"""Share of all emissive surfaces' power below which one is not worth shadow maps of its own."""


@dataclass(frozen=True)
class MeshLight:
    """The emissive triangles of one slot of one instance.

    `emission`: radiance. `front`, `back`: which sides shine as a light.
    """

    key: str
    name: str
    emission: Color
    surface: Surface
    front: bool
    back: bool
    link_group: int
    marked: bool

    @property
    def power(self) -> float:
        """π times radiance times area of each side that shines, W, of the strongest colour channel."""
        return np.pi * max(self.emission) * self.surface.area * (self.front + self.back)


MeshLights = tuple[MeshLight, ...]


def mesh_lights(scene: Scene, alpha_threshold: float, memory: Memory) -> tuple[MeshLights, MeshLights]:
    """The emissive surfaces worth sampling, strongest first, and those that are left to indirect light.

    Those whose material is marked for it come whatever their share; of a batch's others only the largest instances are
    considered. What has less alpha than `alpha_threshold` is not there; where an image
    decides that, it is not known where the surface is.
    """
    return memory.recall(("mesh lights", alpha_threshold), (scene,), lambda: _chosen(scene, alpha_threshold, memory))


def _chosen(scene: Scene, alpha_threshold: float, memory: Memory) -> tuple[MeshLights, MeshLights]:
    candidates = (light for light in _candidates(scene, alpha_threshold, memory) if light.surface.area > 0.0)
    every = sorted(candidates, key=lambda light: (not light.marked, -light.power, light.key))
    least = SMALLEST_SHARE * sum(light.power for light in every)
    marked = sum(light.marked for light in every)
    # In order of power: those that are worth it come before those that are not.
    worth = sum(light.marked or light.power >= least for light in every)
    count = min(worth, max(GREATEST_COUNT, marked))
    return tuple(every[:count]), tuple(every[count:])


def _candidates(scene: Scene, alpha_threshold: float, memory: Memory) -> Iterator[MeshLight]:
    for batch in scene.batches:
        mesh = scene.meshes[batch.mesh]
        for slot in mesh.slots:
            material = scene.materials[batch.materials[min(slot.slot, len(batch.materials) - 1)]]
            shines = material.is_emissive and material.alpha >= alpha_threshold and not material.is_alpha_tested
            if shines and material.emission_sampling is not EmissionSampling.NONE:
                yield from _instances(batch, mesh, slot, material, memory)


def _instances(
    batch: InstanceBatch, mesh: Mesh, slot: SlotRange, material: Material, memory: Memory
) -> Iterator[MeshLight]:
    sampling = material.emission_sampling
    marked = sampling is not EmissionSampling.AUTO
    whole = memory.recall("slot", (mesh, slot), lambda: Surface(SlotSurface(mesh, slot), np.eye(4)))
    rows = memory.recall("largest", (batch,), lambda: _from_the_largest(batch))
    for row in rows[: None if marked else GREATEST_COUNT + 1].tolist():
        yield MeshLight(
            key=f"{batch.key}/{slot.slot}/{batch.ids[row]}",
            name=f"{mesh.name} ({material.name})",
            emission=material.emission,
            surface=memory.recall(("surface", row), (whole, batch), lambda row=row: whole.placed(batch.matrices[row])),
            front=sampling is not EmissionSampling.BACK,
            back=sampling is not EmissionSampling.FRONT,
            link_group=batch.link_group,
            marked=marked,
        )


def _from_the_largest(batch: InstanceBatch) -> Int64Array:
    """(N,) rows of a batch."""
    return np.argsort(-np.abs(np.linalg.det(batch.matrices[:, :3, :3])), kind="stable")
