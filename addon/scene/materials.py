# SPDX-License-Identifier: GPL-3.0-or-later
"""Surface materials and the images they read."""

from dataclasses import dataclass
from enum import StrEnum

from .arrays import Color, Float32Array, UInt8Array


class BaseColorSource(StrEnum):
    """Where a material's base colour comes from."""

    CONSTANT = "CONSTANT"
    TEXTURE = "TEXTURE"
    ATTRIBUTE = "ATTRIBUTE"


class Extension(StrEnum):
    """What an image texture shows outside 0…1, as Blender names it."""

    REPEAT = "REPEAT"
    EXTEND = "EXTEND"
    CLIP = "CLIP"
    MIRROR = "MIRROR"


class Interpolation(StrEnum):
    """How texels are interpolated; Blender's Cubic and Smart are read as linear."""

    LINEAR = "LINEAR"
    CLOSEST = "CLOSEST"


@dataclass(frozen=True)
class Image:
    """Pixels of one image.

    `pixels` (height, width, 4), row 0 at the bottom: uint8, or float32 for high-dynamic-range images.
    `srgb`: uint8 colour channels are sRGB-encoded; otherwise the values are scene-linear or plain data.
    Alpha is straight (not premultiplied).
    """

    key: str
    name: str
    version: int
    pixels: UInt8Array | Float32Array
    srgb: bool


@dataclass(frozen=True)
class ImageTexture:
    """An image looked up with the mesh's UV map."""

    image: str
    extension: Extension = Extension.REPEAT
    interpolation: Interpolation = Interpolation.LINEAR


class EmissionSampling(StrEnum):
    """Which emissive surfaces are sampled as lights, as Cycles names it: what is worth it, no face, or which faces."""

    AUTO = "AUTO"
    NONE = "NONE"
    FRONT = "FRONT"
    BACK = "BACK"
    FRONT_BACK = "FRONT_BACK"


@dataclass(frozen=True)
class Material:
    """Constants of Blender's Principled BSDF plus one base-colour texture.

    `base_color` scene-linear RGB, multiplied into a texture or colour attribute when `source` names one.
    `alpha` 0…1, multiplied by the texture's alpha when `texture_alpha`; what stays below the alpha threshold is not
    drawn.
    `metallic`, `roughness` 0…1 (perceptual roughness; GGX α = roughness²).
    `specular` 0…1: dielectric reflectance at normal incidence (F0), 0 for purely diffuse surfaces.
    `emission` scene-linear RGB radiance, of both sides; `emission_sampling`: whether it is sampled as a light.
    `diffuse_roughness` 0…1: of the diffuse reflection, 0 for Lambert (Oren–Nayar's, as Cycles means it).
    """

    key: str
    name: str
    version: int
    base_color: Color = (0.8, 0.8, 0.8)
    source: BaseColorSource = BaseColorSource.CONSTANT
    texture: ImageTexture | None = None
    texture_alpha: bool = False
    alpha: float = 1.0
    metallic: float = 0.0
    roughness: float = 0.5
    specular: float = 0.04
    emission: Color = (0.0, 0.0, 0.0)
    emission_sampling: EmissionSampling = EmissionSampling.AUTO
    diffuse_roughness: float = 0.0

    @property
    def is_emissive(self) -> bool:
        """Whether the surface emits light."""
        return max(self.emission) > 0.0

    @property
    def is_glossy(self) -> bool:
        """Whether it reflects light other than diffusely."""
        return self.specular > 0.0 or self.metallic > 0.0

    @property
    def is_alpha_tested(self) -> bool:
        """Whether presence varies over the surface, so that fragments must be tested one by one."""
        return self.texture_alpha and self.source is BaseColorSource.TEXTURE and self.texture is not None
