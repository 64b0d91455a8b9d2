# SPDX-License-Identifier: GPL-3.0-or-later
"""`common/deep_march.glsl` on layers and rays that tests choose, and the same march in numpy."""

from dataclasses import dataclass
from types import SimpleNamespace

import moderngl
import numpy as np

from addon.render import PlannedPass, gl_thread
from addon.render.layout import CHANNELS, EXIT_CHANNELS, TargetSpec
from addon.render.passes.fullscreen import FullscreenDraw, fullscreen_program
from addon.render.readback import read_target
from addon.render.targets import TexturePool
from addon.render.uniforms import UniformBlock

BLOCK = UniformBlock("MarchUniforms", (("march_steps", "int"),))
RAYS = ("ray_origins", "ray_directions", "ray_limits")
RESULT = "march.result"
FARTHEST = 1e30
ROUNDING = 4.0 * 2.0**-23
SOURCE = """
#include "common/deep_march.glsl"
#include "generated/MarchUniforms.glsl"
uniform sampler2DArray ray_origins;
uniform sampler2DArray ray_directions;
uniform sampler2DArray ray_limits;
layout(location = 0) out vec4 met;
layout(location = 1) out vec4 where_met;
void main()
{
    ivec3 texel = ivec3(gl_FragCoord.xy, 0);
    vec2 limits = texelFetch(ray_limits, texel, 0).xy;
    vec3 origin = texelFetch(ray_origins, texel, 0).xyz, direction = texelFetch(ray_directions, texel, 0).xyz;
    MarchHit hit = deep_march(origin, direction, limits.x, march_steps, limits.y);
    met = vec4(float(hit.hit), float(hit.ended), hit.distance, float(hit.layer));
    where_met = vec4(hit.pixel, float(hit.hidden), 0.0);
}
"""


@dataclass(frozen=True)
class Met:
    """What N rays met: `hit`, `ended`, `hidden` (N,) bool, `distance` (N,) m, `layer` (N,) int, `pixel` (N, 2) int;
    `unsure` (N,) where rounding to float32 may have it otherwise."""

    hit: np.ndarray
    ended: np.ndarray
    hidden: np.ndarray
    distance: np.ndarray
    layer: np.ndarray
    pixel: np.ndarray
    unsure: np.ndarray


def march_on_gpu(camera, depth, exits, origins, directions, *, reach, steps, jitter):
    """March N rays (relative positions and unit directions (N, 3), world axes) through `depth` (layers, H, W) with or
    without `exits` of the same shape; `reach` and `jitter` (N,). N must be no more than H · W."""
    rays = (origins, directions, reach, steps, jitter)
    return gl_thread().submit(lambda device: _march(device, camera, depth, exits, *rays)).result()


def _march(device, camera, depth, exits, origins, directions, reach, steps, jitter):
    layers, height, width = depth.shape
    targets = [CHANNELS[0].target(layers), *([EXIT_CHANNELS[0].target(layers)] if exits is not None else [])]
    results = [TargetSpec(f"{RESULT}{index}", 4, "f4") for index in range(2)]
    rays = [TargetSpec(name, 4, "f4") for name in RAYS]
    defines = frozenset({f"LAYERS {layers}"} | ({"EXIT"} if exits is not None else set()))
    spec = fullscreen_program("generated/march.glsl", BLOCK, defines, samplers=RAYS, generated=(("march", SOURCE),))
    pool, draw = TexturePool(device), FullscreenDraw(device, BLOCK)
    try:
        pool.prepare((width, height), (*targets, *rays, *results))
        for target, values in zip(targets, (depth, exits), strict=False):
            pool.texture(target.name).write(np.ascontiguousarray(values, np.float32).tobytes(), alignment=1)
        limits = np.stack([np.broadcast_to(reach, len(origins)), np.broadcast_to(jitter, len(origins))], axis=-1)
        for target, values in zip(rays, (origins, directions, limits), strict=True):
            padded = np.zeros((height * width, 4), np.float32)
            padded[: len(values), : values.shape[1]] = values
            pool.texture(target.name).write(padded.tobytes(), alignment=1)
        draw.bind(
            SimpleNamespace(pool=pool, camera=camera), spec, PlannedPass("march", tuple(item.name for item in targets))
        )
        for target in rays:
            pool.texture(target.name).use(spec.samplers.index(target.name))
        device.context.enable_only(moderngl.NOTHING)
        pool.framebuffer(tuple((target.name, 0) for target in results)).use()
        draw.draw(spec, march_steps=steps)
        found, places = (read_target(pool, target.name).reshape(-1, 4)[: len(origins)] for target in results)
        return Met(
            found[:, 0] > 0.5,
            found[:, 1] > 0.5,
            places[:, 2] > 0.5,
            found[:, 2].astype(np.float64),
            found[:, 3].astype(int),
            places[:, :2].astype(int),
            np.zeros(len(origins), bool),
        )
    finally:
        draw.release()
        pool.release()


