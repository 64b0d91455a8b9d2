# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of the radiance grid's faces: direct light, then bounces between coarse faces, carried to the finest."""

from collections.abc import Iterator
from dataclasses import replace

import moderngl
import numpy as np

from ...scene import ShadingModel
from ...scene.arrays import Float32Array, Float64Array
from ..device import Device
from ..direct_needs import LIGHT_DEFINES, direct_needs, direct_program_defines
from ..environment import ENVIRONMENT_DEFINE, ENVIRONMENT_SAMPLERS, ENVIRONMENT_UNIFORMS, environment_uniforms
from ..lighting import Lighting
from ..passes.base import Frame
from ..passes.direct import (
    DIRECT_SAMPLERS,
    DIRECT_SIZES,
    DIRECT_UNIFORMS,
    bind_lights_and_shadows,
    light_uniforms,
    program_defines,
)
from ..passes.shadow_maps import ShadowMapsPass
from ..planned_pass import PlannedPass
from ..programs import ProgramSpec
from ..receivers import MOST_TILES, Receivers
from ..sampling import film_sample
from ..uniforms import UniformBlock
from .changes import NOTHING_CHANGED, box_around
from .textures import FACE_UNIFORMS, FaceDraw, GridTextures, face_program, face_uniforms

CHANGE_UNIFORMS = UniformBlock(
    "ChangeUniforms",
    (
        ("changed_low", "vec4"),  # box around what is not as in the grid before, camera-relative, m
        ("changed_high", "vec4"),
    ),
)
SKY_UNIFORMS = UniformBlock("SkyUniforms", ENVIRONMENT_UNIFORMS)

START_OFFSET = 0.25
"""Cells from a face, along its normal, to where its light is looked up and its rays begin: the face stands for surface
that lies up to half a cell before and behind its plane, a quarter on average."""

_DEFINES = frozenset({f"START_OFFSET {START_OFFSET}"})
_FACE_NEEDS = (*LIGHT_DEFINES[:-1], "SPOT_CONES", "SHADOWS")
_LIGHT_POINTS = 4
"""Points that each light is sampled at. Closed forms with soft shadows, as previews have them, would be smoother, but
let too much light of large lamps past what stands near these."""

_TEXELS_PER_CELL = 4
_CHECKED_BOUNCES = 8
_GREATEST_REST = 0.002
"""Share of all light that further bounces may still bring when they are left out."""

_MOST_BOUNCES = 1024

_FACE_SAMPLERS = ("grid_cells", "face_planes", "face_points", "face_places")
_KEPT_SAMPLERS = (*_FACE_SAMPLERS, "face_sources", "face_moved", "links_before")
_LIGHT_SAMPLERS = (*_FACE_SAMPLERS, *DIRECT_SAMPLERS, "ltc_table", "ggx_albedo_table")
_FIRST_SAMPLERS = (*_FACE_SAMPLERS, "face_links", "face_emission", *ENVIRONMENT_SAMPLERS)
_BOUNCE_SAMPLERS = (*_FACE_SAMPLERS, "face_albedo", "face_direct", "face_links", "face_first", "face_radiance")
_CARRY_SAMPLERS = (
    *_FACE_SAMPLERS,
    "face_albedo",
    "face_direct",
    "face_emission",
    "face_indirect",
    "face_radiance",
)


