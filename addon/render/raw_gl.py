# SPDX-License-Identifier: GPL-3.0-or-later
"""The few OpenGL calls that moderngl does not offer, loaded through its own loader."""

import ctypes
from collections.abc import Callable
from typing import Any

import moderngl

CLIP_DISTANCE0 = 0x3000
SRGB8_ALPHA8 = 0x8C43

_TEXTURE_2D_ARRAY = 0x8C1A
_TEXTURE_MIN_FILTER = 0x2801
_TEXTURE_MAG_FILTER = 0x2800
_NEAREST = 0x2600
_DEPTH_COMPONENT = 0x1902
_DEPTH_COMPONENT32F = 0x8CAC
_FLOAT = 0x1406
_COLOR = 0x1800
_DEPTH = 0x1801
_FRAMEBUFFER = 0x8D40
_READ_FRAMEBUFFER = 0x8CA8
_DRAW_FRAMEBUFFER = 0x8CA9
_COLOR_BUFFER_BIT = 0x4000
_COLOR_ATTACHMENT0 = 0x8CE0
_DEPTH_ATTACHMENT = 0x8D00
_FRAMEBUFFER_COMPLETE = 0x8CD5
_LOWER_LEFT = 0x8CA1
_ZERO_TO_ONE = 0x935F
_NEGATIVE_ONE_TO_ONE = 0x935E
_TEXTURE_WRAP_S = 0x2802
_TEXTURE_WRAP_T = 0x2803
_MIRRORED_REPEAT = 0x8370
_MAX = 0x8008
_FUNC_ADD = 0x8006

_VERTEX_LAYER_EXTENSIONS = (
    "GL_ARB_shader_viewport_layer_array",
    "GL_AMD_vertex_shader_layer",
    "GL_NV_viewport_array2",
)

_uint, _int, _void_p = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p


def vertex_layer_extension(context: moderngl.Context) -> str | None:
    """The GLSL extension with which a vertex shader may write gl_Layer, or None where the driver has none."""
    return next((name for name in _VERTEX_LAYER_EXTENSIONS if name in context.extensions), None)


