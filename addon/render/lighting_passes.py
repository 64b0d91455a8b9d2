# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes that direct light needs, and why the others are left out. Pure: no OpenGL, no Blender."""

from ..scene import Channel, DebugView, RenderSettings, Scene
from .direct_needs import direct_needs
from .layout import TargetSpec, depth_tiles_target, light_tiles_target
from .light_reach import MANY_LIGHTS
from .lighting_plan import LightPlan
from .planned_pass import LeftOut, PlannedPass

SPLIT_TARGETS = {Channel.DIFFUSE_DIRECT: "direct.diffuse", Channel.GLOSSY_DIRECT: "direct.glossy"}
"""Film channel -> what the direct pass writes of the first layer where the film wants it."""


def plan_lighting_passes(
    scene: Scene, settings: RenderSettings, lights: LightPlan, layers: int, left_out: list[LeftOut]
) -> tuple[PlannedPass, ...]:
    """Tiles, shadow maps and shading of `layers` layers, in order; the direct pass is the last. None where it is."""
    direct = _plan_direct(scene, settings, lights, layers, left_out)
    if direct is None:
        left_out += [LeftOut(name, "no direct light") for name in ("depth_tiles", "shadow_maps", "light_tiles")]
        return ()
    tiles = _plan_depth_tiles(lights, layers, left_out)
    return (*tiles, *_plan_shadow_maps(lights, left_out), *_plan_light_tiles(lights, layers, left_out), direct)


def _plan_depth_tiles(lights: LightPlan, layers: int, left_out: list[LeftOut]) -> tuple[PlannedPass, ...]:
    if not (lights.casts_shadows or lights.many):
        left_out.append(LeftOut("depth_tiles", f"no shadows, and no more than {MANY_LIGHTS} lamps"))
        return ()
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


def _plan_direct(
    scene: Scene, settings: RenderSettings, lights: LightPlan, layers: int, left_out: list[LeftOut]
) -> PlannedPass | None:
    lit = lights.count > 0
    emissive = any(material.is_emissive for material in scene.materials.values())
    if not any(batch.seen_by_camera for batch in scene.batches):
        left_out.append(LeftOut("direct", "no geometry"))
        return None
    if not lit and not emissive:
        left_out.append(LeftOut("direct", "no light, emission or world"))
        return None
    if settings.debug_view not in (DebugView.NONE, DebugView.DIRECT) and not settings.deep_output:
        left_out.append(LeftOut("direct", "the debug view shows the G-buffer only"))
        return None
    needs = direct_needs(scene, settings, lights)
    left_out += [LeftOut(f"direct {name.lower()}", reason) for name, (wanted, reason) in needs.items() if not wanted]
    reads = ["view_depth"]
    if lit:
        reads += ["normal", "base_color", "material"]
    if emissive:
        reads.append("emission")
    defines = {name for name, (wanted, _) in needs.items() if wanted}
    split = settings.channels & SPLIT_TARGETS.keys()
    if split:
        defines.add("SPLIT")
    others = tuple(TargetSpec(name, 4, "f4", 1) for name in SPLIT_TARGETS.values()) if split else ()
    return PlannedPass(
        "direct",
        reads=(*(f"gbuffer.{name}" for name in reads), *(("tiles.lights",) if lights.many else ())),
        writes=(TargetSpec("direct.radiance", 4, "f4", layers), *others),
        defines=frozenset(defines),
    )
