# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow maps of what lights the current sample, each drawn from the very point that the light is sampled at."""

from collections.abc import Hashable, Iterator
from dataclasses import dataclass

import moderngl
import numpy as np

from ...scene.arrays import Float32Array, Int64Array
from ..atlas import Slot
from ..caster_clusters import CasterClusters
from ..casters import CasterList, Casters
from ..device import Device
from ..draws import MATERIAL_UNIFORMS, SceneDraws
from ..frustum import frustum_planes
from ..geometry import OtherTimes, split_float64
from ..layout import DEPTH_TILES_TARGET, TILE_SIZE
from ..light_table import as_texels
from ..plan import PlannedPass
from ..programs import ProgramSpec
from ..readback import read_target
from ..receivers import Receivers, visible_receivers
from ..shadow_sources import ShadowSource, shadow_sources
from ..shadow_store import ShadowStore
from ..shadow_table import SHADOW_CUBE, empty_row, shadow_row
from ..shadow_views import SMALLEST_SIZE, ShadowMap
from ..uniforms import UniformBlock
from .base import Frame, ShadowTextures, UniformBuffer
from .rasterize import FRAGMENT_DEPTH

SHADOW_MAPS_UNIFORMS = UniformBlock(
    "ShadowMapsUniforms",
    (
        ("clip_from_relative", "mat4"),
        ("forward", "vec4"),
        ("light_high", "vec4"),  # where the map is seen from, as two float32 parts
        ("light_low", "vec4"),
        ("clip_start", "float"),
        ("clip_end", "float"),
        ("alpha_threshold", "float"),
        ("texel", "float"),  # width of one at distance 1, orthographic: m
        ("orthographic", "int"),
    ),
)

_PIERCED = "ALPHA_TEST"
_VIEW_BINDING, _MATERIAL_BINDING = 0, 1


@dataclass(frozen=True)
class _View:
    """A map with the indices of the casters that it sees, none of which has a corner farther from its camera than
    `extent` (m). Equal keys are equal maps, whenever they are drawn."""

    shadow_map: ShadowMap
    seen: Int64Array
    extent: float
    key: Hashable


