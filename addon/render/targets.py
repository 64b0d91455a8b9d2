# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures that passes write: allocated by the plan, kept while the plan and the size stay, freed otherwise."""

from collections.abc import Iterable

import moderngl

from .device import Device, RenderError
from .layout import DEPTH_BYTES, TargetSpec

Attachments = tuple[tuple[str, int], ...]
"""(target name, layer) pairs in the order of a fragment shader's outputs."""

DEPTH_NAME = "gbuffer.depth"
"""What messages and statistics call the hardware depth array."""


class TexturePool:
    """The targets of one view: texture arrays of the picture's size or of that plus the guard band, or of a texel for
    every few pixels of either, and a depth array.

    Of the hardware depth, 1 is nearest and 0 farthest.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        self._picture_size: tuple[int, int] = (0, 0)
        self._guard_band = 0
        self._depth_layers = 0
        self._specs: dict[str, TargetSpec] = {}
        self._textures: dict[str, moderngl.TextureArray] = {}
        self._depth: int | None = None
        self._framebuffers: dict[tuple[Attachments, bool], moderngl.Framebuffer] = {}
        self._layered_framebuffers: dict[tuple[str, ...], moderngl.Framebuffer] = {}

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels of what guarded targets cover."""
        width, height = self._picture_size
        return width + 2 * self._guard_band, height + 2 * self._guard_band

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height in pixels of the picture."""
        return self._picture_size

    @property
    def guard_band(self) -> int:
        """Pixels that guarded targets have around the picture, on each side."""
        return self._guard_band

    def prepare(
        self, size: tuple[int, int], specs: tuple[TargetSpec, ...], *, guard_band: int = 0, depth_layers: int = 1
    ) -> None:
        """Have exactly these targets for a picture of this size; those that are there already are kept.

        Guarded targets and the depth array, of `depth_layers` layers, get `guard_band` pixels more on each side.

        Raises RenderError where the size is over the device's limit or memory does not suffice.
        """
        self._check_size(size, guard_band)
        wanted = {spec.name: spec for spec in specs}
        same_size = (size, guard_band) == (self._picture_size, self._guard_band)
        if same_size and depth_layers == self._depth_layers and wanted == self._specs:
            return
        self._release_framebuffers()
        if not same_size:
            self.release()
        if depth_layers != self._depth_layers:
            self._release_depth()
        for name in [name for name, spec in self._specs.items() if wanted.get(name) != spec]:
            self._textures.pop(name).release()
            del self._specs[name]
        self._picture_size, self._guard_band, self._depth_layers = size, guard_band, depth_layers
        try:
            if self._depth is None:
                self._depth = self._device.raw.new_depth_array(*self.size, depth_layers)
                self._check_memory(DEPTH_NAME, self._depth_bytes(self.size))
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

    def margin(self, name: str) -> int:
        """Texels a target has around the picture, on each side; 0 where one is for several pixels, maybe of both."""
        spec = self._specs[name]
        return self._guard_band if spec.guarded and spec.divisor == 1 else 0

    def read(self, name: str) -> bytes:
        """A target's texels, tightly packed, layer after layer, guard band included.

        Waits for the GPU first: llvmpipe (Mesa 22.3) does not notice that a texture which is no longer attached is
        still being drawn, and hands out the picture before.
        """
        self._device.context.finish()
        return self._textures[name].read(alignment=1)

    def copy(self, source: str, source_layer: int, target: str, target_layer: int) -> None:
        """Copy one layer, bit for bit, between targets of the same size and format; leaves no framebuffer bound."""
        self._device.raw.copy_color(
            self.framebuffer(((source, source_layer),)), self.framebuffer(((target, target_layer),))
        )

    def framebuffer(self, attachments: Attachments, *, depth: bool = False) -> moderngl.Framebuffer:
        """A framebuffer that draws into one layer of each named target, with layer 0 of the depth on request.

        Raises RenderError where the driver cannot draw into the formats.
        """
        key = (attachments, depth)
        if key not in self._framebuffers:
            layers = [(self._textures[name], layer) for name, layer in attachments]
            framebuffer = self._device.context.framebuffer([array for array, _ in layers])
            if not self._device.raw.attach_layers(framebuffer, layers, self._depth if depth else None):
                framebuffer.release()
                raise _undrawable(name for name, _ in attachments)
            self._framebuffers[key] = framebuffer
        return self._framebuffers[key]

    def layered_framebuffer(self, names: tuple[str, ...]) -> moderngl.Framebuffer:
        """A framebuffer of all layers of each named target and of the depth, for shaders that write gl_Layer.

        Raises ValueError where a target has not as many layers as the depth, RenderError where the driver cannot draw
        into the formats.
        """
        if names not in self._layered_framebuffers:
            assert self._depth is not None
            for name in names:
                if self._specs[name].layers != self._depth_layers:
                    raise ValueError(
                        f"{name} has {self._specs[name].layers} layers, the depth it is drawn with {self._depth_layers}"
                    )
            framebuffer = self._device.context.framebuffer([self._textures[name] for name in names])
            if not self._device.raw.attach_depth_array(framebuffer, self._depth):
                framebuffer.release()
                raise _undrawable(names)
            self._layered_framebuffers[names] = framebuffer
        return self._layered_framebuffers[names]

    def clear(self, attachments: Attachments | tuple[str, ...], *, depth: bool = False) -> None:
        """Set the bound framebuffer's attachments, which are these, to their targets' clear values.

        With `depth` the hardware depth as well, to the farthest. A layered framebuffer is cleared in all its layers.
        """
        for index, attachment in enumerate(attachments):
            spec = self._specs[attachment if isinstance(attachment, str) else attachment[0]]
            if spec.dtype.startswith("u"):
                self._device.raw.clear_color_uint(index, int(spec.clear))
            else:
                self._device.raw.clear_color(index, spec.clear)
        if depth:
            self._device.raw.clear_depth(0.0)

    def bytes(self) -> dict[str, int]:
        """Bytes of video memory per target, guard band included."""
        whole = {name: spec.bytes_per_texel * _area(self._texels(spec)) for name, spec in self._specs.items()}
        return whole | ({DEPTH_NAME: self._depth_bytes(self.size)} if self._depth is not None else {})

    def guard_band_bytes(self) -> int:
        """Bytes of video memory that the guard band takes in all targets."""
        alone = sum(spec.bytes_per_texel * _area(spec.size(self._picture_size)) for spec in self._specs.values())
        alone += self._depth_bytes(self._picture_size) if self._depth is not None else 0
        return sum(self.bytes().values()) - alone

    def release(self) -> None:
        """Free every texture and framebuffer."""
        self._release_framebuffers()
        for texture in self._textures.values():
            texture.release()
        self._textures.clear()
        self._specs.clear()
        self._release_depth()
        self._picture_size, self._guard_band = (0, 0), 0

    def _release_depth(self) -> None:
        if self._depth is not None:
            self._device.raw.delete_texture(self._depth)
        self._depth, self._depth_layers = None, 0

    def _release_framebuffers(self) -> None:
        # moderngl binds what was last in use again whenever it makes a framebuffer: that must not be a released one.
        self._device.no_framebuffer.use()
        for framebuffer in (*self._framebuffers.values(), *self._layered_framebuffers.values()):
            framebuffer.release()
        self._framebuffers.clear()
        self._layered_framebuffers.clear()

    def _texels(self, spec: TargetSpec) -> tuple[int, int]:
        return spec.size(self.size if spec.guarded else self._picture_size)

    def _depth_bytes(self, size: tuple[int, int]) -> int:
        return DEPTH_BYTES * self._depth_layers * _area(size)

    def _allocate(self, spec: TargetSpec) -> moderngl.TextureArray:
        size = self._texels(spec)
        try:
            texture = self._device.context.texture_array((*size, spec.layers), spec.components, dtype=spec.dtype)
        except moderngl.Error as error:
            raise self._too_large(spec.name, spec.bytes_per_texel * _area(size)) from error
        try:
            self._check_memory(spec.name, spec.bytes_per_texel * _area(size))
        except RenderError:
            texture.release()
            raise
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    def _check_size(self, size: tuple[int, int], guard_band: int) -> None:
        limit = self._device.maximum_size
        if not (0 < size[0] <= limit and 0 < size[1] <= limit):
            raise RenderError(
                f"Resolution {size[0]}×{size[1]} is outside what the device can render (1 to {limit} pixels a side)."
            )
        if max(size) + 2 * guard_band > limit:
            raise RenderError(
                f"Resolution {size[0]}×{size[1]} with a guard band of {guard_band} pixels on each side is outside what "
                f"the device can render (1 to {limit} pixels a side). Lower the guard band or the resolution."
            )

    def _check_memory(self, name: str, size: int) -> None:
        if self._device.out_of_memory():
            raise self._too_large(name, size)

    def _too_large(self, name: str, size: int) -> RenderError:
        width, height = self.size
        guarded = f", guard band of {self._guard_band} pixels included" if self._guard_band else ""
        return RenderError(
            f"Out of graphics memory for target {name}: {size / 2**20:.0f} MiB at "
            f"{width}×{height}{guarded}. Lower the resolution or the number of layers."
        )


def _undrawable(names: Iterable[str]) -> RenderError:
    return RenderError(f"The graphics driver cannot draw into the formats of {', '.join(names)}.")


def _area(size: tuple[int, int]) -> int:
    return size[0] * size[1]
