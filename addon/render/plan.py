# SPDX-License-Identifier: GPL-3.0-or-later
"""Which passes a scene needs, and why the others are left out. Pure: no OpenGL, no Blender."""

from dataclasses import dataclass

from ..scene import BaseColorSource, Channel, DebugView, Material, RenderSettings, Scene
from .layout import CHANNELS, ORACLES, GBufferChannel, TargetSpec


@dataclass(frozen=True)
class PlannedPass:
    """A pass that runs: target names it reads, targets it writes, its shader defines."""

    name: str
    reads: tuple[str, ...] = ()
    writes: tuple[TargetSpec, ...] = ()
    defines: frozenset[str] = frozenset()


@dataclass(frozen=True)
class LeftOut:
    """Something the scene or the settings do not need, and why."""

    name: str
    reason: str


@dataclass(frozen=True)
class Plan:
    """The passes of one sample in order, what was left out, and how the deep G-buffer is laid out.

    `layers`: how many are built. `channels`: those that somebody reads. `film_channels`: images that are accumulated.
    """

    passes: tuple[PlannedPass, ...]
    left_out: tuple[LeftOut, ...]
    layers: int
    channels: tuple[GBufferChannel, ...]
    film_channels: frozenset[Channel]

    def find(self, name: str) -> PlannedPass | None:
        """The planned pass of that name, or None where it was left out."""
        return next((planned for planned in self.passes if planned.name == name), None)

    @property
    def targets(self) -> tuple[TargetSpec, ...]:
        """Every texture that the passes write."""
        return tuple(target for planned in self.passes for target in planned.writes)


MEAN_CHANNELS = frozenset({Channel.NORMAL, Channel.DIFFUSE_COLOR})
"""Film images besides COMBINED that are means over samples."""

FIRST_SAMPLE_CHANNELS = frozenset({Channel.DEPTH, Channel.POSITION, Channel.OBJECT_INDEX})
"""Film images taken from sample 0 alone, through pixel centres: means of them are meaningless."""

SUM_CHANNELS = (Channel.COMBINED, *sorted(MEAN_CHANNELS))
"""Images that the composite pass adds up, in attachment order."""


def film_target(channel: Channel) -> TargetSpec:
    """The float32 RGBA target that the sum of a film image lives in."""
    return TargetSpec(f"film.{channel.value.lower()}", 4, "f4")


_DEBUG_CHANNELS = {
    DebugView.DEPTH: "view_depth",
    DebugView.NORMAL: "normal",
    DebugView.ALBEDO: "base_color",
    DebugView.METALLIC: "material",
    DebugView.ROUGHNESS: "material",
    DebugView.EMISSION: "emission",
    DebugView.OBJECT_INDEX: "object_index",
}

_FILM_CHANNELS = {
    Channel.DEPTH: {"view_depth"},
    Channel.NORMAL: {"view_depth", "normal"},
    Channel.POSITION: {"view_depth"},
    Channel.DIFFUSE_COLOR: {"view_depth", "normal", "base_color", "material"},
    Channel.OBJECT_INDEX: {"view_depth", "object_index"},
}


def plan(scene: Scene, settings: RenderSettings) -> Plan:
    """Decide the passes for one scene and one set of settings."""
    left_out: list[LeftOut] = []
    layers = _layer_count(settings, left_out)
    direct = _plan_direct(scene, settings, layers, left_out)
    channels = _read_channels(scene, settings, direct, left_out)
    gbuffer = PlannedPass(
        "gbuffer",
        writes=tuple(channel.target(layers) for channel in channels) + (ORACLES if layers > 1 else ()),
        defines=frozenset({"PEEL"} if layers > 1 else ()),
    )
    passes = (gbuffer, *((direct,) if direct else ()), _plan_composite(settings, direct))
    return Plan(passes, tuple(left_out), layers, channels, settings.channels | {Channel.COMBINED})


def is_emissive(material: Material) -> bool:
    """Whether a material emits light."""
    return max(material.emission) > 0.0


def is_alpha_tested(material: Material) -> bool:
    """Whether presence varies over the surface, so that fragments must be tested one by one."""
    return material.texture_alpha and material.source is BaseColorSource.TEXTURE


def is_invisible(material: Material, settings: RenderSettings) -> bool:
    """Whether no fragment of the material can pass the alpha test."""
    return material.alpha < settings.alpha_threshold


