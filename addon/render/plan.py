# SPDX-License-Identifier: GPL-3.0-or-later
"""Which passes a scene needs, and why the others are left out. Pure: no OpenGL, no Blender."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import inf

from ..scene import Camera, Channel, DebugView, RenderSettings, Scene, ShadingModel, Variant
from .indirect_plan import (
    INDIRECT_DEBUG_VIEWS,
    INDIRECT_PASSES,
    IRRADIANCE_TARGET,
    ORIGIN_TARGET,
    IndirectNeeds,
    indirect_needs,
    plan_indirect,
    reads_layers,
)
from .layout import CHANNELS, EXIT_CHANNELS, GBufferChannel, TargetSpec
from .lighting_passes import SHADING_PASSES, SPLIT_TARGETS, plan_lighting_passes
from .lighting_plan import LightPlan, plan_lights
from .memory import Memory
from .planned_pass import LeftOut, PlannedPass


@dataclass(frozen=True)
class Plan:
    """The passes of one sample in order, what was left out, and how the deep G-buffer is laid out.

    `layers`: how many are built, by `variant`, which is TWO_PASS for a single one. `channels`: those that somebody
    reads, each with how many layers of it, the nearest first. `look_ahead`: whether an extra layer shows the next
    picture's depth. `guard_band`: pixels around the picture, on each side. `lights`: what lights it. `indirect`: what
    its indirect light needs. `bounced_lights`: what lights the radiance grid, besides the world.
    """

    passes: tuple[PlannedPass, ...]
    left_out: tuple[LeftOut, ...]
    layers: int
    variant: Variant
    channels: tuple[tuple[GBufferChannel, int], ...]
    look_ahead: bool
    guard_band: int
    lights: LightPlan
    indirect: IndirectNeeds
    bounced_lights: LightPlan

    @property
    def one_pass(self) -> bool:
        """Whether one pass over the geometry reaches all layers."""
        return self.variant is not Variant.TWO_PASS

    @property
    def drawn_layers(self) -> int:
        """Layers that one pass over the geometry reaches; the targets it draws into have as many."""
        return self.layers + self.look_ahead if self.one_pass else 1

    def find(self, name: str) -> PlannedPass | None:
        """The planned pass of that name, or None where it was left out."""
        return next((planned for planned in self.passes if planned.name == name), None)

    @property
    def targets(self) -> tuple[TargetSpec, ...]:
        """Every texture that the passes write."""
        return tuple(target for planned in self.passes for target in planned.writes)


FIRST_SAMPLE_CHANNELS = frozenset({Channel.DEPTH, Channel.POSITION, Channel.OBJECT_INDEX})
"""Film images taken from sample 0 alone, through pixel centres: means of them are meaningless."""

MEAN_CHANNELS = frozenset(Channel) - FIRST_SAMPLE_CHANNELS - {Channel.COMBINED}
"""Film images besides COMBINED that are means over samples."""

SUM_CHANNELS = (Channel.COMBINED, *sorted(MEAN_CHANNELS))
"""Images that the composite pass adds up, in attachment order."""


def film_target(channel: Channel) -> TargetSpec:
    """The float32 RGBA target that the sum of a film image lives in."""
    return TargetSpec(f"film.{channel.value.lower()}", 4, "f4", guarded=False)


_DEBUG_TARGETS = {
    DebugView.DEPTH: "gbuffer.view_depth",
    DebugView.NORMAL: "gbuffer.normal",
    DebugView.ALBEDO: "gbuffer.base_color",
    DebugView.METALLIC: "gbuffer.material",
    DebugView.ROUGHNESS: "gbuffer.material",
    DebugView.EMISSION: "gbuffer.emission",
    DebugView.OBJECT_INDEX: "gbuffer.object_index",
    DebugView.MOTION: "gbuffer.motion",
    DebugView.EXIT_DEPTH: "exit.view_depth",
    DebugView.EXIT_NORMAL: "exit.normal",
    DebugView.EXIT_ALBEDO: "exit.base_color",
    DebugView.INDIRECT: IRRADIANCE_TARGET,
    DebugView.GRID_CELLS: ORIGIN_TARGET,
    DebugView.GRID_RADIANCE: ORIGIN_TARGET,
    DebugView.MARCH_HITS: ORIGIN_TARGET,
    DebugView.LIGHT_ORIGIN: ORIGIN_TARGET,
}

_FILM_CHANNELS = {
    Channel.DEPTH: {"view_depth"},
    Channel.NORMAL: {"view_depth", "normal"},
    Channel.POSITION: {"view_depth"},
    Channel.DIFFUSE_COLOR: {"view_depth", "normal", "base_color", "material"},
    Channel.OBJECT_INDEX: {"view_depth", "object_index"},
    Channel.GLOSSY_COLOR: {"view_depth", "normal", "base_color", "material"},
    Channel.DIFFUSE_DIRECT: {"view_depth"},
    Channel.GLOSSY_DIRECT: {"view_depth"},
    Channel.EMISSION: {"view_depth", "emission"},
    Channel.ENVIRONMENT: {"view_depth"},
    Channel.DIFFUSE_INDIRECT: {"view_depth", "normal", "base_color", "material"},
}


def plan(
    scene: Scene,
    settings: RenderSettings,
    camera: Camera | None = None,
    *,
    continuous: bool = False,
    memory: Memory | None = None,
) -> Plan:
    """Decide the passes for one scene, seen by a camera (None: it may be anywhere), and one set of settings.

    `continuous` as in `Sequence`. `memory` of earlier plans makes this one faster.
    """
    left_out: list[LeftOut] = []
    indirect = indirect_needs(scene, settings, left_out)
    layers = _layer_count(settings, indirect, left_out)
    variant = settings.variant if layers > 1 else Variant.TWO_PASS
    look_ahead = _looks_ahead(variant, settings, continuous=continuous)
    guard_band = _plan_guard_band(settings, variant, indirect, left_out)
    view = camera and guarded(camera, settings, guard_band)
    memory = memory or Memory()
    gathered = indirect.world_gathered
    lights, dark = plan_lights(scene, settings, view, memory, continuous=continuous, world_gathered=gathered)
    bounced_lights = _bounced_lights(scene, settings, indirect, memory)
    memory.forget_unused()
    left_out += [LeftOut(name, reason) for name, reason in dark]
    lighting = plan_lighting_passes(scene, settings, lights, layers, left_out, tiled=indirect.reads_grid)
    direct = next((planned for planned in lighting if planned.name in SHADING_PASSES), None)
    bounced = plan_indirect(
        scene,
        settings,
        indirect,
        left_out,
        direct=direct,
        samples_emission=bool(lights.mesh_lights),
        continuous=continuous,
    )
    channels = _read_channels(scene, settings, [*lighting, *bounced], layers, left_out)
    one_pass = variant is not Variant.TWO_PASS
    drawn_layers = layers + look_ahead if one_pass else layers
    gbuffer = PlannedPass(
        "gbuffer",
        reads=("gbuffer.oracle",) if layers > 1 else (),
        # One pass over the geometry writes every channel in every layer it reaches.
        writes=(
            *(channel.target(drawn_layers if one_pass else read) for channel, read in channels),
            *((TargetSpec(ORACLE_TARGET, 1, "f4", 1, inf),) if layers > 1 and not one_pass else ()),
        ),
    )
    passes = [
        *_plan_oracle(variant, layers, left_out, continuous=continuous),
        gbuffer,
        *_plan_exit(settings, indirect, drawn_layers, left_out),
        *lighting,
        *bounced,
        _plan_composite(scene, settings, direct, indirect, bounced),
    ]
    return Plan(
        tuple(passes),
        tuple(left_out),
        layers,
        variant,
        channels,
        look_ahead,
        guard_band,
        lights,
        indirect,
        bounced_lights,
    )


def _bounced_lights(scene: Scene, settings: RenderSettings, indirect: IndirectNeeds, memory: Memory) -> LightPlan:
    """The lights of what the camera may not see, but what it sees may be lit by; the world not among them."""
    if not indirect.reads_grid:
        return LightPlan()
    lights, _ = plan_lights(scene, settings, None, memory, continuous=False, world_gathered=True)
    casts = any(batch.casts_shadow for batch in scene.batches)
    return replace(lights, world_directions=0, preview=False, casts_shadows=casts)


def guarded(camera: Camera, settings: RenderSettings, guard_band: int) -> Camera:
    """A camera that sees `guard_band` pixels more on each side of the picture."""
    if guard_band == 0:
        return camera
    x, y = guard_band / settings.width, guard_band / settings.height
    return camera.cropped(-x, 1.0 + x, -y, 1.0 + y)


def frames_before(settings: RenderSettings) -> int:
    """How many frames before the rendered one the settings need (`Sequence.previous`, then `Sequence.earlier`)."""
    several = settings.layers if reads_layers(settings.indirect) else _layer_count(settings, IndirectNeeds(), [])
    if several > 1:
        if settings.variant is Variant.PREDICT:
            return 2
        if settings.variant in (Variant.PREVIOUS, Variant.REPROJECT):
            return 1
    reads_motion = settings.debug_view is DebugView.MOTION or (settings.deep_output and settings.motion_vectors)
    return 1 if reads_motion else 0


def _layer_count(settings: RenderSettings, indirect: IndirectNeeds, left_out: list[LeftOut]) -> int:
    if settings.deep_output:
        return settings.layers
    needed = indirect.layers
    if settings.debug_view not in INDIRECT_DEBUG_VIEWS | {DebugView.NONE}:
        needed = min(settings.debug_layer, settings.layers - 1) + 1
    if needed < settings.layers:
        unread = f"layer {needed + 1}" if needed + 1 == settings.layers else f"layers {needed + 1}–{settings.layers}"
        left_out.append(
            LeftOut(f"gbuffer {unread}", "nothing reads them: no indirect effect, layer output or debug view of them")
        )
        if needed == 1:
            left_out.append(LeftOut("minimum separation", "Δz unused: only one layer is built"))
    return needed


ORACLE_TARGET = "gbuffer.oracle"
"""View depth of the layers that the next ones are tested against."""

HISTORY_TARGET = "gbuffer.history"
"""The same, as a viewport's last view left it for the next one."""

