# SPDX-License-Identifier: GPL-3.0-or-later
"""What passes that rasterise geometry share: their program variants, their uniforms and the drawing itself."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import log2

import moderngl
import numpy as np

from ...scene import Camera, Layering, Moment
from ...scene.arrays import Float64Array
from ..device import Device
from ..draws import MATERIAL_UNIFORMS, SceneDraws
from ..geometry import OtherTimes, split_float64
from ..layout import CHANNELS, EXIT_CHANNELS, GBufferChannel, outputs_glsl
from ..plan import PlannedPass
from ..programs import ProgramSpec
from ..raw_gl import CLIP_DISTANCE0
from ..uniforms import UniformBlock
from .base import Frame, UniformBuffer, subsets

_EYE = (
    ("clip_from_relative", "mat4"),
    ("forward", "vec4"),
    ("camera_high", "vec4"),  # the camera's position as two float32 parts
    ("camera_low", "vec4"),
)

GBUFFER_UNIFORMS = UniformBlock(
    "GBufferUniforms",
    (
        *_EYE,
        *((f"previous_{name}", glsl_type) for name, glsl_type in _EYE),
        *((f"next_{name}", glsl_type) for name, glsl_type in _EYE),
        ("resolution", "vec2"),
        ("oracle_drift", "float"),  # pixels, at most 1, that surfaces may have moved since the oracle saw them
        ("oracle_snapping", "float"),  # pixels between vertices that two frames snap to the sub-pixel grid
        ("minimum_separation", "float"),  # m
        ("relative_separation", "float"),  # share of the nearer layer's view depth
        ("clip_start", "float"),
        ("clip_end", "float"),
        ("alpha_threshold", "float"),
        ("texture_lod_bias", "float"),
        ("image_handedness", "float"),  # −1 where the window mirrors the picture
        ("orthographic", "int"),
        ("first_layer", "int"),  # of those that one pass reaches
        ("layer_count", "int"),
        ("look_ahead_layer", "int"),  # the one that shows the next picture's depth, −1 for none
        ("oracle_layer_offset", "int"),  # from a layer's number back to that of its oracle
    ),
)

FRAGMENT_DEPTH = "FRAGMENT_DEPTH"
"""Define where the driver has no 0…1 clip space (macOS): its own depth would round far surfaces together."""

_SAMPLERS = ("base_color_texture", "oracle", "previous_poses", "next_poses")
_FRAME_BINDING, _MATERIAL_BINDING = 0, 1


@dataclass(frozen=True)
class GeometryProgram:
    """How a pass draws geometry, whatever the material.

    `channels` it writes. `layers` that one pass reaches, the way `layering` says. `defines`:
    ORACLE: discard what is too near the layer before; DRIFT: allow for what moved since the oracle was drawn;
    REPROJECT: judge a fragment by where it was in the previous frame. EXIT: keep back faces behind the finished layers.
    LOOK_AHEAD: the last layer shows the next picture. PREVIOUS_POSE, NEXT_POSE: instances or vertices may be elsewhere
    in that frame, not the camera alone.
    """

    channels: tuple[GBufferChannel, ...]
    defines: frozenset[str] = frozenset()
    layers: int = 1
    layering: Layering = Layering.VERTEX_SHADER

    @property
    def reads_previous(self) -> bool:
        """Whether it needs each vertex's place in the previous frame."""
        return "REPROJECT" in self.defines or any(channel.name == "motion" for channel in self.channels)

    @property
    def copies(self) -> int:
        """How often each instance is drawn in a row."""
        return self.layers if self.layering is Layering.VERTEX_SHADER else 1

    def spec(self, surface: frozenset[str], depth: frozenset[str]) -> ProgramSpec:
        """The program for a material's `surface` defines; `depth` may add FRAGMENT_DEPTH."""
        defines = {*self.defines, *surface, *depth, *(f"WRITE_{channel.name.upper()}" for channel in self.channels)}
        if self.reads_previous:
            defines.add("PREVIOUS")
        geometry = None
        if self.layering is Layering.GEOMETRY_SHADER:
            defines |= {f"GEOMETRY_LAYERS {self.layers}", f"GEOMETRY_VERTICES {3 * self.layers}"}
            geometry = "gbuffer/gbuffer.geom"
        elif self.layers > 1:
            defines.add("VERTEX_LAYER")
        return ProgramSpec(
            vertex="gbuffer/gbuffer.vert",
            geometry=geometry,
            fragment="gbuffer/gbuffer.frag",
            defines=frozenset(defines),
            blocks=(GBUFFER_UNIFORMS, MATERIAL_UNIFORMS),
            samplers=_SAMPLERS,
            generated=(("outputs", outputs_glsl(self.channels)),),
        )


