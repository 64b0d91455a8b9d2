# SPDX-License-Identifier: GPL-3.0-or-later
"""The next frame as the last two foretell it."""

from dataclasses import replace

import numpy as np

from .arrays import BoolArray, Float64Array
from .camera import Camera
from .correspondence import Correspondence
from .geometry import InstanceBatch, Mesh
from .scene import Scene
from .sequence import Moment
from .versions import new_version

_SINGULAR = 1e-12
"""Determinant of a matrix whose largest element is 1 below which it has no inverse worth having."""


def extrapolated(earlier: Moment, previous: Moment) -> Moment:
    """Where everything is if what happened between two frames happens once more after `previous`.

    Instances and the camera repeat their last step, an affine map of the world: exact for constant velocity and for
    constant rotation about any axis. The camera stays rigid, its window grows linearly. Vertices move linearly in
    object space, by `Mesh.velocities` where the mesh has them. What `earlier` does not have, or had without a volume,
    stays where it is. Materials, lights, normals and `Scene.camera` are those of `previous`.

    What does not move stays the very same object with the same version, the moment itself included.
    """
    scene = _continued_scene(Correspondence(earlier.scene), previous.scene)
    camera = _continued_camera(earlier.camera, previous.camera)
    if scene is previous.scene and camera is previous.camera:
        return previous
    return Moment(scene, camera)


def _continued_scene(correspondence: Correspondence, scene: Scene) -> Scene:
    meshes = {key: _continued_mesh(correspondence, mesh) for key, mesh in scene.meshes.items()}
    batches = tuple(_continued_batch(correspondence, batch) for batch in scene.batches)
    raised: dict[str, int] = {}
    if any(meshes[key] is not mesh for key, mesh in scene.meshes.items()):
        raised["geometry"] = new_version()
    if any(batch is not before for batch, before in zip(batches, scene.batches, strict=True)):
        raised["transforms"] = new_version()
    if not raised:
        return scene
    return replace(scene, meshes=meshes, batches=batches, versions=replace(scene.versions, **raised))


def _continued_mesh(correspondence: Correspondence, mesh: Mesh) -> Mesh:
    before = correspondence.positions(mesh)
    if mesh.velocities is None and before is mesh.positions:
        return mesh
    with np.errstate(over="ignore", invalid="ignore"):
        step = mesh.positions - before if mesh.velocities is None else mesh.velocities
        positions = mesh.positions + step
    positions = np.where(np.isfinite(positions), positions, mesh.positions)
    if np.array_equal(positions, mesh.positions):
        return mesh
    return replace(mesh, version=new_version(), positions=positions)


def _continued_batch(correspondence: Correspondence, batch: InstanceBatch) -> InstanceBatch:
    before = correspondence.matrices(batch)
    if before is batch.matrices:
        return batch
    matrices = _continued(before, batch.matrices)
    if np.array_equal(matrices, batch.matrices):
        return batch
    return replace(batch, version=new_version(), matrices=matrices)


def _continued_camera(earlier: Camera, previous: Camera) -> Camera:
    pose = previous.world_from_camera
    if not np.array_equal(earlier.world_from_camera, pose):
        turned = not np.array_equal(earlier.rotation, previous.rotation)
        pose = _continued(earlier.world_from_camera[None], pose[None])[0]
        pose = _rigid(pose) if turned else pose
    window = previous.window
    if earlier.orthographic == previous.orthographic and earlier.window != window:
        window = _continued_window(np.array(earlier.window), np.array(window))
    if pose is previous.world_from_camera and window == previous.window:
        return previous
    return replace(previous, world_from_camera=pose, window=window)


def _continued(earlier: Float64Array, previous: Float64Array) -> Float64Array:
    """`previous` · `earlier`⁻¹ · `previous` of affine matrices (N, 4, 4), `previous` where there is no such thing.

    Translations are subtracted before they are rotated, so that far from the origin no precision is lost.
    """
    before, linear = earlier[:, :3, :3], previous[:, :3, :3]
    invertible = _invertible(before)
    with np.errstate(over="ignore", invalid="ignore"):
        step = linear @ np.linalg.inv(np.where(invertible[:, None, None], before, np.eye(3)))
        step[(before == linear).all(axis=(1, 2))] = np.eye(3)
        moved = np.where(invertible[:, None], previous[:, :3, 3] - earlier[:, :3, 3], 0.0)
        matrices = previous.copy()
        matrices[:, :3, :3] = step @ linear
        matrices[:, :3, 3] += (step @ moved[:, :, None])[:, :, 0]
    usable = invertible & np.isfinite(matrices).all(axis=(1, 2))
    return np.where(usable[:, None, None], matrices, previous)


def _invertible(linear: Float64Array) -> BoolArray:
    """(N,) which of the (N, 3, 3) matrices have an inverse, whatever their scale."""
    size = np.abs(linear).max(axis=(1, 2))
    usable = (size > 0.0) & np.isfinite(size)
    normalized = linear / np.where(usable, size, 1.0)[:, None, None]
    return usable & (np.abs(np.linalg.det(np.where(usable[:, None, None], normalized, 0.0))) > _SINGULAR)


def _rigid(matrix: Float64Array) -> Float64Array:
    """The affine (4, 4) matrix with the rotation that is nearest to its linear part."""
    left, _, right = np.linalg.svd(matrix[:3, :3])
    rigid = matrix.copy()
    rigid[:3, :3] = left @ right
    return rigid


def _continued_window(earlier: Float64Array, previous: Float64Array) -> tuple[float, float, float, float]:
    """The window one step further; `previous` where it would turn inside out on the way."""
    window = previous + (previous - earlier)
    sides = (window[1] - window[0]) * (previous[1] - previous[0]), (window[3] - window[2]) * (previous[3] - previous[2])
    left, right, bottom, top = (window if min(sides) > 0.0 else previous).tolist()
    return left, right, bottom, top
