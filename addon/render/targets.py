# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures that passes write: allocated by the plan, kept while the plan and the size stay, freed otherwise."""

import moderngl

from .device import Device, RenderError
from .layout import DEPTH_BYTES, TargetSpec

Attachments = tuple[tuple[str, int], ...]
"""(target name, layer) pairs in the order of a fragment shader's outputs."""


class TexturePool:
    """The targets of one view."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._size: tuple[int, int] = (0, 0)
        self._specs: dict[str, TargetSpec] = {}
        self._textures: dict[str, moderngl.TextureArray] = {}
        self._depth: moderngl.Texture | None = None
        self._framebuffers: dict[tuple[Attachments, bool], moderngl.Framebuffer] = {}

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels of every target."""
        return self._size

    def prepare(self, size: tuple[int, int], specs: tuple[TargetSpec, ...]) -> None:
        """Have exactly these targets at this size; those that are there already are kept.

        Raises RenderError where the size is over the device's limit or memory does not suffice.
        """
        limit = self._device.maximum_size
        if not (0 < size[0] <= limit and 0 < size[1] <= limit):
            raise RenderError(
                f"Resolution {size[0]}×{size[1]} is outside what the device can render (1 to {limit} pixels a side)."
            )
        wanted = {spec.name: spec for spec in specs}
        if size == self._size and wanted == self._specs:
            return
        self._release_framebuffers()
        if size != self._size:
            self.release()
        for name in [name for name, spec in self._specs.items() if wanted.get(name) != spec]:
            self._textures.pop(name).release()
            del self._specs[name]
        self._size = size
        try:
            if self._depth is None:
                self._depth = self._device.context.depth_texture(size)
                self._device.raw.make_float_depth(self._depth)
                self._check_memory("depth", DEPTH_BYTES)
            for name, spec in wanted.items():
                if name not in self._textures:
                    self._textures[name] = self._allocate(spec)
                    self._specs[name] = spec
        except RenderError:
            self.release()
            raise

    def texture(self, name: str) -> moderngl.TextureArray:
        """The texture array of a target."""
        return self._textures[name]

    def read(self, name: str) -> bytes:
        """A target's texels, tightly packed, layer after layer.

        Waits for the GPU first: llvmpipe (Mesa 22.3) does not notice that a texture which is no longer attached is
        still being drawn, and hands out the picture before.
        """
        self._device.context.finish()
        return self._textures[name].read(alignment=1)

    def framebuffer(self, attachments: Attachments, *, depth: bool = False) -> moderngl.Framebuffer:
        """A framebuffer that draws into one layer of each named target, with the shared depth buffer on request."""
        key = (attachments, depth)
        if key not in self._framebuffers:
            layers = [(self._textures[name], layer) for name, layer in attachments]
            framebuffer = self._device.context.framebuffer([array for array, _ in layers])
            if not self._device.raw.attach_layers(framebuffer, layers, self._depth if depth else None):
                names = ", ".join(name for name, _ in attachments)
                raise RenderError(f"The graphics driver cannot draw into the formats of {names}.")
            self._framebuffers[key] = framebuffer
        return self._framebuffers[key]

    def clear(self, attachments: Attachments) -> None:
        """Set the bound framebuffer's attachments, which are these, to their targets' clear values."""
        for attachment, (name, _) in enumerate(attachments):
            spec = self._specs[name]
            if spec.dtype.startswith("u"):
                self._device.raw.clear_color_uint(attachment, int(spec.clear))
            else:
                self._device.raw.clear_color(attachment, spec.clear)

    def bytes(self) -> dict[str, int]:
        """Bytes of video memory per target."""
        pixels = self._size[0] * self._size[1]
        sizes = {name: spec.bytes_per_pixel * pixels for name, spec in self._specs.items()}
        return sizes | ({"gbuffer.depth": DEPTH_BYTES * pixels} if self._depth is not None else {})

    def release(self) -> None:
        """Free every texture and framebuffer."""
        self._release_framebuffers()
        for texture in self._textures.values():
            texture.release()
        self._textures.clear()
        self._specs.clear()
        if self._depth is not None:
            self._depth.release()
            self._depth = None
        self._size = (0, 0)

    def _release_framebuffers(self) -> None:
        for framebuffer in self._framebuffers.values():
            framebuffer.release()
        self._framebuffers.clear()

    def _allocate(self, spec: TargetSpec) -> moderngl.TextureArray:
        try:
            width, height = self._size
            texture = self._device.context.texture_array(
                (width, height, spec.layers), spec.components, dtype=spec.dtype
            )
        except moderngl.Error as error:
            raise self._too_large(spec.name, spec.bytes_per_pixel) from error
        self._check_memory(spec.name, spec.bytes_per_pixel)
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    def _check_memory(self, name: str, bytes_per_pixel: int) -> None:
        if self._device.out_of_memory():
            raise self._too_large(name, bytes_per_pixel)

    def _too_large(self, name: str, bytes_per_pixel: int) -> RenderError:
        megabytes = bytes_per_pixel * self._size[0] * self._size[1] / 2**20
        return RenderError(
            f"Out of graphics memory for target {name}: {megabytes:.0f} MiB at {self._size[0]}×{self._size[1]}. "
            "Lower the resolution or the number of layers."
        )