@dataclass(frozen=True)
class GeometryView:
    """One pass over the geometry: what it sees and where it draws.

    `moment`: whose geometry is drawn, through which camera. `targets` that the program writes: their layer `into`, or
    all their layers where that is None. `first_layer`: which layer of the deep G-buffer comes first.
    `oracle`: what the program tests against; that of layer k is its layer k − `oracle_layer_offset`.
    `oracle_drift`: pixels, at most 1, that surfaces may have moved since it saw them.
    `previous`, `following`: the other frames that the program needs.
    """

    moment: Moment
    program: GeometryProgram
    targets: tuple[str, ...]
    into: int | None = None
    first_layer: int = 0
    oracle: moderngl.TextureArray | None = None
    oracle_layer_offset: int = 1
    oracle_drift: float = 0.0
    previous: Moment | None = None
    following: Moment | None = None


class Rasterizer:
    """Draws geometry into layers."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._uniforms = UniformBuffer(device, GBUFFER_UNIFORMS)
        self._depth = frozenset[str](() if device.zero_to_one_depth else {FRAGMENT_DEPTH})

    def draw(self, frame: Frame, view: GeometryView) -> None:
        """Clear the targets and draw every triangle of the view's scene once."""
        context = self._device.context
        if view.into is None:
            frame.pool.layered_framebuffer(view.targets).use()
            frame.pool.clear(view.targets, depth=True)
        else:
            attachments = tuple((name, view.into) for name in view.targets)
            frame.pool.framebuffer(attachments, depth=True).use()
            frame.pool.clear(attachments, depth=True)
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = ">"
        self._bind(frame, view)
        context.enable_direct(CLIP_DISTANCE0)
        try:
            self._draw_all(frame, view, frame.draws.of(view.moment.scene))
        finally:
            context.clear_samplers()
            context.disable_direct(CLIP_DISTANCE0)

    def release(self) -> None:
        """Free the uniforms."""
        self._uniforms.release()

    def _draw_all(self, frame: Frame, view: GeometryView, scene_draws: SceneDraws) -> None:
        program = view.program
        previous = following = None
        if view.previous and program.reads_previous and view.previous.scene is not view.moment.scene:
            previous = frame.correspondence(view.previous.scene)
        if view.following and view.following.scene is not view.moment.scene:
            following = frame.correspondence(view.following.scene)
        poses = {*(("PREVIOUS_POSE",) if previous else ()), *(("NEXT_POSE",) if following else ())}
        program = replace(program, defines=program.defines | poses)
        times = OtherTimes(previous, following)
        surfaces = {draw.surface for draw in scene_draws.seen}
        programs = {surface: self._device.programs.get(program.spec(surface, self._depth)) for surface in surfaces}
        for draw in scene_draws.seen:
            compiled = programs[draw.surface]
            scene_draws.bind_material(draw, _MATERIAL_BINDING)
            if draw.texture is not None:
                frame.images.use(draw.texture, _SAMPLERS.index("base_color_texture"))
            for other, sampler in ((previous, "previous_poses"), (following, "next_poses")):
                if other is not None:
                    frame.geometry.poses(draw.batch, other).use(_SAMPLERS.index(sampler))
            vertex_array = frame.geometry.vertex_array(scene_draws.scene, draw.batch, compiled, times, program.copies)
            vertex_array.render(
                moderngl.TRIANGLES,
                vertices=draw.index_count,
                first=draw.first_index,
                instances=draw.batch.count * program.copies,
            )

    def _bind(self, frame: Frame, view: GeometryView) -> None:
        if view.oracle is not None:
            view.oracle.use(_SAMPLERS.index("oracle"))
        camera = view.moment.camera
        settings, program = frame.settings, view.program
        separation = settings.minimum_separation
        self._uniforms.bind(
            _FRAME_BINDING,
            **self._eye("", camera),
            **self._eye("previous_", view.previous.camera if view.previous else camera),
            **self._eye("next_", view.following.camera if view.following else camera),
            resolution=frame.pool.size,
            oracle_drift=view.oracle_drift,
            oracle_snapping=2.0 * self._device.subpixel if view.oracle_drift > 0.0 else 0.0,
            minimum_separation=0.0 if settings.relative_separation else separation,
            relative_separation=separation if settings.relative_separation else 0.0,
            clip_start=camera.clip_start,
            clip_end=camera.clip_end,
            alpha_threshold=settings.alpha_threshold,
            # N accumulated samples resolve √N times finer than one.
            texture_lod_bias=-0.5 * log2(max(settings.samples, 1)),
            image_handedness=1.0 if camera.window[1] > camera.window[0] else -1.0,
            orthographic=int(camera.orthographic),
            first_layer=view.first_layer,
            layer_count=program.layers,
            look_ahead_layer=program.layers - 1 if "LOOK_AHEAD" in program.defines else -1,
            oracle_layer_offset=view.oracle_layer_offset,
        )

    def _eye(self, prefix: str, camera: Camera) -> dict[str, object]:
        """The uniforms that place a point for a camera."""
        camera_from_relative = np.eye(4)
        camera_from_relative[:3, :3] = camera.rotation.T
        projection = camera.projection(zero_to_one_depth=self._device.zero_to_one_depth)
        high, low = split_float64(camera.position)
        values: dict[str, Float64Array | tuple[float, ...]] = {
            "clip_from_relative": projection @ camera_from_relative,
            "forward": (*-camera.rotation[:, 2], 0.0),
            "camera_high": (*high, 0.0),
            "camera_low": (*low, 0.0),
        }
        return {f"{prefix}{name}": value for name, value in values.items()}


