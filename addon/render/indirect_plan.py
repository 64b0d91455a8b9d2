# SPDX-License-Identifier: GPL-3.0-or-later
"""Which passes find indirect light, and why the others are left out. Pure: no OpenGL, no Blender."""

from dataclasses import dataclass

from ..scene import (
    ALL_GROUPS,
    DebugView,
    IndirectMethod,
    IndirectSettings,
    Material,
    RenderSettings,
    Scene,
    ShadingModel,
)
from ..scene.indirect import BOUNCING_METHODS, RAY_METHODS, WORLD_METHODS
from .layout import TargetSpec
from .planned_pass import LeftOut, PlannedPass

GATHERED_TARGET = "indirect.gathered"
"""Irradiance (W/m²) that one sample found, and the variance of its luminance; a texel for `divisor`² pixels."""

BLENDED_TARGET = "indirect.blended"
"""The same, blended with that of the views before."""

IRRADIANCE_TARGET = "indirect.irradiance"
"""Irradiance (W/m²) of the nearest layer, of every pixel."""

HISTORY_TARGETS = ("temporal.history_0", "temporal.history_1")
"""Mean irradiance of earlier samples on what each gathered texel looks at; one is read while the other is written."""

HISTORY_SURFACES = ("temporal.surfaces_0", "temporal.surfaces_1")
"""What that is: octahedral normal, view depth (m), and how many samples the mean is of."""

FILTER_SURFACES = "filter.surfaces"
"""Camera-space normal and view depth (m) of what each gathered texel looks at."""

FILTER_SCRATCH = ("filter.scratch_0", "filter.scratch_1")
"""Irradiance between the iterations of the filter."""

ORIGIN_TARGET = "indirect.origin"
"""What debug views of indirect light show."""

BOUNCE_TARGETS = ("indirect.bounce_0", "indirect.bounce_1")
"""Irradiance (W/m²) of all layers after one bounce and after the next, in turn."""

BOUNCE_DIVISOR = 8
"""Pixels along each side of those that share an irradiance there."""

INDIRECT_DEBUG_VIEWS = frozenset(
    {
        DebugView.INDIRECT,
        DebugView.GRID_CELLS,
        DebugView.GRID_RADIANCE,
        DebugView.MARCH_HITS,
        DebugView.LIGHT_ORIGIN,
    }
)

_PASS_OF_METHOD = {
    IndirectMethod.OCCLUSION: "occlusion",
    IndirectMethod.SSAO: "occlusion",
    IndirectMethod.RADIOSITY: "radiosity",
    IndirectMethod.DEEP_MARCH: "deep_march",
    IndirectMethod.MARCH_GRID: "gather",
}
INDIRECT_PASSES = (*dict.fromkeys(_PASS_OF_METHOD.values()), "radiance_grid", "temporal", "filter")
"""Every pass that has to do with indirect light."""

_ORIGIN_VIEWS = {
    IndirectMethod.DEEP_MARCH: {DebugView.MARCH_HITS, DebugView.LIGHT_ORIGIN},
    IndirectMethod.MARCH_GRID: INDIRECT_DEBUG_VIEWS - {DebugView.INDIRECT},
}


@dataclass(frozen=True)
class IndirectNeeds:
    """What a picture's indirect light asks of the passes before it.

    `method`: NONE where there is none. `layers` that it reads, and whether their `exit` surfaces. `world_gathered`:
    whether it finds the world's diffuse light, so that `direct` need not. `channels` of the G-buffer that it reads in
    all its layers. `reads_layers`: whether it looks for surfaces in the layers.
    """

    method: IndirectMethod = IndirectMethod.NONE
    layers: int = 1
    exit: bool = False
    world_gathered: bool = False
    channels: tuple[str, ...] = ()
    reads_layers: bool = False

    @property
    def reads_grid(self) -> bool:
        """Whether there must be a radiance grid."""
        return self.method is IndirectMethod.MARCH_GRID

    @property
    def layers_send(self) -> bool:
        """Whether light is taken from the layers."""
        return "material" in self.channels and self.reads_layers

    @property
    def any(self) -> bool:
        """Whether there is indirect light at all."""
        return self.method is not IndirectMethod.NONE


LARGEST_REFLECTANCE = 0.999
"""Light between surfaces that send back all of it or more would never come to rest."""


def reflectance_warnings(scene: Scene, needs: IndirectNeeds) -> tuple[str, ...]:
    """A sentence for each material whose base colour indirect light takes for darker than it is."""
    if needs.method not in BOUNCING_METHODS:
        return ()
    return tuple(
        f'Material "{material.name}" sends back all light or more (base colour {max(material.base_color):g}): '
        f"for indirect light {LARGEST_REFLECTANCE} is used."
        for material in scene.materials.values()
        if max(material.base_color) > LARGEST_REFLECTANCE
    )


