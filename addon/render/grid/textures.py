# SPDX-License-Identifier: GPL-3.0-or-later
"""The radiance grid's cells and faces on the GPU, and what draws into them."""

from collections.abc import Callable, Hashable, Sequence

import moderngl
import numpy as np

from ...scene.arrays import Float64Array, UInt32Array
from ..device import Device, RenderError
from ..passes.base import UniformBuffer
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .faces import FACES_PER_ROW, Faces
from .levels import MOST_LEVELS, GridLevel

GRID_UNIFORMS = (
    (
        "grid_origins",
        f"vec4[{MOST_LEVELS}]",
    ),  # of each level its lowest corner, camera-relative, and its cells' side, m
    ("grid_sizes", f"vec4[{MOST_LEVELS}]"),  # cells along its sides, and below it in the table
    ("grid_reach", "float"),  # cells that a ray goes through a level before it changes to the next
    ("grid_level_count", "int"),
)
"""Fields that a pass adds to its block to include `common/radiance_grid.glsl`."""

FACE_UNIFORMS = UniformBlock(
    "FaceUniforms",
    (
        *GRID_UNIFORMS,
        ("share", "float"),  # of what is added up
        ("first_face", "int"),  # of those that are drawn
        ("end_face", "int"),  # the one after the last
        ("ray", "int"),
        ("ray_count", "int"),
    ),
)
"""What passes over the faces read."""

GRID_DEFINES = frozenset({f"FACES_PER_ROW {FACES_PER_ROW}"})
"""Defines that `common/radiance_grid.glsl` needs."""

REACH = 32.0
"""Cells that a ray goes through a level before it changes to the next. Measured at 8, 16 and 32: Cornell's FLIP .087,
.085, .082, Sponza's .095 throughout, in the same time."""

ADDED_UP = ("sum_base_color", "sum_offset", "sum_normal", "sum_emission")
"""What is added up of the points that show a face their front, each times the area it stands for. The first has the
area's sum as alpha, the others what the points' backs emit: red, green and blue."""

GREATEST = ("most", "least")
"""The greatest of ½ plus and of ½ minus the points' offsets from the cell's centre, cells; as alpha, of the channels
that their fronts and their backs emit."""

SUMS = (*ADDED_UP, *GREATEST)

_FLOATS = 4
_FACE_TEXTURES = (
    *SUMS,
    "points",
    "albedo",
    "emission",
    "direct",
    "first",
    "indirect",
    "radiance",
    "next_indirect",
    "next_radiance",
)
_BYTES_PER_FACE = 4 * _FLOATS * (len(_FACE_TEXTURES) + 1) + 12


def bytes_per_face(cell_rays: int) -> int:
    """Graphics memory of a face from which so many rays bring light."""
    return _BYTES_PER_FACE + 4 * cell_rays


