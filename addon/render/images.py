# SPDX-License-Identifier: GPL-3.0-or-later
"""Image textures and samplers on the GPU."""

from collections.abc import Mapping

import moderngl
import numpy as np

from ..scene import Extension, Image, ImageTexture, Interpolation
from .device import Device, RenderError
from .raw_gl import SRGB8_ALPHA8


class ImageStore:
    """GPU mirror of `Scene.images`, and the sampler objects that textures use."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._textures: dict[str, tuple[int, moderngl.Texture]] = {}
        self._samplers: dict[tuple[Extension, Interpolation], moderngl.Sampler] = {}

    def update(self, images: Mapping[str, Image]) -> list[str]:
        """Mirror these images, by key; returns warnings for those that had to be made smaller.

        Raises RenderError naming the image that graphics memory has no room for.
        """
        for key in [
            key for key, (version, _) in self._textures.items() if key not in images or images[key].version != version
        ]:
            self._textures.pop(key)[1].release()
        warnings: list[str] = []
        for key, image in images.items():
            if key not in self._textures:
                self._textures[key] = (image.version, self._upload(image, warnings))
        return warnings

    def use(self, texture: ImageTexture, unit: int) -> None:
        """Bind an image with its extension and interpolation to a texture unit."""
        self._textures[texture.image][1].use(unit)
        self._sampler(texture).use(unit)

    def bytes(self) -> int:
        """Bytes of all textures with their mipmaps (4/3 of level 0)."""
        return sum(
            texture.width * texture.height * (16 if texture.dtype == "f4" else 4) * 4 // 3
            for _, texture in self._textures.values()
        )

    def release(self) -> None:
        """Free everything."""
        for _, texture in self._textures.values():
            texture.release()
        for sampler in self._samplers.values():
            sampler.release()
        self._textures.clear()
        self._samplers.clear()

    def _upload(self, image: Image, warnings: list[str]) -> moderngl.Texture:
        pixels = image.pixels
        step = -(-max(pixels.shape[:2]) // self._device.maximum_size)
        if step > 1:
            pixels = pixels[::step, ::step]
            warnings.append(f'Image "{image.name}" is larger than the device allows; every {step}th pixel is used.')
        height, width = pixels.shape[:2]
        is_float = pixels.dtype == np.float32
        texture = self._device.context.texture(
            (width, height),
            4,
            np.ascontiguousarray(pixels),
            dtype="f4" if is_float else "f1",
            internal_format=SRGB8_ALPHA8 if image.srgb and not is_float else None,
        )
        texture.build_mipmaps()
        try:
            self._device.check_upload(f'image "{image.name}"', pixels.nbytes)
        except RenderError:
            texture.release()
            raise
        return texture

    def _sampler(self, texture: ImageTexture) -> moderngl.Sampler:
        key = (texture.extension, texture.interpolation)
        if key not in self._samplers:
            closest = texture.interpolation is Interpolation.CLOSEST
            sampler = self._device.context.sampler(
                repeat_x=texture.extension is not Extension.EXTEND,
                repeat_y=texture.extension is not Extension.EXTEND,
                filter=(
                    (moderngl.NEAREST, moderngl.NEAREST)
                    if closest
                    else (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
                ),
            )
            if texture.extension is Extension.CLIP:
                sampler.border_color = (0.0, 0.0, 0.0, 0.0)
            elif texture.extension is Extension.MIRROR:
                self._device.raw.mirror_repeat(sampler)
            self._samplers[key] = sampler
        return self._samplers[key]
