# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames around the one that is rendered."""

from dataclasses import dataclass

from .camera import Camera
from .scene import Scene


@dataclass(frozen=True)
class Moment:
    """A scene at one frame, and the camera that sees it (cropped to the picture, as the frame's own camera is)."""

    scene: Scene
    camera: Camera

    def equals(self, other: "Moment") -> bool:
        """Whether both are the same scene object seen in the very same way."""
        return self.scene is other.scene and self.camera.sees_as(other.camera)


@dataclass(frozen=True)
class Sequence:
    """What is known of other frames than the one to render.

    `previous`: the frame before; None where nothing is known, and then nothing has moved.
    `earlier`: the frame before that one.
    `following`: the frame that will be rendered next, for an oracle that looks ahead.
    `continuous`: the renderer's last picture shows `previous`, so that its depth serves as history (a viewport).
    Otherwise history is drawn anew from `previous`, so that a frame does not depend on what was rendered before it.
    """

    previous: Moment | None = None
    earlier: Moment | None = None
    following: Moment | None = None
    continuous: bool = False