class GridRadiance:
    """Lights the faces of a grid."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._lights = _FaceLights(device)
        self._light = FaceDraw(device, DIRECT_UNIFORMS, FACE_UNIFORMS)
        self._first = FaceDraw(device, FACE_UNIFORMS, SKY_UNIFORMS)
        self._bounce = FaceDraw(device, FACE_UNIFORMS)
        self._links = FaceDraw(device, FACE_UNIFORMS, CHANGE_UNIFORMS)

    def light(self, frame: Frame, grid: GridTextures) -> None:
        """Find every face's irradiance by lamps and emissive surfaces, each by a few of its points."""
        context = self._device.context
        target = grid.framebuffer("direct")
        target.viewport = (0, 0, *target.size)
        target.use()
        target.clear()
        if frame.plan.bounced_lights.count == 0:
            return
        self._lights.begin(frame, grid)
        for sample in range(_LIGHT_POINTS):
            lit = self._lights.at_sample(sample)
            context.enable_only(moderngl.BLEND)
            context.blend_func = moderngl.ONE, moderngl.ONE
            self._draw_light(lit, grid, 1.0 / _LIGHT_POINTS)
        context.enable_only(moderngl.NOTHING)

    def link(
        self,
        frame: Frame,
        grid: GridTextures,
        before: GridTextures | None = None,
        changed: Float64Array = NOTHING_CHANGED,
    ) -> None:
        """Find which faces the rays of the coarse faces meet.

        `before`: the grid that this one was filled from. Where that has the same levels, its rays are kept that come
        from kept cells to kept cells and stay out of the box around what `changed` (K, 2, 3).
        """
        if before is None or len(changed) == 0 or before.levels != grid.levels:
            spec = self._links.spec("radiance_grid/links.frag", _DEFINES, _FACE_SAMPLERS)
            self._draw_links(frame, grid, spec, np.zeros((2, 3)))
            return
        spec = self._links.spec("radiance_grid/links.frag", _DEFINES | {"KEPT"}, _KEPT_SAMPLERS)
        moved = grid.places_of(before)
        grid.sources.use(spec.samplers.index("face_sources"))
        moved.use(spec.samplers.index("face_moved"))
        before.links.use(spec.samplers.index("links_before"))
        around = _cells_around(box_around(changed), grid.levels[-1].cell)
        try:
            self._draw_links(frame, grid, spec, around - frame.view.position)
        finally:
            moved.release()

    def meet_first(self, frame: Frame, grid: GridTextures) -> None:
        """Find the coarse faces' irradiance by emission and by the world."""
        world, defines = frame.scene.world, set[str]()
        if frame.plan.indirect.world_gathered:
            defines |= {"WORLD", ENVIRONMENT_DEFINE} if world.environment is not None else {"WORLD"}
        target = grid.framebuffer("first")
        spec = self._first.spec("radiance_grid/first.frag", frozenset(defines) | _DEFINES, _FIRST_SAMPLERS)
        self._bind_faces(spec, grid)
        grid.links.use(spec.samplers.index("face_links"))
        if ENVIRONMENT_DEFINE in defines and world.environment is not None:
            frame.environment.bind(world.environment, spec)
        faces = (grid.faces.first[1], grid.faces.count)
        uniforms = face_uniforms(grid.levels, frame.view.position, faces, ray_count=grid.cell_rays)
        self._first.draw(spec, target, faces, uniforms, environment_uniforms(world))

    def bounce(self, frame: Frame, grid: GridTextures) -> None:
        """Let light bounce between the coarse faces as often as the settings say, and carry it to the finest ones."""
        bounces = frame.settings.indirect.bounces
        self._bounce_once(frame, grid, 0)
        done, before, step = 1, 0.0, 0.0
        while bounces is None or done < bounces:
            self._bounce_once(frame, grid, grid.cell_rays)
            done += 1
            if done % _CHECKED_BOUNCES == 0:
                total = _total(grid)
                last, step, before = step, total - before, total
                # The rest is a geometric series with the ratio that the last steps had.
                ratio = min(step / last, 1.0) if last > 0.0 else 1.0
                if step <= _GREATEST_REST * total * (1.0 - ratio) or done >= _MOST_BOUNCES:
                    break
        self._carry(frame, grid)

    def release(self) -> None:
        """Free everything."""
        for item in (self._lights, self._light, self._first, self._bounce, self._links):
            item.release()

    def _draw_links(self, frame: Frame, grid: GridTextures, spec: ProgramSpec, changed: Float64Array) -> None:
        self._device.context.enable_only(moderngl.NOTHING)
        self._bind_faces(spec, grid)
        faces = (grid.faces.first[1], grid.faces.count)
        box: dict[str, object] = {"changed_low": (*changed[0], 0.0), "changed_high": (*changed[1], 0.0)}
        for ray in range(grid.cell_rays):
            uniforms = face_uniforms(grid.levels, frame.view.position, faces, ray=ray, ray_count=grid.cell_rays)
            self._links.draw(spec, grid.link_framebuffer(ray), faces, uniforms, box)

    def _draw_light(self, frame: Frame, grid: GridTextures, share: float) -> None:
        defines = _light_defines(frame)
        spec = self._light.spec("radiance_grid/light.frag", defines, _LIGHT_SAMPLERS)
        bind_lights_and_shadows(frame, spec)
        self._device.ltc.use(spec.samplers.index("ltc_table"))
        self._device.ggx_albedo.use(spec.samplers.index("ggx_albedo_table"))
        self._bind_faces(spec, grid)
        faces = (0, grid.faces.count)
        uniforms = face_uniforms(grid.levels, frame.view.position, faces, share=share)
        self._light.draw(spec, grid.framebuffer("direct"), faces, {**light_uniforms(frame), "layer": 0}, uniforms)

    def _bounce_once(self, frame: Frame, grid: GridTextures, rays: int) -> None:
        spec = self._bounce.spec("radiance_grid/bounce.frag", samplers=_BOUNCE_SAMPLERS)
        self._bind_faces(spec, grid)
        grid.links.use(spec.samplers.index("face_links"))
        faces = (grid.faces.first[1], grid.faces.count)
        uniforms = face_uniforms(grid.levels, frame.view.position, faces, ray_count=rays)
        self._bounce.draw(spec, grid.framebuffer("next_indirect", "next_radiance"), faces, uniforms)
        grid.exchange("indirect", "radiance")

    def _carry(self, frame: Frame, grid: GridTextures) -> None:
        spec = self._bounce.spec("radiance_grid/carry.frag", samplers=_CARRY_SAMPLERS)
        self._bind_faces(spec, grid)
        faces = (0, grid.faces.count)
        uniforms = face_uniforms(grid.levels, frame.view.position, faces)
        self._bounce.draw(spec, grid.framebuffer("next_indirect", "next_radiance"), faces, uniforms)
        grid.exchange("indirect", "radiance")

    def _bind_faces(self, spec: ProgramSpec, grid: GridTextures) -> None:
        grid.cells.use(spec.samplers.index("grid_cells"))
        grid.places.use(spec.samplers.index("face_places"))
        for unit, sampler in enumerate(spec.samplers):
            name = sampler.removeprefix("face_")
            if sampler.startswith("face_") and name not in ("places", "links", "sources", "moved"):
                grid.texture(name).use(unit)


