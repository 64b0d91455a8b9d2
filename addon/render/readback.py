# SPDX-License-Identifier: GPL-3.0-or-later
"""Deep G-buffer layers as numpy images."""

from dataclasses import dataclass

import numpy as np

from ..scene import Camera
from ..scene.arrays import BoolArray, Float32Array
from .targets import TexturePool

EMPTY_DEPTH = np.float32(1e10)
"""Depth pass value where there is no surface, as Cycles writes it."""

_NUMPY_TYPES = {"f4": np.float32, "f2": np.float16, "f1": np.uint8, "nu2": np.uint16, "u2": np.uint16}


@dataclass(frozen=True)
class LayerImages:
    """One layer of the deep G-buffer, float32, row 0 at the bottom; zero where the layer is empty.

    `depth` (H, W) linear view depth in m, +inf where empty. `radiance` (H, W, 3) outgoing, W/(sr·m²).
    `normal` (H, W, 3) world space, unit. `albedo` (H, W, 3) base colour. `metallic`, `roughness` (H, W).
    `emission` (H, W, 3). `object_index` (H, W).
    `motion` (H, W, 2): pixels moved since the previous frame (x right, y up), exactly 0 where nothing moved.
    `exit_depth` (H, W): view depth in m of the first back face behind `depth`, +inf where there is none;
    `exit_normal` (H, W, 3) world space, unit, facing the viewer; `exit_albedo` (H, W, 3). These are None where the
    settings did not ask for them.
    """

    depth: Float32Array
    radiance: Float32Array
    normal: Float32Array
    albedo: Float32Array
    metallic: Float32Array
    roughness: Float32Array
    emission: Float32Array
    object_index: Float32Array
    motion: Float32Array | None = None
    exit_depth: Float32Array | None = None
    exit_normal: Float32Array | None = None
    exit_albedo: Float32Array | None = None


def read_target(pool: TexturePool, name: str) -> Float32Array:
    """A target as (layers, H, W, components) float32 without its guard band; normalised formats scaled to 0…1.

    Where a texel is for several pixels, the guard band's are there as well.
    """
    texture = pool.texture(name)
    width, height, layers = texture.size
    dtype = _NUMPY_TYPES[texture.dtype]
    values = np.frombuffer(pool.read(name), dtype).reshape(layers, height, width, texture.components)
    margin = pool.margin(name)
    values = values[:, margin : height - margin, margin : width - margin]
    if texture.dtype in ("f1", "nu2"):
        return values.astype(np.float32) / np.float32(np.iinfo(dtype).max)
    return values.astype(np.float32)


def read_layers(pool: TexturePool, names: frozenset[str], count: int) -> tuple[LayerImages, ...]:
    """The first `count` layers of the targets that exist among `names`.

    What was left out is zero; motion and exit surfaces are None instead.
    """
    depth = read_target(pool, "gbuffer.view_depth")[:count, ..., 0]
    covered = np.isfinite(depth)

    def optional(name: str, surface: BoolArray) -> Float32Array | None:
        if name not in names:
            return None
        return np.where(surface[..., None], read_target(pool, name)[:count], np.float32(0.0))

    def channel(name: str, components: int) -> Float32Array:
        values = optional(name, covered)
        return np.zeros((*depth.shape, components), np.float32) if values is None else values

    radiance, base_color = channel("direct.radiance", 4), channel("gbuffer.base_color", 4)
    material, emission = channel("gbuffer.material", 2), decode_shared_exponent(channel("gbuffer.emission", 4))
    normal = decode_octahedral(channel("gbuffer.normal", 2)) * covered[..., None]
    object_index, motion = channel("gbuffer.object_index", 1), optional("gbuffer.motion", covered)
    exit_depth = read_target(pool, "exit.view_depth")[:count, ..., 0] if "exit.view_depth" in names else None
    leaves = np.isfinite(depth if exit_depth is None else exit_depth)
    exit_normal, exit_color = optional("exit.normal", leaves), optional("exit.base_color", leaves)
    return tuple(
        LayerImages(
            depth=depth[k],
            radiance=radiance[k, ..., :3],
            normal=normal[k],
            albedo=base_color[k, ..., :3],
            metallic=material[k, ..., 0],
            roughness=material[k, ..., 1],
            emission=emission[k],
            object_index=object_index[k, ..., 0],
            motion=None if motion is None else motion[k],
            exit_depth=None if exit_depth is None else exit_depth[k],
            exit_normal=None if exit_normal is None else decode_octahedral(exit_normal[k]) * leaves[k, ..., None],
            exit_albedo=None if exit_color is None else exit_color[k, ..., :3],
        )
        for k in range(count)
    )


def decode_shared_exponent(encoded: Float32Array) -> Float32Array:
    """Radiance (…, 3) from components over a power of two and its exponent (…, 4): `common/shared_exponent.glsl`."""
    return np.ldexp(encoded[..., :3], encoded[..., 3:].astype(np.int32))


def decode_octahedral(encoded: Float32Array) -> Float32Array:
    """Unit vectors (…, 3) from the octahedral code (…, 2) in 0…1; the inverse of `common/octahedral.glsl`."""
    x, y = (2.0 * encoded[..., 0] - 1.0), (2.0 * encoded[..., 1] - 1.0)
    z = 1.0 - np.abs(x) - np.abs(y)
    fold = np.maximum(-z, 0.0)
    vectors = np.stack([x - np.copysign(fold, x), y - np.copysign(fold, y), z], axis=-1)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def positions(depth: Float32Array, camera: Camera) -> Float32Array:
    """World-space positions (H, W, 3) float32 of view depths (H, W) at pixel centres; 0 where depth is infinite."""
    height, width = depth.shape
    left, right, bottom, top = camera.window
    x = left + (np.arange(width) + 0.5) / width * (right - left)
    y = bottom + (np.arange(height) + 0.5) / height * (top - bottom)
    covered = np.isfinite(depth)
    z = np.where(covered, depth, 0.0).astype(np.float64)
    scale = np.ones_like(z) if camera.orthographic else z
    point = np.stack([x[None, :] * scale, y[:, None] * scale, -z], axis=-1)
    world = point @ camera.rotation.T + camera.position
    return np.where(covered[..., None], world, 0.0).astype(np.float32)
