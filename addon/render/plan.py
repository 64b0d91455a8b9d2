# SPDX-License-Identifier: GPL-3.0-or-later
"""Which passes a scene needs, and why the others are left out. Pure: no OpenGL, no Blender."""

from dataclasses import dataclass

from ..scene import BaseColorSource, Channel, DebugView, LightKind, Material, RenderSettings, Scene
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

    `layers`: how many are built. `channels`: those that somebody reads.
    """

    passes: tuple[PlannedPass, ...]
    left_out: tuple[LeftOut, ...]
    layers: int
    channels: tuple[GBufferChannel, ...]

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
    passes = (gbuffer, *((direct,) if direct else ()), _plan_composite(scene, settings, direct))
    return Plan(passes, tuple(left_out), layers, channels)


def is_emissive(material: Material) -> bool:
    """Whether a material emits light."""
    return max(material.emission) > 0.0


def is_glossy(material: Material) -> bool:
    """Whether a material reflects light other than diffusely."""
    return material.specular > 0.0 or material.metallic > 0.0


def has_glossy(scene: Scene) -> bool:
    """Whether any material does."""
    return any(is_glossy(material) for material in scene.materials.values())


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
    needs = _direct_needs(scene)
    left_out += [LeftOut(f"direct {name.lower()}", reason) for name, (wanted, reason) in needs.items() if not wanted]
    reads = ["view_depth"]
    if lit:
        reads += ["normal", "base_color", "material"]
    if emissive:
        reads.append("emission")
    return PlannedPass(
        "direct",
        reads=tuple(f"gbuffer.{name}" for name in reads),
        writes=(TargetSpec("direct.radiance", 4, "f4", layers),),
        defines=frozenset(name for name, (wanted, _) in needs.items() if wanted),
    )


DIRECT_DEFINES = (
    "SUN_LIGHTS",
    "AREA_LIGHTS",
    "SPHERE_LIGHTS",
    "DISK_LIGHTS",
    "SPOT_CONES",
    "SPECULAR",
    "WORLD",
    "EMISSION",
)
"""What the direct pass compiles only where a scene has it: drivers that draw on the CPU run every branch they have."""


def _direct_needs(scene: Scene) -> dict[str, tuple[bool, str]]:
    """Per define of the direct pass, whether the scene needs it, and why not if it does not."""
    kinds = {light.kind for light in scene.lights}
    bulbs = {light.soft_falloff for light in scene.lights if light.kind in (LightKind.POINT, LightKind.SPOT)}
    materials = scene.materials.values()
    needed = (
        (LightKind.SUN in kinds, "no sun"),
        (LightKind.AREA in kinds, "no area light"),
        (False in bulbs, "no point or spot light without soft falloff"),
        (True in bulbs, "no point or spot light with soft falloff"),
        (LightKind.SPOT in kinds, "no spot light"),
        (has_glossy(scene), "no glossy material"),
        (max(scene.world.radiance) > 0.0, "the world is black"),
        (any(is_emissive(material) for material in materials), "no emissive material"),
    )
    return dict(zip(DIRECT_DEFINES, needed, strict=True))


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
        read |= {"normal", "base_color", "material", "object_index"}
        if any(is_emissive(material) for material in scene.materials.values()):
            read.add("emission")
    left_out += [
        LeftOut(f"gbuffer {channel.name}", "no pass or output reads it")
        for channel in CHANNELS
        if channel.name not in read
    ]
    return tuple(channel for channel in CHANNELS if channel.name in read)


def _plan_composite(scene: Scene, settings: RenderSettings, direct: PlannedPass | None) -> PlannedPass:
    defines: set[str] = set()
    if settings.debug_view is DebugView.NONE:
        defines |= {"DIRECT"} if direct else set[str]()
    else:
        defines.add(f"DEBUG_{settings.debug_view.value}")
        if settings.debug_view is DebugView.DIRECT and not direct:
            defines.remove("DEBUG_DIRECT")
    defines |= {f"FILM_{channel.value}" for channel in settings.channels & MEAN_CHANNELS}
    if Channel.DIFFUSE_COLOR in settings.channels and has_glossy(scene):
        defines.add("SPECULAR")
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