def linking_warnings(scene: Scene, needs: IndirectNeeds) -> tuple[str, ...]:
    """A sentence for each linked light whose indirect light falls on more than its direct light does."""
    if needs.method is not IndirectMethod.MARCH_GRID:
        return ()
    return tuple(
        f'Light "{light.name}" is linked: its indirect light is found as if it lit everything.'
        for light in scene.lights
        if light.receiver_groups != ALL_GROUPS
    )


def reads_layers(indirect: IndirectSettings) -> bool:
    """Whether a method looks behind the nearest layer."""
    if indirect.method is IndirectMethod.MARCH_GRID:
        return indirect.contact_steps > 0
    return indirect.method is not IndirectMethod.NONE


def gathers_world(indirect: IndirectSettings) -> bool:
    """Whether a method finds the world's diffuse light; the paper's composite weighs it against what it finds."""
    return indirect.method in WORLD_METHODS or (
        indirect.method is IndirectMethod.RADIOSITY and indirect.paper_composite
    )


def indirect_needs(scene: Scene, settings: RenderSettings, left_out: list[LeftOut]) -> IndirectNeeds:
    """What the scene's indirect light needs, if it has any."""
    reason = _why_none(scene, settings)
    if reason:
        left_out += [LeftOut(name, reason) for name in INDIRECT_PASSES]
        return IndirectNeeds()
    indirect, method, layered = settings.indirect, settings.indirect.method, reads_layers(settings.indirect)
    surfaces = ("normal", "base_color", "material")
    return IndirectNeeds(
        method,
        layers=settings.layers if layered else 1,
        exit=method in RAY_METHODS and indirect.exit_surfaces and layered,
        world_gathered=gathers_world(indirect) and scene.world.shines and scene.world.seen_by_diffuse,
        channels=("normal",) if method in _OCCLUSIONS else surfaces,
        reads_layers=layered,
    )


def plan_indirect(
    scene: Scene,
    settings: RenderSettings,
    needs: IndirectNeeds,
    left_out: list[LeftOut],
    *,
    direct: PlannedPass | None,
    samples_emission: bool,
    continuous: bool,
) -> tuple[PlannedPass, ...]:
    """The passes in order; the last one writes `IRRADIANCE_TARGET`.

    `direct`: what shades the layers, if anything; `samples_emission`: whether it samples emissive surfaces as lights.
    """
    if not needs.any:
        return ()
    indirect, name = settings.indirect, _PASS_OF_METHOD[needs.method]
    left_out += [
        LeftOut(other, "another method finds indirect light") for other in _PASS_OF_METHOD.values() if other != name
    ]
    grid = ()
    if needs.reads_grid:
        grid = (PlannedPass("radiance_grid", reads=("tiles.depth",)),)
    else:
        left_out.append(LeftOut("radiance_grid", "the method does not read it"))
    blends = continuous and indirect.temporal_filter
    filters = indirect.spatial_filter or indirect.divisor > 1
    written = GATHERED_TARGET if blends or filters else IRRADIANCE_TARGET
    spec = TargetSpec(written, 4, "f4", divisor=indirect.divisor)
    origin = settings.debug_view in _ORIGIN_VIEWS.get(needs.method, ())
    reflects = direct is not None and needs.layers_send
    method = PlannedPass(
        name,
        reads=(
            "gbuffer.view_depth",
            *(f"gbuffer.{channel}" for channel in needs.channels),
            *(("exit.view_depth",) if needs.exit else ()),
            *(("direct.radiance",) if reflects else ()),
            *(("gbuffer.emission",) if reflects and samples_emission else ()),
        ),
        writes=(
            spec,
            *((TargetSpec(ORIGIN_TARGET, 4, "f4", divisor=indirect.divisor),) if origin else ()),
            *_bounce_targets(indirect, needs),
        ),
        defines=_method_defines(scene, settings, needs)
        | ({"RADIANCE"} if reflects else set[str]())
        | ({"SAMPLED_EMISSION"} if reflects and samples_emission else set[str]()),
    )
    return (*grid, method, *plan_filters(settings, written, left_out, blends=blends, filters=filters))


_OCCLUSIONS = (IndirectMethod.OCCLUSION, IndirectMethod.SSAO)
_BOUNCING = (IndirectMethod.DEEP_MARCH, IndirectMethod.RADIOSITY)
"""Methods whose light bounces from layer to layer."""


