# SPDX-License-Identifier: GPL-3.0-or-later
"""The lights of one view on the GPU: what they are, and which point of each the current sample uses."""

from dataclasses import replace
from math import inf

import moderngl
import numpy as np

from ..scene import AreaShape, Light, LightKind, RenderSettings, Scene, World
from ..scene.arrays import Float32Array, Float64Array, Int64Array
from .device import Device
from .light_reach import roulette, rounded_reach, sampled_reach
from .light_samples import (
    ball_points,
    disk_points,
    held_points,
    lattice_points,
    light_shifts,
    points_used,
    spiral_points,
    square_points,
)
from .light_table import TEXELS_PER_SAMPLE, as_texels, light_rows, mesh_light_rows, world_rows
from .lighting_plan import LightPlan
from .world_sampling import WorldSampler


class Lighting:
    """Lights in the order: lamps, emissive surfaces, directions of the world.

    After `begin_sample`: `points` (L, 3) float64, where in world space each lamp and surface is sampled, for a sun and
    the world the direction towards it; `numbers` (L,): equal ones are equal points. `preview`: whether this sample
    shows lamps whole. `sample_count`: how many samples of the film do not. Texels 0.w and 1.w of `samples` (L, 3, 4)
    are for the shadow maps' pass to fill.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        self._table: moderngl.Texture | None = None
        self._sample_texture: moderngl.Texture | None = None
        self._world_sampler: WorldSampler | None = None
        self._sampled_world: World | None = None
        self.plan = LightPlan()
        self.preview = False
        self.sample_count = 1
        self.points = np.zeros((0, 3))
        self.numbers = np.zeros(0, np.int64)
        self._reach = np.zeros(0)
        self.samples = np.zeros((0, TEXELS_PER_SAMPLE, 4), np.float32)

    @property
    def count(self) -> int:
        """How many lights the current sample has: a preview has the world as a whole."""
        return self.plan.count - (self.plan.world_directions if self.preview else 0)

    def begin(self, scene: Scene, settings: RenderSettings, planned: LightPlan, origin: Float64Array) -> None:
        """The lights of a view whose camera is at `origin` (3,)."""
        self.plan, self._settings, self._origin = planned, settings, origin
        self._world = replace(scene.world, seen_by_diffuse=scene.world.seen_by_diffuse and not planned.world_gathered)
        if planned.world_directions and self._sampled_world is not scene.world:
            self._world_sampler, self._sampled_world = WorldSampler(scene.world), scene.world
        self._rows = np.concatenate([light_rows(planned.lights, origin), mesh_light_rows(planned.mesh_lights)])
        keys = [light.key for light in (*planned.lights, *planned.mesh_lights)]
        self._shifts = light_shifts(keys, settings.seed)
        self._world_shift = float(light_shifts(["world"], settings.seed)[0, 0])
        self._extended = np.array(
            [_is_extended(light) for light in planned.lights] + [True] * len(planned.mesh_lights), np.bool_
        )
        self.sample_count = max(settings.samples - planned.preview, 1)
        self._point_count = points_used(int(self._extended.sum()), self.sample_count, settings.shadow_updates)

    def begin_sample(self, sample: int) -> None:
        """Choose the points of a sample."""
        self.preview = self.plan.preview and sample == 0
        sample = self._sample = max(sample - self.plan.preview, 0)  # of those that sample the lights
        lamps = len(self.plan.lights)
        self.numbers = self._numbers(sample)
        cube = lattice_points(self.numbers, self._point_count, self._shifts)
        self.samples = np.zeros((self.plan.count, TEXELS_PER_SAMPLE, 4), np.float32)
        self.points = np.zeros((self.plan.count, 3))
        offsets = np.zeros((lamps, 3)) if self.preview else self._lamp_offsets(cube[:lamps])
        self.samples[:lamps, 0, :3] = offsets
        for index, (light, offset) in enumerate(zip(self.plan.lights, offsets, strict=True)):
            self.points[index] = lamp_point(light, offset)
            self.samples[index, 1, :3] = self.points[index] - self._origin
        for index, light in enumerate(self.plan.mesh_lights, start=lamps):
            point, normal = light.surface.point(cube[index])
            self.points[index] = point
            self.samples[index, 0, :3], self.samples[index, 1, :3] = point - self._origin, normal
        self.samples[: len(self._extended), 2, 2] = ~self._extended
        self.samples[: len(self._extended), 2, 3] = 0.0 if self.preview else 1.0 / self._point_count
        self._draw_reach(sample)
        rows = self._rows
        if self.plan.world_directions:
            rows = np.concatenate([rows, self._world_rows(sample)])
        self._table = self._uploaded(self._table, as_texels(rows))

    @property
    def world_factors(self) -> tuple[float, float]:
        """On what the world causes by diffuse and by glossy reflection.

        A preview has the world as if nothing were in front of it: where the indirect method finds the world, that would
        be out of place beside it.
        """
        bare = self.preview and self.plan.world_gathered
        return float(self._world.seen_by_diffuse), float(self._world.seen_by_glossy and not bare)

    @property
    def point_spacing(self) -> float:
        """About half the distance between the points that the film's samples use of a light whose half size is 1.

        0 in a preview, which has only one.
        """
        return 0.0 if self.preview else self._point_count**-0.5

    def state(self, index: int) -> tuple[int, float]:
        """Which of its points a light uses, and how far (m) it reaches at most: what its shadows depend on.

        Those of the world are new in every sample, a preview's are others.
        """
        if index >= len(self.numbers):
            return self._sample, inf
        return -1 if self.preview else int(self.numbers[index]), float(self._reach[index])

    def table(self) -> moderngl.Texture:
        """What the lights are: `light_table.light_rows`, an image of `as_texels`."""
        assert self._table is not None
        return self._table

    def upload_samples(self) -> moderngl.Texture:
        """The current sample's texels as they are now: `shaders/common/lights.glsl` documents them."""
        self._sample_texture = self._uploaded(self._sample_texture, as_texels(self.samples))
        return self._sample_texture

    def release(self) -> None:
        """Free the textures."""
        for texture in (self._table, self._sample_texture):
            if texture is not None:
                texture.release()
        self._table = self._sample_texture = None

    def _numbers(self, sample: int) -> Int64Array:
        """Which of its points each lamp and surface uses; one without extent has a single one."""
        numbers = np.zeros(len(self._extended), np.int64)
        numbers[self._extended] = held_points(int(self._extended.sum()), sample, self._settings.shadow_updates)
        return numbers

    def _lamp_offsets(self, cube: Float64Array) -> Float64Array:
        """(L, 3) of each lamp: in the ball, of suns in the disk across; of area lights in the square or disk, z = 0.

        `cube`: (L, 3) in [0, 1).
        """
        lights, lamps = self.plan.lights, len(self.plan.lights)
        offsets = ball_points(self.numbers[:lamps], self._point_count, self._shifts[:lamps])
        for points, shape in ((square_points(cube), AreaShape.RECTANGLE), (disk_points(cube), AreaShape.ELLIPSE)):
            chosen = [light.kind is LightKind.AREA and light.shape is shape for light in lights]
            offsets[chosen] = points[chosen]
        for index, (light, (x, y, _)) in enumerate(zip(lights, disk_points(cube), strict=True)):
            if light.kind is LightKind.SUN:  # everybody sees it from the same side: a disk is more even than a ball
                offsets[index] = light.world_from_light[:3, :2] @ (x, y)
        return offsets

    def _draw_reach(self, sample: int) -> None:
        lamps = len(self.plan.lights)
        self.samples[:, 2, :2] = np.inf
        self._reach = np.full(self.plan.count, inf)
        if self.plan.many:
            full = np.array(self.plan.reach)
            keys = [light.key for light in self.plan.lights]
            # A light whose point changes is drawn anew with it, so that its shadows are, too, as far as it reaches.
            draws = np.where(self._extended[:lamps], self.numbers[:lamps], sample)
            reach = sampled_reach(full, roulette(keys, draws, self._settings.seed))
            self.samples[:lamps, 2, 0], self.samples[:lamps, 2, 1] = reach**2, full**2
            self._reach[:lamps] = rounded_reach(full, reach)

    def _world_rows(self, sample: int) -> Float32Array:
        count = self.plan.world_directions
        assert self._world_sampler is not None
        total = count * self.sample_count
        numbers = sample * count + np.arange(count)
        directions, weights = self._world_sampler.directions(spiral_points(numbers, total, self._world_shift))
        self.points[-count:] = directions
        return world_rows(directions, weights / count, self._world)

    def _uploaded(self, texture: moderngl.Texture | None, image: Float32Array) -> moderngl.Texture:
        size = (image.shape[1], image.shape[0])
        if texture is not None and texture.size == size:
            texture.write(np.ascontiguousarray(image))
            return texture
        if texture is not None:
            texture.release()
        texture = self._device.context.texture(size, 4, np.ascontiguousarray(image), dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture


def lamp_point(light: Light, offset: Float64Array) -> Float64Array:
    """World-space point (3,) of a lamp at an offset (3,) as in `Lighting.samples`; of a sun the direction to it."""
    rotation, center = light.world_from_light[:3, :3], light.world_from_light[:3, 3]
    if light.kind is LightKind.SUN:
        return sun_direction(rotation[:, 2], 0.5 * light.angle, offset)
    if light.kind is LightKind.AREA:
        half_x, half_y = 0.5 * light.size[0] * rotation[:, 0], 0.5 * light.size[1] * rotation[:, 1]
        return center + offset[0] * half_x + offset[1] * half_y
    return center + light.radius * offset


def sun_direction(axis: Float64Array, half_angle: float, offset: Float64Array) -> Float64Array:
    """Unit direction (3,) within a cone about `axis`, uniform in solid angle where the part of `offset` across the axis
    is uniform in the unit disk; `sample_cone` in `shaders/common/lights.glsl` is the same."""
    across = offset - axis * (axis @ offset)
    share = float(across @ across)
    drop = share * 2.0 * np.sin(0.5 * half_angle) ** 2
    if share == 0.0:
        return axis
    return across * np.sqrt(drop * (2.0 - drop) / share) + axis * (1.0 - drop)


def _is_extended(light: Light) -> bool:
    if light.kind is LightKind.AREA:
        return True
    return (light.angle if light.kind is LightKind.SUN else light.radius) > 0.0
