# SPDX-License-Identifier: GPL-3.0-or-later
"""Rectangles: which part of a frame or viewport is rendered."""

from dataclasses import dataclass
from math import ceil, floor

import bpy
import numpy as np

from ..scene import Camera

Fractions = tuple[float, float, float, float]
"""(left, right, bottom, top) as fractions 0…1 of an image."""

WHOLE: Fractions = (0.0, 1.0, 0.0, 1.0)


@dataclass(frozen=True)
class Rectangle:
    """Whole pixels of a region: lower left corner and size."""

    x: int
    y: int
    width: int
    height: int

    @property
    def empty(self) -> bool:
        """Whether there is nothing to render."""
        return self.width < 1 or self.height < 1

    def pixels(self, pixel_size: int) -> tuple[int, int]:
        """Width and height of its picture where one pixel covers `pixel_size` of the region's."""
        return max(1, self.width // pixel_size), max(1, self.height // pixel_size)

    def fractions(self, width: int, height: int) -> Fractions:
        """Where the rectangle lies in an image of `width` x `height` pixels."""
        return self.x / width, (self.x + self.width) / width, self.y / height, (self.y + self.height) / height


def final_border(
    render: bpy.types.RenderSettings, engine: bpy.types.RenderEngine, width: int, height: int
) -> Fractions:
    """The part of the full frame that a result of `width` x `height` pixels shows.

    Blender tells a border's size in the result, and its corner nowhere: it cuts the single-precision product of
    border and resolution down to a whole pixel.
    """
    full_width, full_height = engine.resolution_x, engine.resolution_y
    if (width, height) == (full_width, full_height):
        return WHOLE
    x = int(np.float32(render.border_min_x) * np.float32(full_width))
    y = int(np.float32(render.border_min_y) * np.float32(full_height))
    return Rectangle(x, y, width, height).fractions(full_width, full_height)


def viewport_rectangle(
    scene: bpy.types.Scene,
    space: bpy.types.SpaceView3D,
    region: bpy.types.Region,
    view: Camera,
    frame: Camera | None,
) -> Rectangle:
    """The pixels of `region` that are to be rendered: all, or the viewport's or the camera's render region.

    `view` is the camera of the whole region, `frame` the camera's own picture where the region looks through it.
    """
    left, right, bottom, top = WHOLE
    render = scene.render
    if frame is not None:
        if render.use_border:
            left, right, bottom, top = _inside(view, frame.cropped(*_border(render)))
    elif space.use_render_border:
        left, right, bottom, top = _border(space)
    x0, x1 = max(0, floor(left * region.width)), min(region.width, ceil(right * region.width))
    y0, y1 = max(0, floor(bottom * region.height)), min(region.height, ceil(top * region.height))
    return Rectangle(x0, y0, max(0, x1 - x0), max(0, y1 - y0))


def _border(owner: bpy.types.RenderSettings | bpy.types.SpaceView3D) -> Fractions:
    if isinstance(owner, bpy.types.RenderSettings):
        return owner.border_min_x, owner.border_max_x, owner.border_min_y, owner.border_max_y
    return (
        owner.render_border_min_x,
        owner.render_border_max_x,
        owner.render_border_min_y,
        owner.render_border_max_y,
    )


def _inside(view: Camera, part: Camera) -> Fractions:
    """The window of `part` as fractions of the window of `view`; both look from the same place."""
    left, right, bottom, top = view.window
    width, height = right - left, top - bottom
    part_left, part_right, part_bottom, part_top = part.window
    return (
        (part_left - left) / width,
        (part_right - left) / width,
        (part_bottom - bottom) / height,
        (part_top - bottom) / height,
    )