def march_in_numpy(camera, depth, exits, origins, directions, *, reach, steps, jitter):
    """The same, each ray by itself, in float64."""
    reach, jitter = (np.broadcast_to(value, len(origins)) for value in (reach, jitter))
    rays = zip(np.asarray(origins, float), np.asarray(directions, float), reach, jitter, strict=True)
    met = [_march_one(camera, depth, exits, *ray, steps) for ray in rays]
    return Met(*(np.array(values) for values in zip(*met, strict=True)))


def _march_one(camera, depth, exits, origin, direction, reach, jitter, steps):
    layers, height, width = depth.shape
    size = np.array([width, height])
    flip = np.array([1.0, 1.0, -1.0])
    start, way = (origin @ camera.rotation) * flip, (direction @ camera.rotation) * flip
    screen = _distance_on_screen(camera, start, way)
    end = min(reach, screen)
    low, high = np.array(camera.window[::2]), np.array(camera.window[1::2])

    def place(distance):
        """(pixel coordinates, view depth) at a distance along the ray."""
        point = start + distance * way
        return (point[:2] / (1.0 if camera.orthographic else point[2]) - low) / (high - low) * size, point[2]

    first, last = place(0.0)[0], place(end)[0]
    pixels = np.abs(last - first).max()
    count = float(np.clip(np.ceil(pixels), 1.0, steps))
    even = min(count / max(pixels, 1.0), 1.0)
    before, was = start[2], np.full(layers, -FARTHEST)
    was[0] = start[2] + ROUNDING * abs(start[2])
    unsure = abs(pixels - round(pixels)) < 1e-3 * max(pixels, 1.0) and pixels < steps + 1
    for taken in np.arange(1.0, count + 1.0):
        u = (taken - jitter) / (count - jitter)
        s = u * (u + (1.0 - u) * even)
        distance = _distance_at(camera, start, way, end, s)
        at, ray_depth = place(distance)
        pixel = np.clip(np.floor(at), 0, size - 1).astype(int)
        unsure |= bool((np.abs(at - np.round(at)) < 1e-3 * np.maximum(1.0, np.abs(last - first))).any())
        window = np.abs(high - low) / size
        begin = depth[:, pixel[1], pixel[0]].astype(float)
        pixel_width = window.max() * (1.0 if camera.orthographic else begin)
        sheet = pixel_width * pixels * (2.0 * u + (1.0 - 2.0 * u) * even) / count
        following = np.append(begin[1:], FARTHEST)
        ends = np.minimum(begin + sheet, following)
        if exits is not None:
            leaves = exits[:, pixel[1], pixel[0]].astype(float)
            ends = np.where(leaves > np.minimum(following, FARTHEST) * (1.0 + ROUNDING), ends, leaves)
            backs = np.isfinite(begin[1:]) & (
                np.abs(leaves[:-1] - np.minimum(begin[1:], FARTHEST)) <= ROUNDING * begin[1:]
            )
            begin[1:], ends[1:] = np.where(backs, begin[:-1], begin[1:]), np.where(backs, -FARTHEST, ends[1:])
        rounding = 1e-5 * (np.abs(ray_depth) + np.abs(start[2]))
        margins = [ray_depth - begin, min(before, ray_depth) - ends]
        unsure |= any((np.abs(margin[np.isfinite(margin)]) < rounding).any() for margin in margins)
        for k in range(layers):
            entered = min(before, ray_depth) <= ends[k] or _went_through(before, was, begin, k)
            if begin[k] < ray_depth and entered:
                return True, False, False, distance, k, pixel, unsure
        hidden = begin[0] < ray_depth
        before, was = ray_depth, begin
    return False, screen < reach, hidden, end, 0, np.zeros(2, int), unsure or abs(screen - reach) < 1e-4 * end


def _went_through(before, was, begin, k):
    """Whether a ray was in front of what layer k shows now, in whichever layer that was."""
    with np.errstate(invalid="ignore"):
        apart = np.abs(begin[:, None] - was[None, :])  # from each layer now to each layer before
    others = [j for j in (k - 1, k + 1) if 0 <= j < len(was)]
    goes_on = k + 1 < len(was) and apart[k, k] < apart[k + 1, k] and before < was[k]
    for j in others:
        nearer_than = apart[j, j] if j < k else apart[k, k]
        goes_on |= before < was[j] and apart[k, j] < nearer_than
    return goes_on


def _distance_on_screen(camera, start, way):
    """How far a ray stays inside the window, m."""
    base, widening = (1.0, 0.0) if camera.orthographic else (start[2], way[2])
    distances = [FARTHEST]
    for axis, edge, side in ((0, 0, 1), (0, 1, -1), (1, 2, 1), (1, 3, -1)):
        inside = side * (start[axis] - camera.window[edge] * base)
        approach = side * (camera.window[edge] * widening - way[axis])
        if approach > 0.0:
            distances.append(max(inside, 0.0) / approach)
    if not camera.orthographic and way[2] < 0.0:
        distances.append((1.0 - np.sqrt(np.finfo(np.float32).eps)) * start[2] / -way[2])
    return min(distances)


def _distance_at(camera, start, way, end, fraction):
    """Distance (m) at a fraction of the way that the ray makes on the screen."""
    if camera.orthographic:
        return fraction * end
    last = start[2] + end * way[2]
    return fraction * end * start[2] / ((1.0 - fraction) * last + fraction * start[2])
