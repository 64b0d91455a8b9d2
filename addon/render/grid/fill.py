# SPDX-License-Identifier: GPL-3.0-or-later
"""Fills the radiance grid: points on the scene's surfaces are drawn, each into the texel of the face it belongs to.

Of the ways that were considered (see the README) this is the one that needs no more than OpenGL 4.1, copes with
instances and deformed meshes at the cost of their points, and finds surfaces that hide behind any number of others.
"""

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from math import sqrt

import moderngl
import numpy as np

from ...scene import Mesh, Scene, SlotRange
from ...scene.arrays import Float32Array, Float64Array, UInt8Array
from ..device import Device
from ..draws import MATERIAL_UNIFORMS, Draw
from ..geometry import INSTANCE_ATTRIBUTES, drawing_order, split_float64
from ..indirect_plan import LARGEST_REFLECTANCE
from ..mesh_lights import MeshLight
from ..passes.base import Frame, UniformBuffer
from ..passes.rasterize import SURFACES
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .faces import ORIENTATIONS, number_faces
from .levels import GridLevel
from .points import POINTS_PER_CELL, REACH, SurfacePoints, surface_points
from .textures import (
    ADDED_UP,
    FACE_UNIFORMS,
    GREATEST,
    GRID_DEFINES,
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


@dataclass
class _PointBuffers:
    """Points of one slot of a mesh on the GPU."""

    points: SurfacePoints
    attributes: list[tuple[moderngl.Buffer, str, str]]

    def release(self) -> None:
        for buffer, _, _ in self.attributes:
            buffer.release()


class GridFill:
    """Finds the faces of a scene and adds up their surfaces. Points of what did not change are kept."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._uniforms = UniformBuffer(device, GRID_POINTS_UNIFORMS)
        self._planes = FaceDraw(device, FACE_UNIFORMS)
        self._points: dict[Hashable, _PointBuffers] = {}
        self._used: set[Hashable] = set()

    def fill(self, frame: Frame, levels: tuple[GridLevel, ...]) -> GridTextures:
        """The surfaces of a frame's scene in these levels. Raises RenderError where memory does not suffice."""
        draws = frame.draws.of(frame.scene).draws
        sampled = {light.key: light for light in frame.plan.lights.mesh_lights}
        self._used = set()
        marks = tuple(self._occupied(frame, draws, level) for level in levels)
        faces = number_faces(levels, marks)
        textures = GridTextures(self._device, levels, faces, frame.settings.indirect.cell_rays)
        self._add_up(frame, draws, textures, sampled)
        self._find_planes(textures)
        for key in self._points.keys() - self._used:
            self._points.pop(key).release()
        return textures

    def release(self) -> None:
        """Free everything."""
        for points in self._points.values():
            points.release()
        self._points.clear()
        self._uniforms.release()
        self._planes.release()

    def _occupied(self, frame: Frame, draws: tuple[Draw, ...], level: GridLevel) -> UInt8Array:
        """(6 · cells,) not 0 where a level has a face."""
        count = ORIENTATIONS * level.count
        size = (_OCCUPANCY_WIDTH, -(-count // _OCCUPANCY_WIDTH))
        texture = self._device.context.texture(size, 1, dtype="f1")
        framebuffer = self._device.context.framebuffer([texture])
        try:
            self._device.check_upload("the table of the radiance grid's cells", size[0] * size[1])
            framebuffer.use()
            framebuffer.clear()
            self._device.context.enable_only(moderngl.NOTHING)
            for draw in draws:
                self._draw(frame, draw, level, "OCCUPANCY", size)
            self._device.context.finish()
            marks = np.frombuffer(framebuffer.read(components=1, alignment=1), np.uint8)[:count].reshape(-1, 2)
            return np.repeat(marks.max(axis=1), 2)  # what has a front has a back
        finally:
            self._device.no_framebuffer.use()
            framebuffer.release()
            texture.release()

    def _add_up(
        self, frame: Frame, draws: tuple[Draw, ...], textures: GridTextures, sampled: Mapping[str, MeshLight]
    ) -> None:
        context = self._device.context
        framebuffer = textures.framebuffer(*ADDED_UP, *GREATEST)
        framebuffer.viewport = (0, 0, *framebuffer.size)
        framebuffer.use()
        framebuffer.clear()
        context.enable_only(moderngl.BLEND)
        context.blend_func = moderngl.ONE, moderngl.ONE
        for index in range(len(GREATEST)):
            self._device.raw.blend_greatest(len(ADDED_UP) + index)
        bottom = 0
        for level in textures.levels:
            for draw in draws:
                glow = unsampled_emission(frame.scene, draw, sampled)
                self._draw(frame, draw, level, "", framebuffer.size, bottom, glow, textures.cells)
            bottom += level.size[2]
        self._device.raw.blend_sum()
        context.enable_only(moderngl.NOTHING)

    def _draw(
        self,
        frame: Frame,
        draw: Draw,
        level: GridLevel,
        purpose: str,
        size: tuple[int, int],
        bottom: int = 0,
        glow: Float32Array | None = None,
        cells: moderngl.Texture3D | None = None,
    ) -> None:
        """Draw the points of a draw."""
        points = self._points_of(frame.scene, draw, level)
        if points is None:
            return
        defines = {purpose} - {""} | draw.surface | ({"EMISSION"} if glow is not None else set[str]())
        spec = points_program(frozenset(defines))
        program = self._device.programs.get(spec)
        if draw.texture is not None and "TEXTURE" in draw.surface:
            frame.images.use(draw.texture, spec.samplers.index("base_color_texture"))
        if cells is not None:
            cells.use(spec.samplers.index("grid_cells"))
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
            level_size=(*level.size, bottom),
            target_size=size,
            level_cell=level.cell,
            point_area=points.points.area,
            point_spacing=sqrt(points.points.area),
            alpha_threshold=frame.settings.alpha_threshold,
        )
        vertex_array.render(moderngl.POINTS, vertices=points.points.count, instances=draw.batch.count)
        self._device.context.clear_samplers()
        vertex_array.release()
        if glow_buffer is not None:
            glow_buffer.release()

    def _points_of(self, scene: Scene, draw: Draw, level: GridLevel) -> _PointBuffers | None:
        """Points that are dense enough for a level; None where there are none."""
        mesh, batch = scene.meshes[draw.batch.mesh], draw.batch
        slot = next(slot for slot in mesh.slots if 3 * slot.first == draw.first_index)
        density = POINTS_PER_CELL * (_largest_scale(batch.matrices) / level.cell) ** 2
        box = _object_box(mesh, batch.matrices, level)
        key = (mesh.key, mesh.version, slot.first, density, None if box is None else box.tobytes())
        self._used.add(key)
        if key not in self._points:
            self._points[key] = self._upload(mesh, slot, density, box)
        points = self._points[key]
        return points if points.points.count else None

    def _upload(self, mesh: Mesh, slot: SlotRange, density: float, box: Float64Array | None) -> _PointBuffers:
        points = surface_points(mesh, slot, density, box)
        arrays = (
            (points.positions, "3f", "in_position"),
            (points.normals, "3f", "in_normal"),
            (points.uvs, "2f", "in_uv"),
            (points.uv_scale, "1f", "in_uv_scale"),
            (points.colors, "4f", "in_color"),
            (points.reaches[:, 0], "4f1", "in_reach_low"),
            (points.reaches[:, 1], "4f1", "in_reach_high"),
        )
        if points.count == 0:
            return _PointBuffers(points, [])
        context = self._device.context
        held = [
            (context.buffer(np.ascontiguousarray(array)), layout, name)
            for array, layout, name in arrays
            if array is not None
        ]
        return _PointBuffers(points, held)

    def _find_planes(self, textures: GridTextures) -> None:
        sums = (*ADDED_UP, *GREATEST)
        spec = self._planes.spec("radiance_grid/planes.frag", samplers=(*sums, "face_places"))
        textures.places.use(len(sums))
        for unit, name in enumerate(sums):
            textures.texture(name).use(unit)
        framebuffer = textures.framebuffer("planes", "points", "albedo", "emission")
        whole = (0, textures.faces.count)
        self._planes.draw(spec, framebuffer, whole, face_uniforms(textures.levels, np.zeros(3), whole))


def points_program(defines: frozenset[str]) -> ProgramSpec:
    """The program that draws points of a kind of material."""
    return ProgramSpec(
        vertex="radiance_grid/points.vert",
        fragment="radiance_grid/points.frag",
        defines=defines | GRID_DEFINES | {f"LARGEST_REFLECTANCE {LARGEST_REFLECTANCE}", f"REACH {REACH}"},
        blocks=(GRID_POINTS_UNIFORMS, MATERIAL_UNIFORMS),
        samplers=("grid_cells", "base_color_texture"),
    )


def fill_variants() -> Iterator[ProgramSpec]:
    """Every program that fills the grid."""
    yield face_program("radiance_grid/planes.frag", (FACE_UNIFORMS,), frozenset(), ())
    for surface, purpose in product(SURFACES, ((), ("OCCUPANCY",), ("EMISSION",))):
        yield points_program(surface | frozenset(purpose))


def unsampled_emission(scene: Scene, draw: Draw, sampled: Mapping[str, MeshLight]) -> Float32Array | None:
    """(N, 2) float32 in drawing order: 1 where an instance's front and back emit light that no light is sampled for.

    `sampled`: emissive surfaces that are lights, by key. None where the draw's material emits nothing.
    """
    batch, mesh = draw.batch, scene.meshes[draw.batch.mesh]
    slot = next(slot for slot in mesh.slots if 3 * slot.first == draw.first_index)
    if not scene.materials[batch.materials[min(slot.slot, len(batch.materials) - 1)]].is_emissive:
        return None
    glow = np.ones((batch.count, 2), np.float32)
    for row, identity in enumerate(batch.ids.tolist()):
        light = sampled.get(f"{batch.key}/{slot.slot}/{identity}")
        if light is not None:
            glow[row] = (not light.front, not light.back)
    return glow[drawing_order(batch)]


def _largest_scale(matrices: Float64Array) -> float:
    """How many times longer than in object space anything is, at most, in any of the instances."""
    return float(np.linalg.norm(matrices[:, :3, :3], axis=1).max())


def _object_box(mesh: Mesh, matrices: Float64Array, level: GridLevel) -> Float64Array | None:
    """(2, 3) what of object space a level holds of a mesh's only instance; None where all of the mesh is needed."""
    if len(matrices) > 1:
        return None
    bounds = level.bounds
    inverse = np.linalg.pinv(matrices[0, :3, :3])
    corners = np.stack(np.meshgrid(*bounds.T, indexing="ij"), axis=-1).reshape(-1, 3) - matrices[0, :3, 3]
    placed = corners @ inverse.T
    low, high = placed.min(axis=0), placed.max(axis=0)
    if (mesh.bounds[0] >= low).all() and (mesh.bounds[1] <= high).all():
        return None
    return np.stack([low, high])
