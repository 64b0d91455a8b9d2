# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's cameras: the scene's own and the viewport's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene import Camera
from ..scene.arrays import Float64Array
from .changes import Messages
from .lights import rigid_matrix

if TYPE_CHECKING:
    import bpy


def render_camera(depsgraph: bpy.types.Depsgraph, resolution_x: int, resolution_y: int) -> Camera | None:
    """The scene's active camera for a full frame of this many pixels, or None where there is none.

    Shift, sensor fit and the scene's pixel aspect are in the window. A panoramic or custom camera
    is shown in perspective (`camera_messages` says so).
    """
    camera = _active_camera(depsgraph)
    if camera is None or camera.type != "CAMERA":
        return None
    scene: Any = depsgraph.scene_eval
    projection = _matrix(
        camera.calc_matrix_camera(
            depsgraph,
            x=resolution_x,
            y=resolution_y,
            scale_x=scene.render.pixel_aspect_x,
            scale_y=scene.render.pixel_aspect_y,
        )
    )
    pose, mirrored = _pose(_matrix(camera.matrix_world))
    return Camera(
        world_from_camera=pose,
        window=_window(projection, mirrored=mirrored),
        clip_start=camera.data.clip_start,
        clip_end=camera.data.clip_end,
        orthographic=_is_orthographic(projection),
    )


def camera_messages(depsgraph: bpy.types.Depsgraph, messages: Messages) -> None:
    """Report what about the scene's camera cannot be shown."""
    camera = _active_camera(depsgraph)
    if camera is None:
        return
    if camera.type != "CAMERA":
        messages.add("camera", "type", f"The scene's camera “{camera.name}” is a {camera.type.lower()}, not a camera.")
    elif camera.data.type not in {"PERSP", "ORTHO"}:
        kind = {"PANO": "panoramic"}.get(camera.data.type, camera.data.type.lower())
        text = f"Camera “{camera.name}” is {kind}, which is not rendered yet; perspective is used instead."
        messages.add("camera", "type", text)


def _active_camera(depsgraph: bpy.types.Depsgraph) -> Any:
    """The scene's active camera, evaluated, or None.

    The evaluated scene would still name the one before where a marker switched it in `RenderEngine.frame_set`.
    """
    scene: Any = depsgraph.scene
    return scene.camera and scene.camera.evaluated_get(depsgraph)


def viewport_camera(
    depsgraph: bpy.types.Depsgraph,
    space: bpy.types.SpaceView3D,
    region_3d: bpy.types.RegionView3D,
) -> Camera:
    """The camera of a viewport: free perspective or orthographic view, or camera view with its zoom and offset.

    Everything but the clip range is read off `region_3d`'s own matrices, so that what is drawn lies where Blender's
    overlays lie.
    """
    projection = _matrix(region_3d.window_matrix)
    pose, mirrored = _pose(_matrix(np.linalg.inv(_matrix(region_3d.view_matrix))))
    window = _window(projection, mirrored=mirrored)
    orthographic = _is_orthographic(projection)
    if orthographic and region_3d.view_perspective != "CAMERA":
        return _orthographic_view(pose, projection, window)
    clip = _clip_source(depsgraph, space, region_3d)
    return Camera(pose, window, clip.clip_start, clip.clip_end, orthographic)


def _clip_source(
    depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D, region_3d: bpy.types.RegionView3D
) -> Any:
    """Whoever's `clip_start` and `clip_end` hold; a projection matrix has them only roughly."""
    if region_3d.view_perspective != "CAMERA":
        return space
    camera = space.camera if space.use_local_camera else _active_camera(depsgraph)
    if camera is None or camera.type != "CAMERA":
        return space
    return camera.evaluated_get(depsgraph).data


def _orthographic_view(pose: Float64Array, projection: Float64Array, window: tuple[float, ...]) -> Camera:
    """Blender's free orthographic views see behind themselves too: the camera steps back to where they begin."""
    near = (projection[2, 3] + 1.0) / projection[2, 2]
    far = (projection[2, 3] - 1.0) / projection[2, 2]
    back = min(near, 0.0)
    stepped = pose.copy()
    stepped[:3, 3] -= pose[:3, 2] * back
    left, right, bottom, top = window
    return Camera(stepped, (left, right, bottom, top), near - back, far - back, orthographic=True)


def _matrix(matrix: object) -> Float64Array:
    return np.array(matrix, np.float64)


def _is_orthographic(projection: Float64Array) -> bool:
    return bool(projection[3, 3] == 1.0)


def _pose(matrix: Float64Array) -> tuple[Float64Array, bool]:
    """The rigid part of a camera's matrix, and whether the matrix also mirrors left and right of the picture."""
    return rigid_matrix(matrix), bool(np.linalg.det(matrix[:3, :3]) < 0.0)


def _window(projection: Float64Array, *, mirrored: bool) -> tuple[float, float, float, float]:
    """The image rectangle (left, right, bottom, top) of an OpenGL projection matrix, at view depth 1.

    In a mirrored picture left is where +X is, so that left > right.
    """
    column = 3 if _is_orthographic(projection) else 2
    sign = -1.0 if column == 3 else 1.0
    scale_x, scale_y = projection[0, 0], projection[1, 1]
    shift_x, shift_y = sign * projection[0, column], sign * projection[1, column]
    side = -1.0 if mirrored else 1.0
    return (
        float(side * (shift_x - 1.0) / scale_x),
        float(side * (shift_x + 1.0) / scale_x),
        float((shift_y - 1.0) / scale_y),
        float((shift_y + 1.0) / scale_y),
    )
