# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera as a rigid frame and a window onto the image plane."""

from dataclasses import dataclass, replace

import numpy as np

from .arrays import Float64Array


@dataclass(frozen=True)
class Camera:
    """A perspective or orthographic camera; +X right, +Y up, looking along −Z.

    `world_from_camera` (4, 4) float64, rigid (no scale).
    `window` (left, right, bottom, top): the image rectangle in camera space, at view depth 1 for a perspective
    camera, at any depth for an orthographic one. Lens shift, sensor fit, render border and viewport pan are
    all already in it. A window with left > right mirrors the picture, as a camera with a negative scale does.
    `clip_start`, `clip_end`: view depths in metres.
    """

    world_from_camera: Float64Array
    window: tuple[float, float, float, float]
    clip_start: float
    clip_end: float
    orthographic: bool = False

    @property
    def position(self) -> Float64Array:
        """World-space position (3,) float64."""
        return self.world_from_camera[:3, 3]

    @property
    def rotation(self) -> Float64Array:
        """(3, 3) float64 world-from-camera rotation; columns are the camera's axes in world space."""
        return self.world_from_camera[:3, :3]

    def sees_as(self, other: "Camera") -> bool:
        """Whether both make the very same picture."""
        return np.array_equal(self.world_from_camera, other.world_from_camera) and (
            (self.window, self.clip_start, self.clip_end, self.orthographic)
            == (other.window, other.clip_start, other.clip_end, other.orthographic)
        )

    def cropped(self, left: float, right: float, bottom: float, top: float) -> "Camera":
        """The same camera seeing only a rectangle of its image, in fractions 0…1 of the full window."""
        window_left, window_right, window_bottom, window_top = self.window
        width, height = window_right - window_left, window_top - window_bottom
        return replace(
            self,
            window=(
                window_left + left * width,
                window_left + right * width,
                window_bottom + bottom * height,
                window_bottom + top * height,
            ),
        )

    def shifted(self, x: float, y: float) -> "Camera":
        """The same camera with its window moved by fractions of its width and height (sub-pixel jitter)."""
        return self.cropped(x, 1.0 + x, y, 1.0 + y)

    def projection(self, *, zero_to_one_depth: bool) -> Float64Array:
        """Clip-from-camera matrix (4, 4) float64 with reversed depth: 1 at `clip_start`.

        Perspective depth falls to 0 at infinity (clip_end is left to a clip distance), which keeps the relative
        depth error of float32 constant (Upchurch and Desbrun 2012, "Tightening the Precision of Perspective
        Rendering"); orthographic depth is linear, 0 at `clip_end`.
        With `zero_to_one_depth` False, depth is mapped to OpenGL's default −1…1 clip range instead.
        """
        left, right, bottom, top = self.window
        matrix = np.zeros((4, 4))
        matrix[0, 0] = 2.0 / (right - left)
        matrix[1, 1] = 2.0 / (top - bottom)
        if self.orthographic:
            matrix[0, 3] = -(right + left) / (right - left)
            matrix[1, 3] = -(top + bottom) / (top - bottom)
            matrix[2, 2] = 1.0 / (self.clip_end - self.clip_start)
            matrix[2, 3] = self.clip_end / (self.clip_end - self.clip_start)
            matrix[3, 3] = 1.0
        else:
            matrix[0, 2] = (right + left) / (right - left)
            matrix[1, 2] = (top + bottom) / (top - bottom)
            matrix[2, 3] = self.clip_start
            matrix[3, 2] = -1.0
        if not zero_to_one_depth:
            matrix[2] = 2.0 * matrix[2] - matrix[3]
        return matrix