class GeometryPass:
    """What passes that rasterise geometry have in common: draws and buffers are the view's, nothing is prepared."""

    def __init__(self, device: Device) -> None:
        self._rasterizer = Rasterizer(device)

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """Those of the G-buffer pass are everybody's."""
        yield from ()

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """Nothing."""

    def release(self) -> None:
        """Free the pass's uniforms."""
        self._rasterizer.release()


SURFACES = tuple(frozenset(names) for names in ((), ("TEXTURE",), ("TEXTURE", "ALPHA_TEST"), ("ATTRIBUTE",)))
"""The kinds of material, as defines."""


def geometry_variants() -> Iterator[ProgramSpec]:
    """Programs that hold every source of every stage that a plan can ask for.

    First each kind of fragment, then each way in which vertices reach the layers. How many layers there are only
    bounds a loop of the geometry shader: the fewest and the most stand for all.
    """
    depths = (frozenset[str](), frozenset({FRAGMENT_DEPTH}))
    tests = ((), ("ORACLE",), ("ORACLE", "DRIFT"), ("ORACLE", "REPROJECT"))
    view_depth, *optional = CHANNELS
    for channels in subsets(channel.name for channel in optional):
        written = (view_depth, *(channel for channel in optional if channel.name in channels))
        for test, surface, depth in product(tests, SURFACES, depths):
            yield GeometryProgram(written, frozenset(test)).spec(surface, depth)
    for surface, depth in product(SURFACES, depths):
        yield GeometryProgram(EXIT_CHANNELS, frozenset({"EXIT"})).spec(surface, depth)
    by_vertex = [channel for channel in optional if channel.name in ("normal", "material", "object_index", "motion")]
    poses = subsets(("PREVIOUS_POSE", "NEXT_POSE"))
    vertices = [frozenset({"EXIT"}), *poses, *(frozenset({"LOOK_AHEAD"}) | pose for pose in poses)]
    ways = ((2, Layering.VERTEX_SHADER), *((layers, Layering.GEOMETRY_SHADER) for layers in (1, 2, 9)))
    for names, defines, surface, (layers, layering) in product(
        subsets(channel.name for channel in by_vertex), vertices, SURFACES, ways
    ):
        written = (view_depth, *(channel for channel in by_vertex if channel.name in names))
        yield GeometryProgram(written, defines, layers, layering).spec(surface, frozenset())