ORACLE_SCRATCH = "gbuffer.oracle_scratch"
"""A layer of the oracle while it is drawn: OpenGL 4.1 forbids reading any layer of an attached array."""


def _looks_ahead(variant: Variant, settings: RenderSettings, *, continuous: bool) -> bool:
    """Whether a picture's pass draws the oracle of the next picture, if any comes."""
    if variant is Variant.DELAY:
        return continuous or settings.samples > 1
    return variant is Variant.PREDICT and continuous


def _plan_oracle(
    variant: Variant, layers: int, left_out: list[LeftOut], *, continuous: bool
) -> tuple[PlannedPass, ...]:
    if layers == 1:
        left_out.append(LeftOut("oracle", "only one layer is built"))
        return ()
    if variant is Variant.TWO_PASS:
        left_out.append(LeftOut("oracle", "Two-Pass draws each layer before the next one is tested against it"))
        return ()
    writes = [TargetSpec(ORACLE_TARGET, 1, "f4", layers - 1, inf)]
    if continuous and variant is not Variant.PREPASS:
        writes.append(TargetSpec(HISTORY_TARGET, 1, "f4", layers - 1, inf))
    if layers > 2:
        writes.append(TargetSpec(ORACLE_SCRATCH, 1, "f4", 1, inf))
    return (PlannedPass("oracle", writes=tuple(writes)),)