def _layer_count(settings: RenderSettings, left_out: list[LeftOut]) -> int:
    if settings.deep_output:
        return settings.layers
    needed = 1
    if settings.debug_view is not DebugView.NONE:
        needed = min(settings.debug_layer, settings.layers - 1) + 1
    if needed < settings.layers:
        unread = f"layer {needed + 1}" if needed + 1 == settings.layers else f"layers {needed + 1}–{settings.layers}"
        left_out.append(
            LeftOut(f"gbuffer {unread}", "nothing reads them: no indirect effect, layer output or debug view of them")
        )
        if needed == 1:
            left_out.append(LeftOut("minimum separation", "Δz unused: only one layer is built"))
    return needed


def _plan_direct(scene: Scene, settings: RenderSettings, layers: int, left_out: list[LeftOut]) -> PlannedPass | None:
    lit = bool(scene.lights) or max(scene.world.radiance) > 0.0
    emissive = any(is_emissive(material) for material in scene.materials.values())
    if not scene.batches:
        left_out.append(LeftOut("direct", "no geometry"))
        return None
    if not lit and not emissive:
        left_out.append(LeftOut("direct", "no light, emission or world"))
        return None
    if settings.debug_view not in (DebugView.NONE, DebugView.DIRECT) and not settings.deep_output:
        left_out.append(LeftOut("direct", "the debug view shows the G-buffer only"))
        return None
    defines: set[str] = set()
    reads = ["view_depth"]
    if lit:
        reads += ["normal", "base_color", "material"]
    for define, wanted, reason in (
        ("LIGHTS", bool(scene.lights), "no lights"),
        ("WORLD", max(scene.world.radiance) > 0.0, "the world is black"),
        ("EMISSION", emissive, "no emissive material"),
    ):
        if wanted:
            defines.add(define)
        else:
            left_out.append(LeftOut(f"direct {define.lower()}", reason))
    if emissive:
        reads.append("emission")
    return PlannedPass(
        "direct",
        reads=tuple(f"gbuffer.{name}" for name in reads),
        writes=(TargetSpec("direct.radiance", 4, "f4", layers),),
        defines=frozenset(defines),
    )


def _read_channels(
    scene: Scene, settings: RenderSettings, direct: PlannedPass | None, left_out: list[LeftOut]
) -> tuple[GBufferChannel, ...]:
    read = {"view_depth"}
    if direct:
        read |= {name.removeprefix("gbuffer.") for name in direct.reads}
    for channel in settings.channels:
        read |= _FILM_CHANNELS.get(channel, set())
    if settings.debug_view in _DEBUG_CHANNELS:
        read.add(_DEBUG_CHANNELS[settings.debug_view])
    if settings.deep_output:
        read |= {channel.name for channel in CHANNELS if channel.name != "emission"}
        if any(is_emissive(material) for material in scene.materials.values()):
            read.add("emission")
    left_out += [
        LeftOut(f"gbuffer {channel.name}", "no pass or output reads it")
        for channel in CHANNELS
        if channel.name not in read
    ]
    return tuple(channel for channel in CHANNELS if channel.name in read)


def _plan_composite(settings: RenderSettings, direct: PlannedPass | None) -> PlannedPass:
    defines: set[str] = set()
    if settings.debug_view is DebugView.NONE:
        defines |= {"DIRECT"} if direct else set[str]()
    else:
        defines.add(f"DEBUG_{settings.debug_view.value}")
        if settings.debug_view is DebugView.DIRECT and not direct:
            defines.remove("DEBUG_DIRECT")
    defines |= {f"FILM_{channel.value}" for channel in settings.channels & MEAN_CHANNELS}
    reads = {"view_depth"}.union(*(_FILM_CHANNELS[channel] for channel in settings.channels & MEAN_CHANNELS))
    if settings.debug_view in _DEBUG_CHANNELS:
        reads.add(_DEBUG_CHANNELS[settings.debug_view])
    targets = [f"gbuffer.{name}" for name in sorted(reads)]
    if defines & {"DIRECT", "DEBUG_DIRECT"}:
        targets.append("direct.radiance")
    writes = tuple(
        film_target(channel) for channel in SUM_CHANNELS if channel in settings.channels | {Channel.COMBINED}
    )
    return PlannedPass("composite", tuple(targets), writes, frozenset(defines))
