# SPDX-License-Identifier: GPL-3.0-or-later
"""Painting in a viewport region: pictures as textures, messages as text. Blender's thread only."""

import textwrap
from typing import Any

import blf
import bpy
import gpu
from gpu_extras.presets import draw_texture_2d

from .regions import Rectangle
from .viewport_session import Picture

_TYPES: Any = gpu.types  # the type stubs know no constructor
FONT = 0
FONT_POINTS = 13
LINE_SPACING = 1.5
MARGIN = 24
TEXT_COLOR = (1.0, 0.55, 0.25, 1.0)


class Presenter:
    """One region's texture, made anew when there is a newer picture."""

    def __init__(self) -> None:
        self._shown: Picture | None = None
        self._texture: gpu.types.GPUTexture | None = None

    def picture(self, picture: Picture, rectangle: Rectangle) -> None:
        """Paint `picture` over `rectangle`, stretched where their sizes differ.

        The picture is scene-linear and premultiplied; Blender's own display transform follows.
        """
        texture = self._texture
        if picture is not self._shown or texture is None:
            height, width, _ = picture.pixels.shape
            data = _TYPES.Buffer("FLOAT", width * height * 4, picture.pixels.reshape(-1))
            texture = _TYPES.GPUTexture((width, height), format="RGBA32F", data=data)
            self._texture, self._shown = texture, picture
        gpu.state.blend_set("ALPHA_PREMULT")
        draw_texture_2d(texture, (rectangle.x, rectangle.y), rectangle.width, rectangle.height)
        gpu.state.blend_set("NONE")

    def message(self, text: str, region: bpy.types.Region) -> None:
        """Paint `text` over the region, wrapped to its width, so that a viewport without a picture says why."""
        preferences = bpy.context.preferences
        assert preferences is not None
        size = FONT_POINTS * (preferences.system.ui_scale or 1.0)  # 0 without a window
        blf.size(FONT, size)
        blf.color(FONT, *TEXT_COLOR)
        columns = max(16, int((region.width - 2 * MARGIN) / (0.55 * size)))
        lines = textwrap.wrap(text, columns)
        top = region.height / 2 + len(lines) * size * LINE_SPACING / 2
        for index, line in enumerate(lines):
            width, _ = blf.dimensions(FONT, line)
            blf.position(FONT, (region.width - width) / 2, top - (index + 1) * size * LINE_SPACING, 0)
            blf.draw(FONT, line)

    def release(self) -> None:
        """Forget the texture."""
        self._shown = None
        self._texture = None