def reads_past_the_edge(variant: Variant) -> bool:
    """Whether a variant that builds several layers looks up what lies around the picture."""
    return variant is Variant.REPROJECT


def _plan_guard_band(
    settings: RenderSettings, variant: Variant, indirect: IndirectNeeds, left_out: list[LeftOut]
) -> int:
    if settings.guard_band == 0 or reads_past_the_edge(variant) or indirect.any:
        return settings.guard_band
    reason = "nothing reads beyond the picture's edge: no screen-space effect, no layers that are reprojected"
    left_out.append(LeftOut("guard band", reason))
    return 0


def _debug_target(settings: RenderSettings) -> str:
    """The target that the debug view shows; empty where it shows none of the geometry's."""
    return _DEBUG_TARGETS.get(settings.debug_view, "")


def _reads_exit(settings: RenderSettings) -> bool:
    return (settings.deep_output and settings.exit_surfaces) or _debug_target(settings).startswith("exit.")


def _plan_exit(
    settings: RenderSettings, indirect: IndirectNeeds, layers: int, left_out: list[LeftOut]
) -> tuple[PlannedPass, ...]:
    if not (_reads_exit(settings) or indirect.exit):
        left_out.append(LeftOut("exit", "no effect, output or debug view reads the exit surfaces"))
        return ()
    writes = tuple(channel.target(layers) for channel in EXIT_CHANNELS)
    return (PlannedPass("exit", reads=("gbuffer.view_depth",), writes=writes),)