def _bounce_targets(indirect: IndirectSettings, needs: IndirectNeeds) -> tuple[TargetSpec, ...]:
    """What further bounces through the layers are kept in."""
    if needs.method not in _BOUNCING or indirect.bounces == 1:
        return ()
    return tuple(TargetSpec(name, 4, "f4", needs.layers, divisor=BOUNCE_DIVISOR) for name in BOUNCE_TARGETS)


def _method_defines(scene: Scene, settings: RenderSettings, needs: IndirectNeeds) -> frozenset[str]:
    """Defines of the pass that finds the light: the method, how many layers it reads, what there is of the world."""
    defines = {needs.method.value, f"LAYERS {needs.layers}"}
    if needs.reads_grid and reads_layers(settings.indirect):
        defines.add("CONTACT")
    if needs.exit:
        defines.add("EXIT")
    if needs.world_gathered:
        defines |= {"WORLD", "ENVIRONMENT"} if scene.world.environment is not None else {"WORLD"}
    if settings.debug_view in _ORIGIN_VIEWS.get(needs.method, ()):
        defines.add(f"DEBUG_{settings.debug_view.value}")
    if needs.method is IndirectMethod.RADIOSITY:
        defines |= _radiosity_defines(scene, settings)
    return frozenset(defines)


def _radiosity_defines(scene: Scene, settings: RenderSettings) -> set[str]:
    """Which composite, and what decides how much surfaces reflect diffusely."""
    materials, physical = scene.materials.values(), settings.shading_model is ShadingModel.PHYSICAL
    needed = {
        "PAPER": settings.indirect.paper_composite,
        "SPECULAR": any(material.is_glossy for material in materials),
        "DIFFUSE_ROUGHNESS": physical and any(material.diffuse_roughness > 0.0 for material in materials),
        "PHONG": not physical,
    }
    return {name for name, wanted in needed.items() if wanted}


def plan_filters(
    settings: RenderSettings, written: str, left_out: list[LeftOut], *, blends: bool, filters: bool
) -> tuple[PlannedPass, ...]:
    """The passes after the one that has `written` noisy irradiance, and why others are left out.

    `blends`: whether there are pictures before to blend with. `filters`: whether noise is smoothed between pixels.
    """
    indirect = settings.indirect
    passes: list[PlannedPass] = []
    if blends:
        reads = ("gbuffer.view_depth", "gbuffer.normal", "gbuffer.motion", written)
        blended = BLENDED_TARGET if filters else IRRADIANCE_TARGET
        names = (blended, *HISTORY_TARGETS, *HISTORY_SURFACES)
        writes = tuple(TargetSpec(name, 4, "f4", divisor=indirect.divisor) for name in names)
        passes.append(PlannedPass("temporal", reads, writes))
        written = blended
    else:
        off = "temporal filter is off" if not indirect.temporal_filter else "a final render has no views before it"
        left_out.append(LeftOut("temporal", off))
    if filters:
        reads = ("gbuffer.view_depth", "gbuffer.normal", written)
        names = (FILTER_SURFACES, *(FILTER_SCRATCH if indirect.spatial_filter else ()))
        scratch = tuple(TargetSpec(name, 4, "f4", divisor=indirect.divisor) for name in names)
        defines = frozenset({"SPATIAL"} if indirect.spatial_filter else ())
        passes.append(PlannedPass("filter", reads, (TargetSpec(IRRADIANCE_TARGET, 4, "f4"), *scratch), defines))
    else:
        left_out.append(LeftOut("filter", "it is off, and every pixel gathers its own light"))
    return tuple(passes)


def _why_none(scene: Scene, settings: RenderSettings) -> str | None:
    """Why a picture has no indirect light; None where it has."""
    method, world = settings.indirect.method, scene.world.shines and scene.world.seen_by_diffuse
    materials = scene.materials.values()
    reason = None
    if method is IndirectMethod.NONE:
        reason = "the method is None"
    elif not any(batch.seen_by_camera for batch in scene.batches):
        reason = "no geometry"
    elif settings.shading_model is ShadingModel.GOURAUD:
        reason = "Gouraud shading lights vertices, not pixels"
    elif settings.debug_view not in INDIRECT_DEBUG_VIEWS | {DebugView.NONE}:
        reason = "the debug view does not show it"
    elif not any(_reflects_diffusely(material) for material in materials):
        reason = "nothing reflects diffusely"
    elif method in _OCCLUSIONS and not world:
        reason = "no world light, which is all that the method finds"
    elif not (scene.lights or world or any(material.is_emissive for material in materials)):
        reason = "no light, emission or world"
    return reason


def _reflects_diffusely(material: Material) -> bool:
    return max(material.base_color) > 0.0 and material.metallic < 1.0