class ShadowMapsPass:
    """Draws the shadow maps that are not there yet."""

    name = "shadow_maps"

    def __init__(self, device: Device) -> None:
        self._device = device
        self._store = ShadowStore(device)
        self._uniforms = UniformBuffer(device, SHADOW_MAPS_UNIFORMS)
        self._casters = CasterList()
        self._clusters = CasterClusters()
        self._receivers: Receivers | None = None
        self._sources: tuple[ShadowSource, ...] = ()
        self._views: dict[int, dict[tuple[int, float], tuple[_View | None, ...]]] = {}
        self._largest = 0
        self._rows: dict[tuple[Hashable, Slot], Float32Array] = {}
        self._table: moderngl.Texture | None = None

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """With and without alpha test, and without 0…1 clip space."""
        for depth in (frozenset[str](), frozenset({FRAGMENT_DEPTH})):
            yield _program(depth)
            yield _program(depth | {_PIERCED})

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """A new view begins: nothing is known of what it sees yet, but maps of the last one may be of use."""
        settings = frame.settings
        self._store.begin_view(settings.shadow_map_size, settings.shadow_memory << 20, comes_round=frame.continuous)
        self._receivers = None

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Have the maps of this sample, and write where they are."""
        draws = frame.draws.of(frame.scene)
        casters = self._casters.of(draws)
        if self._receivers is None:
            self._receivers = self.find_receivers(frame)
            self._sources = shadow_sources(frame.lighting.plan)
            self._views = {}
            self._rows = {}
            self._largest = frame.settings.shadow_map_size
        views = self._current_views(frame, casters, self._receivers)
        sizes = {view.key: view.shadow_map.size for maps in views.values() for view in maps if view is not None}
        slots, fresh = self._store.place(sizes)
        try:
            self._draw_fresh(frame, draws, casters, views, slots, fresh)
        except BaseException:
            self._store.forget(fresh)
            raise
        self._write_table(frame, views, slots)

    def find_receivers(self, frame: Frame) -> Receivers:
        """What shadows fall on: what the camera sees."""
        tiles = read_target(frame.pool, DEPTH_TILES_TARGET)
        return visible_receivers(tiles, TILE_SIZE, frame.view, frame.pool.size, frame.settings.filter_radius)

    def release(self) -> None:
        """Free the maps and what they are drawn with."""
        self._store.release()
        self._uniforms.release()
        if self._table is not None:
            self._table.release()

    def _current_views(
        self, frame: Frame, casters: Casters, receivers: Receivers
    ) -> dict[int, tuple[_View | None, ...]]:
        """The maps of every source by its index; smaller ones where all of them do not fit into the memory."""
        while True:
            for source in self._sources:
                self._update(frame, source, casters, receivers)
            lit = [source.index for source in self._sources if self._is_lit(frame, source)]
            views = {index: self._views[index][frame.lighting.state(index)] for index in lit}
            texels = sum(view.shadow_map.size**2 for maps in views.values() for view in maps if view is not None)
            if texels <= self._store.capacity or self._largest <= SMALLEST_SIZE:
                return views
            self._largest //= 2
            self._views = {}

    @staticmethod
    def _is_lit(frame: Frame, source: ShadowSource) -> bool:
        return source.index < frame.lighting.count

    def _update(self, frame: Frame, source: ShadowSource, casters: Casters, receivers: Receivers) -> None:
        """Look from a source's point of this sample as far as it reaches, unless that is known from before."""
        number, reach = state = frame.lighting.state(source.index)
        held = self._views.setdefault(source.index, {})
        if not self._is_lit(frame, source) or state in held:
            return
        if any(other != number for other, _ in held):
            held.clear()
        point = frame.lighting.points[source.index]
        maps = source.maps(point, receivers, casters.bounds, self._largest, reach)
        held[state] = tuple(_view(item, casters, source.blocker_groups) for item in maps)

    def _draw_fresh(
        self,
        frame: Frame,
        draws: SceneDraws,
        casters: Casters,
        views: dict[int, tuple[_View | None, ...]],
        slots: dict[Hashable, Slot],
        fresh: set[Hashable],
    ) -> None:
        missing = {view.key: view for maps in views.values() for view in maps if view is not None and view.key in fresh}
        if not missing:
            return
        context = self._device.context
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = ">"
        self._clusters.begin(casters.draws, draws.scene.meshes)
        for key, view in missing.items():
            self._store.target(slots[key]).use()
            self._device.raw.clear_color_uint(0, 0)
            self._device.raw.clear_depth(0.0)
            self._draw(frame, draws, casters, view)
        context.clear_samplers()

    def _draw(self, frame: Frame, draws: SceneDraws, casters: Casters, view: _View) -> None:
        self._bind(view.shadow_map, frame.settings.alpha_threshold)
        depth = frozenset[str](() if self._device.zero_to_one_depth else {FRAGMENT_DEPTH})
        for part in self._clusters.seen(view.seen, frustum_planes(view.shadow_map.camera)):
            draw = casters.draws[part.caster]
            program = self._device.programs.get(_program(depth | draw.surface & {_PIERCED}))
            if draw.texture is not None and _PIERCED in draw.surface:
                frame.images.use(draw.texture, 0)
                draws.bind_material(draw, _MATERIAL_BINDING)
            vertex_array = frame.geometry.vertex_array(
                frame.scene, draw.batch, program, OtherTimes(), 1, part.triangles
            )
            for first, count in part.runs:
                vertex_array.render(moderngl.TRIANGLES, vertices=count, first=first, instances=draw.batch.count)

    def _bind(self, shadow_map: ShadowMap, alpha_threshold: float) -> None:
        camera = shadow_map.camera
        camera_from_relative = np.eye(4)
        camera_from_relative[:3, :3] = camera.rotation.T
        projection = camera.projection(zero_to_one_depth=self._device.zero_to_one_depth)
        high, low = split_float64(camera.position)
        self._uniforms.bind(
            _VIEW_BINDING,
            clip_from_relative=projection @ camera_from_relative,
            forward=(*-camera.rotation[:, 2], 0.0),
            light_high=(*high, 0.0),
            light_low=(*low, 0.0),
            clip_start=camera.clip_start,
            clip_end=camera.clip_end,
            alpha_threshold=alpha_threshold,
            texel=(camera.window[1] - camera.window[0]) / shadow_map.size,
            orthographic=int(camera.orthographic),
        )

    def _write_table(
        self, frame: Frame, views: dict[int, tuple[_View | None, ...]], slots: dict[Hashable, Slot]
    ) -> None:
        rows = [empty_row()]
        held, self._rows = self._rows, {}
        for source in self._sources:
            maps = views.get(source.index, ())
            frame.lighting.samples[source.index, 0, 3] = SHADOW_CUBE if maps and source.is_cube else len(maps)
            frame.lighting.samples[source.index, 1, 3] = len(rows)
            for view in maps:
                if view is None:
                    rows.append(empty_row())
                    continue
                place = view.key, slots[view.key]
                row = held.get(place)
                if row is None:
                    row = shadow_row(view.shadow_map.camera, slots[view.key], frame.view.position, view.extent)
                self._rows[place] = row
                rows.append(row)
        image = as_texels(np.stack(rows))
        size = (image.shape[1], image.shape[0])
        if self._table is None or self._table.size != size:
            if self._table is not None:
                self._table.release()
            self._table = self._device.context.texture(size, 4, dtype="f4")
            self._table.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._table.write(image)
        store = self._store
        frame.shadows = ShadowTextures(store.texture, self._table, store.drawn, store.kept, store.bytes())


def _view(shadow_map: ShadowMap | None, casters: Casters, blocker_groups: int) -> _View | None:
    """What a map sees; None where that is nothing, so that there need be no map."""
    if shadow_map is None:
        return None
    camera = shadow_map.camera
    seen = casters.seen(camera, blocker_groups)
    if len(seen) == 0:
        return None
    pose = camera.world_from_camera.tobytes()
    optics = (camera.window, camera.clip_start, camera.clip_end, camera.orthographic)
    farthest = np.abs(casters.bounds[seen] - camera.position).max(axis=1)
    extent = float(np.linalg.norm(farthest, axis=-1).max())
    return _View(shadow_map, seen, extent, (pose, optics, shadow_map.size, casters.versions[seen].tobytes()))


def _program(defines: frozenset[str]) -> ProgramSpec:
    return ProgramSpec(
        vertex="shadow_maps/shadow_maps.vert",
        fragment="shadow_maps/shadow_maps.frag",
        defines=defines,
        blocks=(SHADOW_MAPS_UNIFORMS, MATERIAL_UNIFORMS),
        samplers=("base_color_texture",),
    )
