# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether one picture says anything about the next."""

import math
from collections.abc import Hashable

import numpy as np

from .arrays import Float64Array, Int64Array, same_array
from .camera import Camera
from .correspondence import same_topology
from .geometry import InstanceBatch, Mesh
from .materials import Material
from .scene import Scene
from .sequence import Moment

_ORTHOGRAPHIC_FIELD = math.radians(45.0)
"""Field of view that a turning orthographic camera counts as having."""


def is_cut(previous: Moment, current: Moment) -> bool:
    """Whether the camera jumped: little of what `current` shows was to be seen in `previous`.

    It did where the kind of projection differs, the window is more than twice or less than half as large, the middle
    of the view turned by more than half the field of view, or the camera moved too far. In perspective that is half the
    distance to the middle of the scene (from where it is farther), or half the scene's radius from within it; in an
    orthographic view, where only steps across the view count, half the window.
    """
    before, now = previous.camera, current.camera
    if before.orthographic != now.orthographic:
        return True
    ratios = _window_size(now) / _window_size(before)
    if ratios.max() > 2.0 or ratios.min() < 0.5:
        return True
    if _angle(_view_direction(before), _view_direction(now)) > 0.5 * _field_of_view(now):
        return True
    if now.orthographic:
        step = now.rotation[:, :2].T @ (_eye(now) - _eye(before))
        return bool(np.linalg.norm(step) > 0.5 * _window_size(now).max())
    step = float(np.linalg.norm(now.position - before.position))
    return step > 0.0 and step > 0.5 * _reach(current.scene, before, now)


def same_population(first: Scene, second: Scene) -> bool:
    """Whether two scenes show the same instances, of meshes with the same triangles, with the same holes in them.

    Where and how large they are may differ, and so may all that only colours them or only shades others.
    """
    if first is second:
        return True
    mine, theirs = _instances(first), _instances(second)
    if mine.keys() != theirs.keys() or not all(_same_ids(mine[key], theirs[key]) for key in mine):
        return False
    pierced = {batch.mesh for batch in _seen(second) if _is_pierced(second, batch)}
    keys = {batch.mesh for batch in _seen(second)}
    return all(_same_surface(first.meshes[key], second.meshes[key], with_uvs=key in pierced) for key in keys)


def _window_size(camera: Camera) -> Float64Array:
    left, right, bottom, top = camera.window
    return np.array([abs(right - left), abs(top - bottom)])


def _window_middle(camera: Camera) -> tuple[float, float]:
    left, right, bottom, top = camera.window
    return 0.5 * (left + right), 0.5 * (bottom + top)


def _view_direction(camera: Camera) -> Float64Array:
    """(3,) world-space direction in which the middle of the picture lies."""
    x, y = (0.0, 0.0) if camera.orthographic else _window_middle(camera)
    return camera.rotation @ np.array([x, y, -1.0])


def _eye(camera: Camera) -> Float64Array:
    """(3,) world-space point from which an orthographic camera sees the middle of its picture."""
    x, y = _window_middle(camera)
    return camera.position + camera.rotation[:, :2] @ np.array([x, y])


def _angle(first: Float64Array, second: Float64Array) -> float:
    """Between two directions, rad."""
    return math.atan2(float(np.linalg.norm(np.cross(first, second))), float(first @ second))


def _field_of_view(camera: Camera) -> float:
    """The larger of a camera's two angles, rad."""
    if camera.orthographic:
        return _ORTHOGRAPHIC_FIELD
    left, right, bottom, top = np.arctan(camera.window).tolist()
    return max(abs(right - left), abs(top - bottom))


def _reach(scene: Scene, *cameras: Camera) -> float:
    """The largest of the scene's radius and the cameras' distances to its middle, m; 0 where there is no scene."""
    boxes = [_box(batch, scene.meshes[batch.mesh]) for batch in _seen(scene)]
    if not boxes:
        return 0.0
    low = np.min([box[0] for box in boxes], axis=0)
    high = np.max([box[1] for box in boxes], axis=0)
    distances = [float(np.linalg.norm(camera.position - 0.5 * (low + high))) for camera in cameras]
    return max(0.5 * float(np.linalg.norm(high - low)), *distances)


def _seen(scene: Scene) -> list[InstanceBatch]:
    """Batches that are placed in front of cameras."""
    return [batch for batch in scene.batches if batch.count and batch.seen_by_camera]


def _box(batch: InstanceBatch, mesh: Mesh) -> tuple[Float64Array, Float64Array]:
    """Lowest and highest corner (3,) of the world-space box around all instances of a batch."""
    low, high = mesh.bounds
    middles = batch.matrices[:, :3, :3] @ (0.5 * (low + high)) + batch.matrices[:, :3, 3]
    extents = np.abs(batch.matrices[:, :3, :3]) @ (0.5 * (high - low))
    return (middles - extents).min(axis=0), (middles + extents).max(axis=0)


def _instances(scene: Scene) -> dict[tuple[str, Hashable], list[InstanceBatch]]:
    """Batches that are seen, by their mesh and by what of their materials decides where there is surface."""
    groups: dict[tuple[str, Hashable], list[InstanceBatch]] = {}
    for batch in _seen(scene):
        holes = tuple(_holes(scene, scene.materials[key]) for key in batch.materials)
        groups.setdefault((batch.mesh, holes), []).append(batch)
    return groups


def _is_pierced(scene: Scene, batch: InstanceBatch) -> bool:
    return any(scene.materials[key].is_alpha_tested for key in batch.materials)


def _holes(scene: Scene, material: Material) -> Hashable:
    """What decides where a material's surface is cut out: equal values, equal holes."""
    if material.texture is None or not material.is_alpha_tested:
        return material.alpha
    return material.alpha, material.texture, scene.images[material.texture.image].version


def _same_ids(first: list[InstanceBatch], second: list[InstanceBatch]) -> bool:
    if [(batch.key, batch.version) for batch in first] == [(batch.key, batch.version) for batch in second]:
        return True
    mine, theirs = _ids(first), _ids(second)
    return np.array_equal(mine, theirs) or np.array_equal(np.sort(mine), np.sort(theirs))


def _ids(batches: list[InstanceBatch]) -> Int64Array:
    return np.concatenate([batch.ids for batch in batches])


def _same_surface(first: Mesh, second: Mesh, *, with_uvs: bool) -> bool:
    if first.version == second.version:
        return True
    if with_uvs and not same_array(first.uvs, second.uvs):
        return False
    return first.slots == second.slots and same_topology(first, second)