class _FaceLights:
    """Lights as the faces of a grid see them, with shadow maps for all of the grid."""

    def __init__(self, device: Device) -> None:
        self._lighting = Lighting(device)
        self._shadows = _GridShadowMaps(device)
        self._frame: Frame | None = None

    def begin(self, frame: Frame, grid: GridTextures) -> None:
        """Look at the lights that the plan has for the grid."""
        plan = frame.plan.bounced_lights
        largest = _TEXELS_PER_CELL * max(grid.levels[0].size)
        size = min(1 << max(largest - 1, 1).bit_length(), frame.settings.shadow_map_size)
        settings = replace(
            frame.settings, samples=_LIGHT_POINTS, shadow_map_size=size, shading_model=ShadingModel.PHYSICAL
        )
        self._lighting.begin(frame.scene, settings, plan, frame.view.position)
        self._shadows.receivers = grid_receivers(grid)
        self._frame = replace(
            frame, lighting=self._lighting, settings=settings, shadows=None, plan=replace(frame.plan, lights=plan)
        )
        self._shadows.prepare(self._frame, PlannedPass("shadow_maps"))

    def at_sample(self, index: int) -> Frame:
        """The frame as faces are lit in one of the samples."""
        assert self._frame is not None
        self._frame.sample = film_sample(index, 0.0, 0)
        self._lighting.begin_sample(index)
        if self._lighting.plan.casts_shadows:
            self._shadows.run(self._frame, PlannedPass("shadow_maps"))
        return self._frame

    def release(self) -> None:
        """Free everything."""
        self._lighting.release()
        self._shadows.release()


