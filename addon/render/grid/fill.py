# SPDX-License-Identifier: GPL-3.0-or-later
"""Fills the radiance grid: points on the scene's surfaces are drawn, each into the texel of the face it belongs to.

Of the ways that were measured (blender_tests/bench/results/filling.md) this one needs no more than OpenGL 4.1, finds
surfaces that hide behind any number of others, and does not depend on where cells lie.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product, zip_longest
from math import sqrt

import moderngl
import numpy as np

from ...scene.arrays import BoolArray, Float32Array, Float64Array, UInt8Array
from ..casters import batch_bounds
from ..device import Device
from ..draws import MATERIAL_UNIFORMS, Draw
from ..geometry import INSTANCE_ATTRIBUTES, split_float64
from ..indirect_plan import LARGEST_REFLECTANCE
from ..passes.base import Frame, UniformBuffer
from ..passes.rasterize import SURFACES
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .changes import NOTHING_CHANGED, kept_cells, kept_marks, sources, world_box
from .contents import unsampled_emission
from .faces import ORIENTATIONS, number_faces
from .levels import GridLevel
from .point_buffers import PointCache
from .points import REACH
from .textures import (
    ADDED_UP,
    FACE_UNIFORMS,
    GREATEST,
    GRID_DEFINES,
    SUMS,
    FaceDraw,
    GridTextures,
    face_program,
    face_uniforms,
)

GRID_POINTS_UNIFORMS = UniformBlock(
    "GridPointsUniforms",
    (
        ("level_high", "vec4"),  # the level's lowest corner in world space, as two float32 parts
        ("level_low", "vec4"),
        ("level_size", "vec4"),  # cells along its sides, and below it in the table
        ("target_size", "vec2"),  # texels of what is drawn into
        ("level_cell", "float"),  # m
        ("point_area", "float"),  # m² of object space that a point stands for
        ("point_spacing", "float"),  # m of object space between points
        ("alpha_threshold", "float"),
    ),
)


_OCCUPANCY_WIDTH = 4096
_POINTS_BINDING, _MATERIAL_BINDING = 0, 1
_KEEP_SAMPLERS = (*SUMS, "face_sources")


class GridFill:
    """Finds the faces of a scene and adds up their surfaces, where these are not as they were before."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._uniforms = UniformBuffer(device, GRID_POINTS_UNIFORMS)
        self._keep = FaceDraw(device, FACE_UNIFORMS)
        self._planes = FaceDraw(device, FACE_UNIFORMS)
        self._points = PointCache(device)

    def fill(
        self,
        frame: Frame,
        levels: tuple[GridLevel, ...],
        before: GridTextures | None = None,
        changed: Float64Array = NOTHING_CHANGED,
    ) -> GridTextures:
        """The surfaces of a frame's scene in these levels.

        `before`: an earlier grid, of a scene that differs from this one only in boxes, `changed` (K, 2, 3), world
        space. Cells that both have outside of that are taken from there.
        Raises RenderError where memory does not suffice.
        """
        kept = _kept(levels, before, changed)
        places = _places(frame, levels, kept)
        marks: list[UInt8Array] = []
        for number, (place, cells) in enumerate(zip(places, kept, strict=True)):
            there = self._occupied(frame, place)
            if before is not None and cells.any():
                earlier = kept_marks(before.faces, before.levels[number], number, place.level, cells)
                there = np.where(np.repeat(cells.ravel(), ORIENTATIONS), earlier, there)
            marks.append(there)
        faces = number_faces(levels, tuple(marks))
        textures = GridTextures(self._device, levels, faces, frame.settings.indirect.cell_rays)
        try:
            if before is not None:
                textures.take_from(sources(faces, kept, before.faces, _kept(before.levels, textures, changed)))
            self._add_up(frame, textures, places, before)
            self._find_planes(textures)
        except BaseException:
            textures.release()
            raise
        self._points.tidy(frame.scene)
        return textures

    def release(self) -> None:
        """Free everything."""
        for item in (self._points, self._uniforms, self._keep, self._planes):
            item.release()

    def _occupied(self, frame: Frame, place: "_Place") -> UInt8Array:
        """(6 · cells,) not 0 where a level has a face, as far as its place is not kept."""
        count = ORIENTATIONS * place.level.count
        if not place.draws:
            return np.zeros(count, np.uint8)
        size = (_OCCUPANCY_WIDTH, -(-count // _OCCUPANCY_WIDTH))
        texture = self._device.context.texture(size, 1, dtype="f1")
        framebuffer = self._device.context.framebuffer([texture])
        try:
            self._device.check_upload("the table of the radiance grid's cells", size[0] * size[1])
            framebuffer.use()
            framebuffer.clear()
            self._device.context.enable_only(moderngl.NOTHING)
            for draw in place.draws:
                self._draw(frame, draw, place, "OCCUPANCY", size)
            self._device.context.finish()
            marks = np.frombuffer(framebuffer.read(components=1, alignment=1), np.uint8)[:count].reshape(-1, 2)
            return np.repeat(marks.max(axis=1), 2)  # what has a front has a back
        finally:
            self._device.no_framebuffer.use()
            framebuffer.release()
            texture.release()

    def _add_up(
        self, frame: Frame, textures: GridTextures, places: Sequence["_Place"], before: GridTextures | None
    ) -> None:
        context = self._device.context
        framebuffer = textures.framebuffer(*SUMS)
        framebuffer.viewport = (0, 0, *framebuffer.size)
        framebuffer.use()
        framebuffer.clear()
        context.enable_only(moderngl.NOTHING)
        if before is not None:
            self._keep_sums(textures, before)
        sampled = {light.key: light for light in frame.plan.lights.mesh_lights}
        framebuffer.viewport = (0, 0, *framebuffer.size)
        framebuffer.use()
        context.enable_only(moderngl.BLEND)
        context.blend_func = moderngl.ONE, moderngl.ONE
        for index in range(len(GREATEST)):
            self._device.raw.blend_greatest(len(ADDED_UP) + index)
        try:
            for place in places:
                for draw in place.draws:
                    glow = unsampled_emission(frame.scene, draw, sampled)
                    self._draw(frame, draw, place, "", framebuffer.size, glow, textures)
        finally:
            self._device.raw.blend_sum()
            context.enable_only(moderngl.NOTHING)

    def _keep_sums(self, textures: GridTextures, before: GridTextures) -> None:
        """Take the sums of kept faces from an earlier grid."""
        spec = self._keep.spec("radiance_grid/keep.frag", samplers=_KEEP_SAMPLERS)
        textures.sources.use(spec.samplers.index("face_sources"))
        for unit, name in enumerate(SUMS):
            before.texture(name).use(unit)
        whole = (0, textures.faces.count)
        uniforms = face_uniforms(textures.levels, np.zeros(3), whole)
        self._keep.draw(spec, textures.framebuffer(*SUMS), whole, uniforms)

    def _draw(
        self,
        frame: Frame,
        draw: Draw,
        place: "_Place",
        purpose: str,
        size: tuple[int, int],
        glow: Float32Array | None = None,
        textures: GridTextures | None = None,
    ) -> None:
        """Draw the points of a draw."""
        level = place.level
        points = self._points.of(frame.scene, draw, level)
        if points is None:
            return
        defines = {purpose} - {""} | draw.surface | ({"EMISSION"} if glow is not None else set[str]())
        spec = points_program(frozenset(defines))
        program = self._device.programs.get(spec)
        if draw.texture is not None and "TEXTURE" in draw.surface:
            frame.images.use(draw.texture, spec.samplers.index("base_color_texture"))
        if textures is not None:
            textures.cells.use(spec.samplers.index("grid_cells"))
            textures.sources.use(spec.samplers.index("face_sources"))
        frame.draws.of(frame.scene).bind_material(draw, _MATERIAL_BINDING)
        content: list[tuple[object, ...]] = [item for item in points.attributes if item[2] in program]
        content.append((frame.geometry.instances(draw.batch), "4f 4f 4f 3f 4x/i", *INSTANCE_ATTRIBUTES[:4]))
        glow_buffer = None
        if glow is not None:
            glow_buffer = self._device.context.buffer(np.ascontiguousarray(glow))
            content.append((glow_buffer, "2f/i", "in_glow"))
        vertex_array = self._device.context.vertex_array(program, content)
        high, low = split_float64(level.origin)
        self._uniforms.bind(
            _POINTS_BINDING,
            level_high=(*high, 0.0),
            level_low=(*low, 0.0),
            level_size=(*level.size, place.bottom),
            target_size=size,
            level_cell=level.cell,
            point_area=min(points.area, float(np.finfo(np.float32).max)),
            point_spacing=sqrt(points.area),
            alpha_threshold=frame.settings.alpha_threshold,
        )
        vertex_array.render(moderngl.POINTS, vertices=points.count, instances=draw.batch.count)
        self._device.context.clear_samplers()
        vertex_array.release()
        if glow_buffer is not None:
            glow_buffer.release()

    def _find_planes(self, textures: GridTextures) -> None:
        spec = self._planes.spec("radiance_grid/planes.frag", samplers=(*SUMS, "face_places"))
        textures.places.use(len(SUMS))
        for unit, name in enumerate(SUMS):
            textures.texture(name).use(unit)
        framebuffer = textures.framebuffer("planes", "points", "albedo", "emission")
        whole = (0, textures.faces.count)
        self._planes.draw(spec, framebuffer, whole, face_uniforms(textures.levels, np.zeros(3), whole))


@dataclass(frozen=True)
class _Place:
    """A level, how far up its cells are in the table, and the draws that have something where it is filled."""

    level: GridLevel
    bottom: int
    draws: tuple[Draw, ...]


def _places(frame: Frame, levels: tuple[GridLevel, ...], kept: tuple[BoolArray, ...]) -> list[_Place]:
    """Where the levels are filled: wherever they are not kept."""
    scene, draws = frame.scene, frame.draws.of(frame.scene).draws
    boxes = np.array([batch_bounds(scene.meshes[draw.batch.mesh], draw.batch) for draw in draws]).reshape(-1, 2, 3)
    places: list[_Place] = []
    bottom = 0
    for level, cells in zip(levels, kept, strict=True):
        filled = world_box(~cells, level)
        there: tuple[Draw, ...] = ()
        if filled is not None:
            low, high = filled[0] - 0.5 * level.cell, filled[1] + 0.5 * level.cell
            touches = ((boxes[:, 0] <= high) & (boxes[:, 1] >= low)).all(axis=1)
            there = tuple(draws[index] for index in np.flatnonzero(touches).tolist())
        places.append(_Place(level, bottom, there))
        bottom += level.size[2]
    return places


def _kept(levels: tuple[GridLevel, ...], other: GridTextures | None, changed: Float64Array) -> tuple[BoolArray, ...]:
    """Per level (D, H, W) which cells hold what another grid's do."""
    others = () if other is None else other.levels
    return tuple(kept_cells(*pair, changed) for pair in zip_longest(levels, others[: len(levels)]))


def points_program(defines: frozenset[str]) -> ProgramSpec:
    """The program that draws points of a kind of material."""
    return ProgramSpec(
        vertex="radiance_grid/points.vert",
        fragment="radiance_grid/points.frag",
        defines=defines | GRID_DEFINES | {f"LARGEST_REFLECTANCE {LARGEST_REFLECTANCE}", f"REACH {REACH}"},
        blocks=(GRID_POINTS_UNIFORMS, MATERIAL_UNIFORMS),
        samplers=("grid_cells", "face_sources", "base_color_texture"),
    )


def fill_variants() -> Iterator[ProgramSpec]:
    """Every program that fills the grid."""
    yield face_program("radiance_grid/keep.frag", (FACE_UNIFORMS,), frozenset(), _KEEP_SAMPLERS)
    yield face_program("radiance_grid/planes.frag", (FACE_UNIFORMS,), frozenset(), (*SUMS, "face_places"))
    for surface, purpose in product(SURFACES, ((), ("OCCUPANCY",), ("EMISSION",))):
        yield points_program(surface | frozenset(purpose))