class GridTextures:
    """The textures of one grid. `levels`, `faces`: what is in them. `sources`: R32UI, see `take_from`."""

    def __init__(self, device: Device, levels: tuple[GridLevel, ...], faces: Faces, cell_rays: int) -> None:
        """Raises RenderError where graphics memory does not suffice."""
        context = device.context
        self._device = device
        self.levels, self.faces, self.cell_rays = levels, faces, cell_rays
        table = faces.table
        self.cells = context.texture3d(table.shape[::-1], 1, np.ascontiguousarray(table), dtype="u4")
        self.cells.filter = (moderngl.NEAREST, moderngl.NEAREST)
        size = (FACES_PER_ROW, faces.rows)
        places = np.zeros((faces.rows * FACES_PER_ROW, 2), np.uint32)
        places[: faces.count] = faces.places
        self.places = context.texture(size, 2, places, dtype="u4")
        self.places.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._taken = np.zeros(faces.count, np.uint32)
        self.sources = self._numbers(_in_rows(self._taken, faces.rows))
        self._faces = {name: context.texture(size, _FLOATS, dtype="f4") for name in _FACE_TEXTURES}
        self._faces["planes"] = context.texture(size, _FLOATS, dtype="u4")
        for texture in self._faces.values():
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.links = context.texture_array((*size, cell_rays), 1, dtype="u4")
        self.links.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._framebuffers: dict[Hashable, moderngl.Framebuffer] = {}
        self.bytes = table.nbytes + faces.rows * FACES_PER_ROW * bytes_per_face(cell_rays)
        try:
            device.check_upload(f"the radiance grid of {faces.count} faces", self.bytes)
        except RenderError:
            self.release()
            raise

    def take_from(self, sources: UInt32Array) -> None:
        """Say of which of an earlier grid's faces each face has its surface: (N,) its number plus 1, 0 for none."""
        self._taken = sources
        self.sources.write(_in_rows(sources, self.faces.rows))

    def places_of(self, before: "GridTextures") -> moderngl.Texture:
        """R32UI: which face each of an earlier grid's became, its number plus 1, 0 for none. The caller frees it."""
        taken = np.flatnonzero(self._taken)
        become = np.zeros(before.faces.count, np.uint32)
        become[self._taken[taken] - 1] = taken + 1
        return self._numbers(_in_rows(become, before.faces.rows))

    def _numbers(self, numbers: UInt32Array) -> moderngl.Texture:
        size = (FACES_PER_ROW, len(numbers) // FACES_PER_ROW)
        texture = self._device.context.texture(size, 1, numbers, dtype="u4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    def texture(self, name: str) -> moderngl.Texture:
        """One of the faces' textures, `FACES_PER_ROW` texels wide: RGBA32F, "planes" RGBA32UI."""
        return self._faces[name]

    def exchange(self, *names: str) -> None:
        """Let each texture change places with the one of the same name that begins with `next_`."""
        for name in names:
            following = f"next_{name}"
            self._faces[name], self._faces[following] = self._faces[following], self._faces[name]

    def framebuffer(self, *names: str) -> moderngl.Framebuffer:
        """What draws into faces' textures."""
        textures = [self._faces[name] for name in names]
        return self._framebuffer(tuple(map(id, textures)), lambda: self._device.context.framebuffer(textures))

    def link_framebuffer(self, ray: int) -> moderngl.Framebuffer:
        """What draws into the links of one ray of every face."""

        def make() -> moderngl.Framebuffer:
            framebuffer = self._device.context.framebuffer([self.links])
            self._device.raw.attach_layers(framebuffer, [(self.links, ray)], None)
            return framebuffer

        return self._framebuffer(("links", ray), make)

    def _framebuffer(self, key: Hashable, make: Callable[[], moderngl.Framebuffer]) -> moderngl.Framebuffer:
        if key not in self._framebuffers:
            self._framebuffers[key] = make()
        return self._framebuffers[key]

    def release(self) -> None:
        """Free everything."""
        self._device.no_framebuffer.use()
        for framebuffer in self._framebuffers.values():
            framebuffer.release()
        self._framebuffers.clear()
        for texture in (self.cells, self.places, self.sources, self.links, *self._faces.values()):
            texture.release()


def _in_rows(numbers: UInt32Array, rows: int) -> UInt32Array:
    """One number per face, filled up with zeros to whole rows."""
    padded = np.zeros(rows * FACES_PER_ROW, np.uint32)
    padded[: len(numbers)] = numbers
    return padded


def grid_uniforms(levels: Sequence[GridLevel], origin: Float64Array) -> dict[str, object]:
    """Values of `GRID_UNIFORMS` for positions relative to `origin` (3,), world space."""
    origins, sizes = np.zeros((MOST_LEVELS, 4)), np.zeros((MOST_LEVELS, 4))
    bottom = 0
    for index, level in enumerate(levels):
        origins[index] = (*(level.origin - origin), level.cell)
        sizes[index] = (*level.size, bottom)
        bottom += level.size[2]
    return {
        "grid_origins": origins,
        "grid_sizes": sizes,
        "grid_reach": REACH,
        "grid_level_count": len(levels),
    }


def face_program(
    fragment: str, blocks: tuple[UniformBlock, ...], defines: frozenset[str], samplers: tuple[str, ...]
) -> ProgramSpec:
    """The program of a fragment shader that is run for every face."""
    return ProgramSpec("common/fullscreen.vert", fragment, defines | GRID_DEFINES, blocks=blocks, samplers=samplers)


def face_uniforms(
    levels: Sequence[GridLevel],
    origin: Float64Array,
    faces: tuple[int, int],
    *,
    ray: int = 0,
    ray_count: int = 0,
    share: float = 1.0,
) -> dict[str, object]:
    """Values of `FACE_UNIFORMS` to draw faces `faces[0]` … `faces[1] − 1`."""
    return {
        **grid_uniforms(levels, origin),
        "share": share,
        "first_face": faces[0],
        "end_face": faces[1],
        "ray": ray,
        "ray_count": ray_count,
    }


class FaceDraw:
    """Draws one triangle over the texels of some faces."""

    def __init__(self, device: Device, *blocks: UniformBlock) -> None:
        self._device = device
        self._blocks = blocks
        self._buffers = [UniformBuffer(device, block) for block in blocks]
        self._vertex_arrays: dict[ProgramSpec, moderngl.VertexArray] = {}

    def spec(self, fragment: str, defines: frozenset[str] = frozenset(), samplers: tuple[str, ...] = ()) -> ProgramSpec:
        """The program of a fragment shader."""
        return face_program(fragment, self._blocks, defines, samplers)

    def draw(
        self,
        spec: ProgramSpec,
        framebuffer: moderngl.Framebuffer,
        faces: tuple[int, int],
        *uniforms: dict[str, object],
    ) -> None:
        """Draw the texels of faces `faces[0]` … `faces[1] − 1`; of others in their rows the shader keeps away."""
        first, end = faces[0] // FACES_PER_ROW, -(-faces[1] // FACES_PER_ROW)
        if end <= first:
            return
        if spec not in self._vertex_arrays:
            self._vertex_arrays[spec] = self._device.context.vertex_array(self._device.programs.get(spec), [])
        for binding, (buffer, values) in enumerate(zip(self._buffers, uniforms, strict=True)):
            buffer.bind(binding, **values)
        framebuffer.viewport = (0, first, FACES_PER_ROW, end - first)
        framebuffer.use()
        self._vertex_arrays[spec].render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Free the buffers and vertex arrays."""
        for buffer in self._buffers:
            buffer.release()
        for vertex_array in self._vertex_arrays.values():
            vertex_array.release()
        self._vertex_arrays.clear()