class RawGL:
    """Raw OpenGL entry points of one context; only to be called while that context is current."""

    def __init__(self, context: moderngl.Context) -> None:
        load: Callable[[str], int] = context.mglo._context.load  # pyright: ignore[reportAttributeAccessIssue]

        def entry(name: str, *arguments: Any, result: Any = None) -> Callable[..., Any]:
            return ctypes.CFUNCTYPE(result, *arguments)(load(name))

        self._bind_texture = entry("glBindTexture", _uint, _uint)
        self._gen_textures = entry("glGenTextures", _int, ctypes.POINTER(_uint))
        self._delete_textures = entry("glDeleteTextures", _int, ctypes.POINTER(_uint))
        self._tex_parameter_i = entry("glTexParameteri", _uint, _uint, _int)
        self._tex_image_3d = entry("glTexImage3D", _uint, _int, _int, _int, _int, _int, _int, _uint, _uint, _void_p)
        self._bind_vertex_array = entry("glBindVertexArray", _uint)
        self._vertex_attrib_divisor = entry("glVertexAttribDivisor", _uint, _uint)
        self._bind_framebuffer = entry("glBindFramebuffer", _uint, _uint)
        self._framebuffer_texture_layer = entry("glFramebufferTextureLayer", _uint, _uint, _uint, _int, _int)
        self._framebuffer_texture = entry("glFramebufferTexture", _uint, _uint, _uint, _int)
        self._blit_framebuffer = entry("glBlitFramebuffer", *[_int] * 8, _uint, _uint)
        self._check_framebuffer = entry("glCheckFramebufferStatus", _uint, result=_uint)
        self._clear_buffer_fv = entry("glClearBufferfv", _uint, _int, ctypes.POINTER(ctypes.c_float))
        self._clear_buffer_uiv = entry("glClearBufferuiv", _uint, _int, ctypes.POINTER(_uint))
        self._sampler_parameter_i = entry("glSamplerParameteri", _uint, _uint, _int)
        self._blend_equation = entry("glBlendEquation", _uint)
        self._blend_equation_i = entry("glBlendEquationi", _uint, _uint)
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

    def new_depth_array(self, width: int, height: int, layers: int) -> int:
        """A 2D array texture of 32-bit float depth, which moderngl does not have; returns its OpenGL name."""
        name = _uint()
        self._gen_textures(1, ctypes.byref(name))
        self._bind_texture(_TEXTURE_2D_ARRAY, name.value)
        for parameter in (_TEXTURE_MIN_FILTER, _TEXTURE_MAG_FILTER):
            self._tex_parameter_i(_TEXTURE_2D_ARRAY, parameter, _NEAREST)
        shape = (width, height, layers)
        self._tex_image_3d(_TEXTURE_2D_ARRAY, 0, _DEPTH_COMPONENT32F, *shape, 0, _DEPTH_COMPONENT, _FLOAT, None)
        return name.value

    def delete_texture(self, name: int) -> None:
        """Free a texture by its OpenGL name."""
        self._delete_textures(1, ctypes.byref(_uint(name)))

    def attach_layers(
        self,
        framebuffer: moderngl.Framebuffer,
        layers: list[tuple[moderngl.TextureArray, int]],
        depth_array: int | None,
    ) -> bool:
        """Attach a layer of each texture array, and layer 0 of a depth array; whether the result is complete."""
        self._bind_framebuffer(_FRAMEBUFFER, framebuffer.glo)
        for index, (array, layer) in enumerate(layers):
            self._framebuffer_texture_layer(_FRAMEBUFFER, _COLOR_ATTACHMENT0 + index, array.glo, 0, layer)
        if depth_array is not None:
            self._framebuffer_texture_layer(_FRAMEBUFFER, _DEPTH_ATTACHMENT, depth_array, 0, 0)
            framebuffer.depth_mask = True
        return self._check_framebuffer(_FRAMEBUFFER) == _FRAMEBUFFER_COMPLETE

    def attach_depth_array(self, framebuffer: moderngl.Framebuffer, depth_array: int) -> bool:
        """Attach a whole depth array to a framebuffer of whole arrays; whether the result is complete."""
        self._bind_framebuffer(_FRAMEBUFFER, framebuffer.glo)
        self._framebuffer_texture(_FRAMEBUFFER, _DEPTH_ATTACHMENT, depth_array, 0)
        framebuffer.depth_mask = True
        return self._check_framebuffer(_FRAMEBUFFER) == _FRAMEBUFFER_COMPLETE

    def copy_color(self, source: moderngl.Framebuffer, target: moderngl.Framebuffer) -> None:
        """Copy the first colour attachment to a framebuffer of the same size and format; leaves neither bound."""
        self._bind_framebuffer(_READ_FRAMEBUFFER, source.glo)
        self._bind_framebuffer(_DRAW_FRAMEBUFFER, target.glo)
        rectangle = (0, 0, *source.size)
        self._blit_framebuffer(*rectangle, *rectangle, _COLOR_BUFFER_BIT, _NEAREST)
        self._bind_framebuffer(_FRAMEBUFFER, 0)

    def clear_color(self, attachment: int, value: float) -> None:
        """Set every component, in all layers, of a float or normalised attachment of the bound framebuffer."""
        self._clear_buffer_fv(_COLOR, attachment, (ctypes.c_float * 4)(value, value, value, value))

    def clear_color_uint(self, attachment: int, value: int) -> None:
        """Set every component, in all layers, of an unsigned integer attachment of the bound framebuffer."""
        self._clear_buffer_uiv(_COLOR, attachment, (_uint * 4)(value, value, value, value))

    def clear_depth(self, value: float) -> None:
        """Set the depth, in all layers, of the bound framebuffer."""
        self._clear_buffer_fv(_DEPTH, 0, (ctypes.c_float * 1)(value))

    def set_attribute_divisor(self, vertex_array: moderngl.VertexArray, location: int, divisor: int) -> None:
        """Let the vertex attribute at a location advance once every `divisor` instances."""
        self._bind_vertex_array(vertex_array.glo)
        self._vertex_attrib_divisor(location, divisor)

    def blend_greatest(self, attachment: int) -> None:
        """Let blending keep the greatest of what is drawn into one attachment, until `blend_sum`."""
        self._blend_equation_i(attachment, _MAX)

    def blend_sum(self) -> None:
        """Let blending add up in all attachments."""
        self._blend_equation(_FUNC_ADD)

    def mirror_repeat(self, sampler: moderngl.Sampler) -> None:
        """Let a sampler mirror its texture at every integer coordinate."""
        glo = sampler._glo  # moderngl keeps the name private  # pyright: ignore
        self._sampler_parameter_i(glo, _TEXTURE_WRAP_S, _MIRRORED_REPEAT)
        self._sampler_parameter_i(glo, _TEXTURE_WRAP_T, _MIRRORED_REPEAT)