def _read_channels(
    scene: Scene,
    settings: RenderSettings,
    passes: Sequence[PlannedPass],
    layers: int,
    left_out: list[LeftOut],
) -> tuple[tuple[GBufferChannel, int], ...]:
    """The channels that somebody reads, each with how many layers of it."""
    read = {"view_depth": layers}

    def add(names: Iterable[str], count: int) -> None:
        for name in names:
            read[name] = max(read.get(name, 0), count)

    for planned in passes:
        add((name.removeprefix("gbuffer.") for name in planned.reads if name.startswith("gbuffer.")), layers)
    if any(planned.name in INDIRECT_PASSES for planned in passes):
        add(("base_color", "material"), 1)  # what the composite multiplies irradiance by
    for channel in settings.channels:
        add(_FILM_CHANNELS.get(channel, ()), 1)
    if _debug_target(settings).startswith("gbuffer."):
        add((_debug_target(settings).removeprefix("gbuffer."),), min(settings.debug_layer + 1, layers))
    if settings.deep_output:
        add(("normal", "base_color", "material", "object_index"), layers)
        if any(material.is_emissive for material in scene.materials.values()):
            add(("emission",), layers)
        if settings.motion_vectors:
            add(("motion",), layers)
    for channel in CHANNELS:
        if channel.name not in read:
            left_out.append(LeftOut(f"gbuffer {channel.name}", "no pass or output reads it"))
        elif read[channel.name] < layers and settings.variant is Variant.TWO_PASS:
            reason = "no pass or output reads it there"
            left_out.append(LeftOut(f"gbuffer {channel.name} behind layer {read[channel.name]}", reason))
    return tuple((channel, read[channel.name]) for channel in CHANNELS if channel.name in read)


def _plan_composite(
    scene: Scene,
    settings: RenderSettings,
    direct: PlannedPass | None,
    indirect: IndirectNeeds,
    bounced: tuple[PlannedPass, ...],
) -> PlannedPass:
    defines: set[str] = set()
    written = {target.name for planned in bounced for target in planned.writes}
    if indirect.any and (settings.debug_view is DebugView.NONE or Channel.DIFFUSE_INDIRECT in settings.channels):
        defines.add("INDIRECT")
    if settings.debug_view is DebugView.NONE:
        defines |= {"DIRECT"} if direct else set[str]()
        defines |= {"ADD_INDIRECT"} if indirect.any else set[str]()
    else:
        defines.add(f"DEBUG_{settings.debug_view.value}")
        if settings.debug_view is DebugView.DIRECT and not direct:
            defines.remove("DEBUG_DIRECT")
        if settings.debug_view in INDIRECT_DEBUG_VIEWS and _debug_target(settings) not in written:
            defines.remove(f"DEBUG_{settings.debug_view.value}")
    defines |= {f"FILM_{channel.value}" for channel in settings.channels & MEAN_CHANNELS}
    materials = scene.materials.values()
    if settings.channels & {Channel.DIFFUSE_COLOR, Channel.GLOSSY_COLOR} or "INDIRECT" in defines:
        defines |= {"SPECULAR"} if any(material.is_glossy for material in materials) else set[str]()
        rough = any(material.diffuse_roughness > 0.0 for material in materials)
        defines |= {"DIFFUSE_ROUGHNESS"} if rough else set[str]()
        defines |= {"PHONG"} if settings.shading_model is not ShadingModel.PHYSICAL else set[str]()
    defines |= {"ENVIRONMENT"} if scene.world.environment is not None else set[str]()
    if scene.world.sun_disc is not None and scene.world.seen_by_camera:
        defines.add("SUN_DISC")
    defines |= {"SPLIT"} if direct and settings.channels & SPLIT_TARGETS.keys() else set[str]()
    reads = {"view_depth"}.union(*(_FILM_CHANNELS[channel] for channel in settings.channels & MEAN_CHANNELS))
    if "INDIRECT" in defines:
        reads |= {"normal", "base_color", "material"}
    targets = [f"gbuffer.{name}" for name in sorted(reads)]
    shown = [_debug_target(settings), *(["exit.view_depth"] if _debug_target(settings).startswith("exit.") else [])]
    shown = [name for name in shown if name and (name in written or not name.startswith("indirect."))]
    targets += [name for name in dict.fromkeys(shown) if name not in targets]
    if defines & {"DIRECT", "DEBUG_DIRECT"}:
        targets.append("direct.radiance")
    if "SPLIT" in defines:
        targets += SPLIT_TARGETS.values()
    if "INDIRECT" in defines and IRRADIANCE_TARGET not in targets:
        targets.append(IRRADIANCE_TARGET)
    writes = tuple(
        film_target(channel) for channel in SUM_CHANNELS if channel in settings.channels | {Channel.COMBINED}
    )
    return PlannedPass("composite", tuple(targets), writes, frozenset(defines))
