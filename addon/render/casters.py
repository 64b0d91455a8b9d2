# SPDX-License-Identifier: GPL-3.0-or-later
"""What may cast shadows, and which of it a shadow map sees."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np

from ..scene import Camera, InstanceBatch, Mesh
from ..scene.arrays import Float64Array, Int64Array
from .draws import Draw, SceneDraws
from .frustum import boxes_inside, frustum_planes


@dataclass(frozen=True)
class Casters:
    """The draws that cast shadows.

    `bounds` (K, 2, 3) float64: lowest and highest corner of each, world space. `versions` (K,): equal numbers are equal
    casters, from scene to scene. `groups` (K,): their link groups.
    """

    draws: tuple[Draw, ...]
    bounds: Float64Array
    versions: Int64Array
    groups: Int64Array

    def seen(self, camera: Camera, blocker_groups: int) -> Int64Array:
        """Indices of those of a light's blockers that may be in what a shadow map's camera sees."""
        blockers = np.array([blocker_groups >> group & 1 for group in self.groups.tolist()], np.bool_)
        return np.flatnonzero(blockers & boxes_inside(self.bounds, frustum_planes(camera)))


class CasterList:
    """The casters of the scene that a view shows; numbers that stand for equal casters live as long as the view."""

    def __init__(self) -> None:
        self._numbers: dict[tuple[object, ...], int] = {}
        self._count = count()
        self._scene: SceneDraws | None = None
        self._casters = _gather((), ())

    def of(self, draws: SceneDraws) -> Casters:
        """The casters among a scene's draws."""
        if self._scene is not draws:
            casting = [draw for draw in draws.draws if draw.batch.casts_shadow]
            used = {self._identity(draws, draw): None for draw in casting}
            held = self._numbers
            self._numbers = {identity: held[identity] if identity in held else next(self._count) for identity in used}
            numbers = [self._numbers[self._identity(draws, draw)] for draw in casting]
            boxes = [batch_bounds(draws.scene.meshes[draw.batch.mesh], draw.batch) for draw in casting]
            self._casters = _gather(casting, boxes, numbers)
            self._scene = draws
        return self._casters

    @staticmethod
    def _identity(draws: SceneDraws, draw: Draw) -> tuple[object, ...]:
        mesh = draws.scene.meshes[draw.batch.mesh]
        identity = (mesh.key, mesh.version, draw.batch.key, draw.batch.version, draw.first_index, draw.index_count)
        if "ALPHA_TEST" not in draw.surface or draw.texture is None:
            return identity
        image = draws.scene.images[draw.texture.image]
        return (*identity, draw.texture, image.version, draw.alpha, draws.alpha_threshold)


def batch_bounds(mesh: Mesh, batch: InstanceBatch) -> Float64Array:
    """(2, 3) float64: lowest and highest corner of all instances, world space."""
    bounds = instance_bounds(mesh, batch)
    return np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])


def instance_bounds(mesh: Mesh, batch: InstanceBatch) -> Float64Array:
    """(N, 2, 3) float64: lowest and highest corner of each instance, world space."""
    center, half = mesh.bounds.mean(axis=0), 0.5 * (mesh.bounds[1] - mesh.bounds[0])
    centers = batch.matrices[:, :3, :3] @ center + batch.matrices[:, :3, 3]
    halves = np.abs(batch.matrices[:, :3, :3]) @ half
    return np.stack([centers - halves, centers + halves], axis=1)


def _gather(draws: Sequence[Draw], boxes: Sequence[Float64Array], numbers: Sequence[int] = ()) -> Casters:
    return Casters(
        tuple(draws),
        np.array(boxes, np.float64).reshape(-1, 2, 3),
        np.array(numbers, np.int64),
        np.array([draw.batch.link_group for draw in draws], np.int64),
    )
