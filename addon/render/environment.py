# SPDX-License-Identifier: GPL-3.0-or-later
"""The world on the GPU: its map, and blurred ones for surfaces that are not mirrors. Read by `common/environment.glsl`.

A pass that reads the world adds `ENVIRONMENT_UNIFORMS` to its block, those of `ENVIRONMENT_SAMPLERS` that it reads to
its samplers, and the define ENVIRONMENT where the world has a map.
"""

import moderngl
import numpy as np

from ..scene import EnvironmentMap, World
from ..scene.arrays import Float32Array
from .device import Device, RenderError
from .programs import ProgramSpec
from .spherical_filter import blurred, cosine_lobe, harmonics, lobe

ENVIRONMENT_DEFINE = "ENVIRONMENT"
ENVIRONMENT_UNIFORMS = (("environment_factor", "vec4"), ("environment_from_world", "mat4"))
MAP_SAMPLER, BLURS_SAMPLER = "environment_map", "environment_blurs"
ENVIRONMENT_SAMPLERS = (MAP_SAMPLER, BLURS_SAMPLER)

BLUR_ALPHAS = tuple(0.05 * 2.0**level for level in range(6))
"""GGX roughness α of each blurred map; one of irradiance comes first. `environment.glsl` counts on these."""


def environment_uniforms(world: World) -> dict[str, object]:
    """Values of `ENVIRONMENT_UNIFORMS`."""
    rotation = np.eye(4)
    if world.environment_from_world is not None:
        rotation[:3, :3] = world.environment_from_world
    return {"environment_factor": (*world.radiance, 1.0), "environment_from_world": rotation}


def environment_blurs(pixels: Float32Array) -> Float32Array:
    """(1 + 6, ROWS, COLUMNS + 1, 3) float32 of a map (H, W, 3): irradiance, then radiance through GGX lobes.

    Nodes as in `spherical_filter`; lobes have an integral of 1, irradiance is that on a surface facing the direction.
    """
    coefficients = harmonics(pixels)
    return np.stack([blurred(coefficients, kernel) for kernel in (cosine_lobe(), *map(lobe, BLUR_ALPHAS))])


class EnvironmentTextures:
    """Textures of the world's map, made when a pass first reads them and kept while the map's version is the same."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._shown: tuple[str, int] | None = None
        self._textures: dict[str, moderngl.Texture | moderngl.TextureArray] = {}

    def bind(self, environment: EnvironmentMap, spec: ProgramSpec) -> None:
        """Bind what a program reads of a map, by its samplers.

        Raises RenderError naming the map where graphics memory has no room for it.
        """
        shown = (environment.key, environment.version)
        if self._shown != shown:
            self.release()
            self._shown = shown
        for sampler in ENVIRONMENT_SAMPLERS:
            if sampler in spec.samplers:
                if sampler not in self._textures:
                    self._textures[sampler] = self._upload(environment, sampler)
                self._textures[sampler].use(spec.samplers.index(sampler))

    def bytes(self) -> int:
        """Bytes of all textures; the map's with its mipmaps (4/3 of level 0)."""
        total = 0
        for texture in self._textures.values():
            layered = isinstance(texture, moderngl.TextureArray)
            level = texture.width * texture.height * 12
            total += level * texture.layers if layered else level * 4 // 3
        return total

    def release(self) -> None:
        """Free everything."""
        for texture in self._textures.values():
            texture.release()
        self._textures.clear()

    def _upload(self, environment: EnvironmentMap, sampler: str) -> moderngl.Texture | moderngl.TextureArray:
        context = self._device.context
        if sampler == MAP_SAMPLER:
            pixels = np.ascontiguousarray(environment.pixels)
            texture = context.texture((pixels.shape[1], pixels.shape[0]), 3, pixels, dtype="f4")
            texture.build_mipmaps()
            texture.repeat_x, texture.repeat_y = True, False
            texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        else:
            pixels = environment_blurs(environment.pixels)
            layers, rows, columns, _ = pixels.shape
            texture = context.texture_array((columns, rows, layers), 3, pixels, dtype="f4")
            texture.repeat_x = texture.repeat_y = False
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        try:
            self._device.check_upload(f'the world "{environment.name}"', pixels.nbytes)
        except RenderError:
            texture.release()
            raise
        return texture
