# SPDX-License-Identifier: GPL-3.0-or-later
"""G-buffers of planes and gathered irradiance on them, for passes that are tested without those before them."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from addon.render.gathering import gather_offset
from addon.render.layout import CHANNELS, TargetSpec
from addon.render.sampling import Sample
from addon.scene import RenderSettings
from addon.scene.indirect import IndirectSettings
from blender_tests import builders

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_CHANNELS = {channel.name: channel.target(1) for channel in CHANNELS}


@dataclass
class Surfaces:
    """What a camera sees: view depth (H, W) in m, +inf where empty; unit world-space normal (H, W, 3)."""

    depth: np.ndarray
    normal: np.ndarray

    def at(self, pixels):
        """The part that lies at `pixels` (rows, columns)."""
        return Surfaces(self.depth[np.ix_(*pixels)], self.normal[np.ix_(*pixels)])


@dataclass(frozen=True)
class Plane:
    """A plane through a world-space point, with a unit normal; `half` picks the half of the picture it is seen in."""

    point: tuple
    normal: tuple
    half: str = "both"


def window_points(camera, width, height):
    """Points (H, W) × 2 of the camera's window that pixels look through."""
    left, right, bottom, top = camera.window
    x = left + (right - left) * (np.arange(width) + 0.5) / width
    y = bottom + (top - bottom) * (np.arange(height) + 0.5) / height
    return np.broadcast_arrays(x[None, :], y[:, None])


def positions(camera, depth):
    """World-space positions (H, W, 3) of what is seen at view depths (H, W); the camera's own where that is nothing."""
    x, y = window_points(camera, *depth.shape[::-1])
    depth = np.where(np.isfinite(depth), depth, 0.0)
    scale = 1.0 if camera.orthographic else depth
    return np.stack([x * scale, y * scale, -depth], axis=-1) @ camera.rotation.T + camera.position


def project(camera, points, width, height):
    """Pixels (H, W, 2) at which a camera sees world-space points (H, W, 3); centres are at 0.5."""
    local = (points - camera.position) @ camera.rotation
    window = local[..., :2] if camera.orthographic else local[..., :2] / -local[..., 2:]
    left, right, bottom, top = camera.window
    return (window - (left, bottom)) / (right - left, top - bottom) * (width, height)


def see(camera, width, height, *planes):
    """The nearest of the planes in every pixel."""
    x, y = window_points(camera, width, height)
    rays = np.stack([x, y, -np.ones_like(x)], axis=-1) @ camera.rotation.T
    origin, direction = camera.position, rays
    if camera.orthographic:
        origin = np.stack([x, y, 0 * x], axis=-1) @ camera.rotation.T + camera.position
        direction = np.broadcast_to(camera.rotation @ (0.0, 0.0, -1.0), rays.shape)
    seen = Surfaces(np.full((height, width), np.inf), np.zeros((height, width, 3)))
    column = np.broadcast_to(np.arange(width), (height, width))
    halves = {"both": column >= 0, "left": column < width // 2, "right": column >= width // 2}
    for plane in planes:
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = ((plane.point - origin) @ plane.normal) / (direction @ np.array(plane.normal))
        nearer = (depth > 0) & (depth < seen.depth) & halves[plane.half]
        seen.depth = np.where(nearer, depth, seen.depth)
        seen.normal = np.where(nearer[..., None], plane.normal, seen.normal)
    return seen


def encode_octahedral(normal):
    """Unit vectors (…, 3) as the G-buffer holds them, (…, 2) uint16; the zero vector as any."""
    safe = np.where(np.abs(normal).sum(-1, keepdims=True) > 0, normal, (0.0, 0.0, 1.0))
    p = safe[..., :2] / np.abs(safe).sum(-1, keepdims=True)
    folded = (1 - np.abs(p[..., ::-1])) * np.where(p >= 0, 1.0, -1.0)
    p = np.where(safe[..., 2:] >= 0, p, folded)
    return np.round((0.5 * p + 0.5) * 65535).astype(np.uint16)


def gathered_pixels(width, height, divisor, index=0):
    """Rows and columns of the pixels that the texels look from."""
    x, y = gather_offset(divisor, index)
    rows = np.minimum(np.arange(-(-height // divisor)) * divisor + int(y), height - 1)
    columns = np.minimum(np.arange(-(-width // divisor)) * divisor + int(x), width - 1)
    return rows, columns


def irradiance(color, variance, shape):
    """Gathered texels (H, W, 4) of one colour (3,) or of (H, W, 3), with a variance of the luminance."""
    result = np.zeros((*shape, 4), np.float32)
    result[..., :3] = color
    result[..., 3] = variance
    return result


def write(pool, name, values):
    """Fill a target of one layer."""
    pool.texture(name).write(np.ascontiguousarray(values).tobytes(), alignment=1)


def write_surfaces(pool, surfaces, motion=None):
    """Fill the G-buffer; `motion` (H, W, 2) in pixels."""
    write(pool, "gbuffer.view_depth", surfaces.depth.astype(np.float32))
    write(pool, "gbuffer.normal", encode_octahedral(surfaces.normal))
    if motion is not None:
        write(pool, "gbuffer.motion", motion.astype(np.float16))


def prepare(pool, planned, size, divisor, guard_band=0):
    """Allocate what planned passes read and write for a picture of a size without guard band."""
    written = {target.name: target for item in planned for target in item.writes}
    read = [name for item in planned for name in item.reads if name not in written]
    specs = [
        _CHANNELS[name.removeprefix("gbuffer.")]
        if name.startswith("gbuffer.")
        else TargetSpec(name, 4, "f4", divisor=divisor)
        for name in dict.fromkeys(read)
    ]
    pool.prepare(size, (*specs, *written.values()), guard_band=guard_band)


def frame(device, pool, camera, divisor, index=0, **arguments):
    """A frame as far as passes over gathered irradiance read it."""
    return SimpleNamespace(
        device=device,
        pool=pool,
        settings=RenderSettings(*pool.picture_size, indirect=IndirectSettings(divisor=divisor)),
        plan=SimpleNamespace(layers=1),
        view=camera,
        camera=camera,
        sample=Sample(index, (0.0, 0.0)),
        picture=0,
        **arguments,
    )


def wide_camera(orthographic=False):
    """A camera 3 m in front of the origin that sees 6 m of the plane z = 0."""
    return builders.camera(z=3.0, half_width=3.0 if orthographic else 1.0, orthographic=orthographic)
