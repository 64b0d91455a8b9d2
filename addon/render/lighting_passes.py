# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes that direct light needs, and why the others are left out. Pure: no OpenGL, no Blender."""

from ..scene import Channel, DebugView, RenderSettings, Scene, ShadingModel
from .direct_needs import DIRECT_DEFINES, GOURAUD_DEFINES, direct_needs
from .indirect_plan import INDIRECT_DEBUG_VIEWS
from .layout import TargetSpec, depth_tiles_target, light_tiles_target
from .light_reach import MANY_LIGHTS
from .lighting_plan import LightPlan
from .planned_pass import LeftOut, PlannedPass

SPLIT_TARGETS = {Channel.DIFFUSE_DIRECT: "direct.diffuse", Channel.GLOSSY_DIRECT: "direct.glossy"}
"""Film channel -> what the direct pass writes of the first layer where the film wants it."""

_PER_VERTEX = (
    LeftOut("depth_tiles", "neither shadow maps nor lamps by tiles"),
    LeftOut("shadow_maps", "Gouraud shading lights vertices, which are too few to show shadows"),
    LeftOut("light_tiles", "Gouraud shading asks every lamp at each vertex"),
    LeftOut("direct", "Gouraud shading lights vertices in place of pixels"),
)


SHADING_PASSES = ("direct", "gouraud")
"""The passes that light what is seen."""


def plan_lighting_passes(
    scene: Scene, settings: RenderSettings, lights: LightPlan, layers: int, left_out: list[LeftOut], *, tiled: bool
) -> tuple[PlannedPass, ...]:
    """Tiles, shadow maps and shading of `layers` layers, in order; what shades is the last, where anything does.

    `tiled`: whether another pass reads the tiles' depths.
    """
    gouraud = settings.shading_model is ShadingModel.GOURAUD
    shading = _plan_shading(scene, settings, lights, layers, left_out, gouraud=gouraud)
    if shading is None:
        dark = ("shadow_maps", "light_tiles") if tiled else ("depth_tiles", "shadow_maps", "light_tiles")
        left_out += [LeftOut(name, "no direct light") for name in dark]
        return _plan_depth_tiles(layers) if tiled else ()
    if gouraud:
        left_out += _PER_VERTEX
        return (shading,)
    left_out.append(LeftOut("gouraud", "shading is not Gouraud's"))
    if tiled or lights.casts_shadows or lights.many:
        tiles = _plan_depth_tiles(layers)
    else:
        left_out.append(LeftOut("depth_tiles", f"no shadows, and no more than {MANY_LIGHTS} lamps"))
        tiles = ()
    return (*tiles, *_plan_shadow_maps(lights, left_out), *_plan_light_tiles(lights, layers, left_out), shading)


def _plan_depth_tiles(layers: int) -> tuple[PlannedPass, ...]:
    return (PlannedPass("depth_tiles", reads=("gbuffer.view_depth",), writes=(depth_tiles_target(layers),)),)


def _plan_shadow_maps(lights: LightPlan, left_out: list[LeftOut]) -> tuple[PlannedPass, ...]:
    if not lights.casts_shadows:
        left_out.append(LeftOut("shadow_maps", "no light casts a shadow, or nothing is in its way"))
        return ()
    return (PlannedPass("shadow_maps", reads=("tiles.depth",)),)


def _plan_light_tiles(lights: LightPlan, layers: int, left_out: list[LeftOut]) -> tuple[PlannedPass, ...]:
    if not lights.many:
        left_out.append(LeftOut("light_tiles", f"no more than {MANY_LIGHTS} lamps"))
        return ()
    return (PlannedPass("light_tiles", reads=("tiles.depth",), writes=(light_tiles_target(layers, lights.count),)),)


def _plan_shading(
    scene: Scene,
    settings: RenderSettings,
    lights: LightPlan,
    layers: int,
    left_out: list[LeftOut],
    *,
    gouraud: bool,
) -> PlannedPass | None:
    lit = lights.count > 0
    emissive = any(material.is_emissive for material in scene.materials.values())
    if not any(batch.seen_by_camera for batch in scene.batches):
        left_out.append(LeftOut("direct", "no geometry"))
        return None
    if not lit and not emissive:
        left_out.append(LeftOut("direct", "no light, emission or world"))
        return None
    shows_light = settings.debug_view in INDIRECT_DEBUG_VIEWS | {DebugView.NONE, DebugView.DIRECT}
    if not shows_light and not settings.deep_output:
        left_out.append(LeftOut("direct", "the debug view shows the G-buffer only"))
        return None
    name, known = ("gouraud", GOURAUD_DEFINES) if gouraud else ("direct", DIRECT_DEFINES)
    needs = {define: need for define, need in direct_needs(scene, settings, lights).items() if define in known}
    left_out += [
        LeftOut(f"{name} {define.lower()}", reason) for define, (wanted, reason) in needs.items() if not wanted
    ]
    reads = ["view_depth"]
    if lit:
        reads += ["base_color", "material"] if gouraud else ["normal", "base_color", "material"]
    if emissive:
        reads.append("emission")
    defines = {define for define, (wanted, _) in needs.items() if wanted}
    split = settings.channels & SPLIT_TARGETS.keys()
    if split:
        defines.add("SPLIT")
    others = tuple(TargetSpec(target, 4, "f4", 1) for target in SPLIT_TARGETS.values()) if split else ()
    tiles = ("tiles.lights",) if lights.many and not gouraud else ()
    return PlannedPass(
        name,
        reads=(*(f"gbuffer.{channel}" for channel in reads), *tiles),
        writes=(TargetSpec("direct.radiance", 4, "f4", layers), *others),
        defines=frozenset(defines),
    )
