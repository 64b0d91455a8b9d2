# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame to render and those before it, read from Blender one after another."""

from collections.abc import Callable
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Any

import bpy

from ..scene import Camera, Moment, Scene, Sequence
from ..sync import Mirror, render_camera
from .regions import Fractions


@dataclass(frozen=True)
class ReadFrame:
    """A mirrored frame. `camera` sees the full frame; None where the scene has none. `warnings` are for the user."""

    scene: Scene = field(default_factory=Scene)
    camera: Camera | None = None
    warnings: tuple[str, ...] = ()

    def moment(self, border: Fractions) -> Moment | None:
        """The scene and the camera that sees the part `border` of the full frame; None without a camera."""
        return None if self.camera is None else Moment(self.scene, self.camera.cropped(*border))


@dataclass(frozen=True)
class Frames:
    """`current` is to be rendered; `before` are the frames before it that were asked for, nearest first.

    What did not change from frame to frame is the very same object in all of them.
    """

    current: ReadFrame = field(default_factory=ReadFrame)
    before: tuple[ReadFrame, ...] = ()

    def sequence(self, border: Fractions) -> Sequence:
        """The frames before, seen through the part `border` of the full frame."""
        moments = [*(frame.moment(border) for frame in self.before), None, None]
        return Sequence(previous=moments[0], earlier=moments[1])


def read(
    engine: bpy.types.RenderEngine, depsgraph: Any, mirror: Mirror, before: int, cancelled: Callable[[], bool]
) -> Frames:
    """Read the frame that `depsgraph` evaluates, and 0 to 2 frames `before` it first, oldest first.

    A frame without a camera is left out, and so are those before it. Blender is at the frame to render afterwards,
    whatever happened in between. Raises CancelledError where the user cancelled between two frames.
    """
    scene = depsgraph.scene
    frame, subframe = scene.frame_current, scene.frame_subframe
    past: list[ReadFrame] = []
    if before:
        try:
            for distance in range(before, 0, -1):
                if cancelled():
                    raise CancelledError
                engine.frame_set(frame - distance, subframe)
                past.append(_read(engine, depsgraph, mirror))
        finally:
            engine.frame_set(frame, subframe)
        if cancelled():
            raise CancelledError
    seen = takewhile(lambda item: item.camera is not None, reversed(past))
    return Frames(_read(engine, depsgraph, mirror), tuple(seen))


def _read(engine: bpy.types.RenderEngine, depsgraph: Any, mirror: Mirror) -> ReadFrame:
    synced = mirror.sync(depsgraph)
    camera = render_camera(depsgraph, engine.resolution_x, engine.resolution_y)
    return ReadFrame(synced.scene, camera, synced.warnings)
