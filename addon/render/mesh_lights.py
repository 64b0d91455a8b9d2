# SPDX-License-Identifier: GPL-3.0-or-later
"""Emissive surfaces that are sampled as lights."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..scene import EmissionSampling, InstanceBatch, Material, Mesh, Scene, SlotRange
from ..scene.arrays import Color, Float64Array

GREATEST_COUNT = 16
"""How many emissive surfaces are sampled as lights, unless more are marked so: each costs shadow maps every sample."""

SMALLEST_SHARE = 0.01
"""Share of all emissive surfaces' power below which one is not worth shadow maps of its own."""


@dataclass(frozen=True)
class MeshLight:
    """The emissive triangles (T, 3, 3) float64, world space, of one slot of one instance.

    `emission`: radiance. `cumulative` (T,): share of `area` (m²) up to and including each triangle. `front`, `back`:
    which sides shine as a light.
    """

    key: str
    name: str
    emission: Color
    triangles: Float64Array
    cumulative: Float64Array
    area: float
    front: bool
    back: bool
    link_group: int
    marked: bool

    @property
    def power(self) -> float:
        """π times radiance times area of each side that shines, W, of the strongest colour channel."""
        return np.pi * max(self.emission) * self.area * (self.front + self.back)

    @property
    def center(self) -> Float64Array:
        """(3,) the mean point of its surface."""
        shares = np.diff(self.cumulative, prepend=0.0)
        return shares @ self.triangles.mean(axis=1)

    @property
    def radius(self) -> float:
        """Of the ball about its centre that holds it, m."""
        return float(np.linalg.norm(self.triangles - self.center, axis=-1).max())

    def point(self, u: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Point and unit front normal (3,) for u (3,) in [0, 1), of which it takes two: uniform over the area."""
        at = min(int(np.searchsorted(self.cumulative, u[0], side="right")), len(self.triangles) - 1)
        a, b, c = self.triangles[at]
        before = self.cumulative[at - 1] if at > 0 else 0.0
        within = min((u[0] - before) / (self.cumulative[at] - before), 1.0)
        root = np.sqrt(within)  # Turk 1990, "Generating Random Points in Triangles"
        normal = np.cross(b - a, c - a)
        return a + root * (1.0 - u[1]) * (b - a) + root * u[1] * (c - a), normal / np.linalg.norm(normal)


def mesh_lights(scene: Scene, alpha_threshold: float) -> tuple[tuple[MeshLight, ...], tuple[MeshLight, ...]]:
    """The emissive surfaces worth sampling, strongest first, and those that are left to indirect light.

    Those whose material is marked for it come whatever their share; of a batch's others only the largest instances are
    considered. What has less alpha than `alpha_threshold` is not there.
    """
    every = sorted(_candidates(scene, alpha_threshold), key=lambda light: (not light.marked, -light.power, light.key))
    total = sum(light.power for light in every)
    worth = [light for light in every if light.marked or light.power >= SMALLEST_SHARE * total]
    marked = sum(light.marked for light in worth)
    sampled = worth[: max(GREATEST_COUNT, marked)]
    return tuple(sampled), tuple(light for light in every if light not in sampled)


def _candidates(scene: Scene, alpha_threshold: float) -> Iterator[MeshLight]:
    for batch in scene.batches:
        mesh = scene.meshes[batch.mesh]
        for slot in mesh.slots:
            material = scene.materials[batch.materials[min(slot.slot, len(batch.materials) - 1)]]
            shines = material.is_emissive and material.alpha >= alpha_threshold
            if shines and material.emission_sampling is not EmissionSampling.NONE:
                yield from _instances(batch, mesh, slot, material)


def _instances(batch: InstanceBatch, mesh: Mesh, slot: SlotRange, material: Material) -> Iterator[MeshLight]:
    corners = mesh.positions[mesh.triangles[slot.first : slot.first + slot.count]].astype(np.float64)
    sampling = material.emission_sampling
    marked = sampling is not EmissionSampling.AUTO
    volumes = np.linalg.det(batch.matrices[:, :3, :3])
    largest = np.argsort(-np.abs(volumes), kind="stable")[: None if marked else GREATEST_COUNT + 1]
    for row in largest.tolist():
        matrix = batch.matrices[row]
        triangles = corners @ matrix[:3, :3].T + matrix[:3, 3]
        if volumes[row] < 0.0:  # mirrored: the front stays the front
            triangles = triangles[:, ::-1]
        areas = 0.5 * np.linalg.norm(
            np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=-1
        )
        solid = areas > 0.0
        area = float(areas[solid].sum())
        if area == 0.0:
            continue
        yield MeshLight(
            key=f"{batch.key}/{slot.slot}/{batch.ids[row]}",
            name=f"{mesh.name} ({material.name})",
            emission=material.emission,
            triangles=triangles[solid],
            cumulative=np.cumsum(areas[solid]) / area,
            area=area,
            front=sampling is not EmissionSampling.BACK,
            back=sampling is not EmissionSampling.FRONT,
            link_group=batch.link_group,
            marked=marked,
        )