class _GridShadowMaps(ShadowMapsPass):
    """Shadow maps of what falls on the grid's faces, whether the camera sees them or not."""

    receivers: Receivers

    def find_receivers(self, frame: Frame) -> Receivers:
        """All of the grid."""
        return self.receivers


def _cells_around(box: Float64Array, cell: float) -> Float64Array:
    """(2, 3) a box that holds all cells of up to this size that a box (2, 3) touches, and what reaches out of them."""
    return box + np.array([[-2.0 * cell], [2.0 * cell]])


def grid_receivers(grid: GridTextures) -> Receivers:
    """The coarsest level's faces in blocks of as many cells as leave no more than `MOST_TILES` blocks."""
    level = grid.levels[-1]
    cells = grid.faces.cells[grid.faces.first[-2] :]
    shift = 0
    while True:
        blocks = np.unique(cells >> shift, axis=0)
        if len(blocks) <= MOST_TILES:
            break
        shift += 1
    side = float(level.cell * (1 << shift))
    low = level.origin + blocks * side
    square = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]) * side
    count = len(blocks)
    return Receivers(
        origins=low[:, None] + square,
        rays=np.broadcast_to(np.array([0.0, 0.0, 1.0]), (count, 4, 3)),
        near=np.zeros(count),
        far=np.full(count, side),
        pixel_slope=0.0,
        pixel_size=grid.levels[0].cell / _TEXELS_PER_CELL,
    )


def _light_defines(frame: Frame) -> frozenset[str]:
    needs = direct_needs(frame.scene, frame.settings, frame.lighting.plan)
    wanted = frozenset(name for name in _FACE_NEEDS if needs[name][0])
    return direct_program_defines(wanted, preview=frame.lighting.preview) | DIRECT_SIZES | _DEFINES


def _total(grid: GridTextures) -> float:
    """Sum of the light of all coarse faces."""
    texels = np.frombuffer(grid.texture("indirect").read(), np.float32).reshape(-1, 4)
    coarse: Float32Array = texels[grid.faces.first[1] : grid.faces.count, :3]
    return float(coarse.sum(dtype=np.float64))


def radiance_variants() -> Iterator[ProgramSpec]:
    """Every program that lights faces."""
    for wanted in program_defines(_FACE_NEEDS):
        defines = wanted - {"WORLD", "ENVIRONMENT", "EMISSION", "SPLIT"} | DIRECT_SIZES | _DEFINES
        yield face_program("radiance_grid/light.frag", (DIRECT_UNIFORMS, FACE_UNIFORMS), defines, _LIGHT_SAMPLERS)
    blocks = (FACE_UNIFORMS, CHANGE_UNIFORMS)
    yield face_program("radiance_grid/links.frag", blocks, _DEFINES, _FACE_SAMPLERS)
    yield face_program("radiance_grid/links.frag", blocks, _DEFINES | {"KEPT"}, _KEPT_SAMPLERS)
    for world in (frozenset[str](), frozenset({"WORLD"}), frozenset({"WORLD", ENVIRONMENT_DEFINE})):
        blocks = (FACE_UNIFORMS, SKY_UNIFORMS)
        yield face_program("radiance_grid/first.frag", blocks, world | _DEFINES, _FIRST_SAMPLERS)
    yield face_program("radiance_grid/bounce.frag", (FACE_UNIFORMS,), frozenset(), _BOUNCE_SAMPLERS)
    yield face_program("radiance_grid/carry.frag", (FACE_UNIFORMS,), frozenset(), _CARRY_SAMPLERS)
