# SPDX-License-Identifier: GPL-3.0-or-later
"""The few OpenGL calls that moderngl does not offer, loaded through its own loader."""

import ctypes
from collections.abc import Callable
from typing import Any

import moderngl

CLIP_DISTANCE0 = 0x3000
SRGB8_ALPHA8 = 0x8C43

_TEXTURE_2D = 0x0DE1
_DEPTH_COMPONENT = 0x1902
_DEPTH_COMPONENT32F = 0x8CAC
_FLOAT = 0x1406
_COLOR = 0x1800
_FRAMEBUFFER = 0x8D40
_COLOR_ATTACHMENT0 = 0x8CE0
_DEPTH_ATTACHMENT = 0x8D00
_FRAMEBUFFER_COMPLETE = 0x8CD5
_LOWER_LEFT = 0x8CA1
_ZERO_TO_ONE = 0x935F
_NEGATIVE_ONE_TO_ONE = 0x935E
_TEXTURE_WRAP_S = 0x2802
_TEXTURE_WRAP_T = 0x2803
_MIRRORED_REPEAT = 0x8370

_uint, _int, _void_p = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p


class RawGL:
    """Raw OpenGL entry points of one context; only to be called while that context is current."""

    def __init__(self, context: moderngl.Context) -> None:
        load: Callable[[str], int] = context.mglo._context.load  # pyright: ignore[reportAttributeAccessIssue]

        def entry(name: str, *arguments: Any, result: Any = None) -> Callable[..., Any]:
            return ctypes.CFUNCTYPE(result, *arguments)(load(name))

        self._bind_texture = entry("glBindTexture", _uint, _uint)
        self._tex_image_2d = entry("glTexImage2D", _uint, _int, _int, _int, _int, _int, _uint, _uint, _void_p)
        self._bind_framebuffer = entry("glBindFramebuffer", _uint, _uint)
        self._framebuffer_texture_layer = entry("glFramebufferTextureLayer", _uint, _uint, _uint, _int, _int)
        self._framebuffer_texture_2d = entry("glFramebufferTexture2D", _uint, _uint, _uint, _uint, _int)
        self._check_framebuffer = entry("glCheckFramebufferStatus", _uint, result=_uint)
        self._clear_buffer_fv = entry("glClearBufferfv", _uint, _int, ctypes.POINTER(ctypes.c_float))
        self._clear_buffer_uiv = entry("glClearBufferuiv", _uint, _int, ctypes.POINTER(_uint))
        self._sampler_parameter_i = entry("glSamplerParameteri", _uint, _uint, _int)
        self._clip_control = (
            entry("glClipControl", _uint, _uint)
            if context.version_code >= 450 or "GL_ARB_clip_control" in context.extensions
            else None
        )

    def set_clip_space(self, *, zero_to_one: bool) -> bool:
        """Choose clip-space depth 0…1, which keeps float precision near 0, or OpenGL's −1…1; False where it cannot."""
        if self._clip_control is None:
            return False
        self._clip_control(_LOWER_LEFT, _ZERO_TO_ONE if zero_to_one else _NEGATIVE_ONE_TO_ONE)
        return True

    def make_float_depth(self, texture: moderngl.Texture) -> None:
        """Give a depth texture 32-bit float storage (moderngl allocates 24-bit integers)."""
        width, height = texture.size
        self._bind_texture(_TEXTURE_2D, texture.glo)
        self._tex_image_2d(_TEXTURE_2D, 0, _DEPTH_COMPONENT32F, width, height, 0, _DEPTH_COMPONENT, _FLOAT, None)

    def attach_layers(
        self,
        framebuffer: moderngl.Framebuffer,
        layers: list[tuple[moderngl.TextureArray, int]],
        depth: moderngl.Texture | None,
    ) -> bool:
        """Attach a layer of each texture array, and a 2D depth texture; whether the result is complete."""
        self._bind_framebuffer(_FRAMEBUFFER, framebuffer.glo)
        for index, (array, layer) in enumerate(layers):
            self._framebuffer_texture_layer(_FRAMEBUFFER, _COLOR_ATTACHMENT0 + index, array.glo, 0, layer)
        if depth is not None:
            self._framebuffer_texture_2d(_FRAMEBUFFER, _DEPTH_ATTACHMENT, _TEXTURE_2D, depth.glo, 0)
            framebuffer.depth_mask = True
        return self._check_framebuffer(_FRAMEBUFFER) == _FRAMEBUFFER_COMPLETE

    def clear_color(self, attachment: int, value: float) -> None:
        """Set every component of a float or normalised colour attachment of the bound framebuffer."""
        self._clear_buffer_fv(_COLOR, attachment, (ctypes.c_float * 4)(value, value, value, value))

    def clear_color_uint(self, attachment: int, value: int) -> None:
        """Set every component of an unsigned integer colour attachment of the bound framebuffer."""
        self._clear_buffer_uiv(_COLOR, attachment, (_uint * 4)(value, value, value, value))

    def mirror_repeat(self, sampler: moderngl.Sampler) -> None:
        """Let a sampler mirror its texture at every integer coordinate."""
        glo = sampler._glo  # moderngl keeps the name private  # pyright: ignore
        self._sampler_parameter_i(glo, _TEXTURE_WRAP_S, _MIRRORED_REPEAT)
        self._sampler_parameter_i(glo, _TEXTURE_WRAP_T, _MIRRORED_REPEAT)
