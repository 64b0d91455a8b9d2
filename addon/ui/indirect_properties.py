# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of indirect light, `Scene.deep_gbuffer.indirect`."""

from dataclasses import asdict, fields
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty

from ..scene import IndirectMethod
from ..scene.quality import DEFAULT_QUALITY, QUALITIES, Quality, QualityNumbers
from .changes import changed
from .choices import DIVISOR_ITEMS, MEMORY_ITEMS, METHOD_ITEMS, QUALITY_ITEMS

_DEFAULT = QUALITIES[DEFAULT_QUALITY]
_PRESETS = [identifier for identifier, _name, _tooltip in QUALITY_ITEMS]


def _shown_preset(group: Any) -> int:
    """The place of the preset whose numbers the group has; else that of Custom."""
    numbers = QualityNumbers(**{field.name: int(getattr(group, field.name)) for field in fields(QualityNumbers)})
    matching = [quality.value for quality, preset in QUALITIES.items() if preset == numbers]
    return _PRESETS.index(matching[0] if matching else "CUSTOM")


def _choose_preset(group: Any, place: int) -> None:
    """Give the group the numbers of the preset at that place; Custom leaves them as they are."""
    if _PRESETS[place] != "CUSTOM":
        for name, number in asdict(QUALITIES[Quality(_PRESETS[place])]).items():
            setattr(group, name, str(number) if name == "divisor" else number)


class DeepGBufferIndirectQuality(bpy.types.PropertyGroup):
    """The numbers that trade the error of indirect light for time: once for renders, once for viewports."""

    preset: EnumProperty(
        name="Quality",
        description="Sets the numbers below",
        items=QUALITY_ITEMS,
        get=_shown_preset,
        set=_choose_preset,
    )
    rays: IntProperty(
        name="Rays",
        description="Rays per sample of each pixel that gathers indirect light: more give less noise",
        default=_DEFAULT.rays,
        min=1,
        soft_max=64,
        max=1024,
        update=changed,
    )
    divisor: EnumProperty(
        name="Resolution",
        description="How many pixels gather indirect light of their own",
        items=DIVISOR_ITEMS,
        default=str(_DEFAULT.divisor),
        update=changed,
    )
    taps: IntProperty(
        name="Taps",
        description="Points around each pixel at which the layers are read: more give less noise",
        default=_DEFAULT.taps,
        min=1,
        soft_max=64,
        max=256,
        update=changed,
    )
    march_steps: IntProperty(
        name="March Steps",
        description="Steps of a ray through the layers: more miss fewer thin surfaces",
        default=_DEFAULT.march_steps,
        min=1,
        soft_max=128,
        max=1024,
        update=changed,
    )
    contact_steps: IntProperty(
        name="Contact Steps",
        description="Steps of a ray through the layers, which know finer detail than the grid, before it goes on "
        "through the grid; 0 uses the grid alone",
        default=_DEFAULT.contact_steps,
        min=0,
        soft_max=32,
        max=256,
        update=changed,
    )
    cells: IntProperty(
        name="Grid Cells",
        description="Cells of the radiance grid along the longest side of what is seen: more show smaller shadows and "
        "let less light through thin walls. With a Cell Size of your own: along what the finest cover",
        default=_DEFAULT.cells,
        min=8,
        max=128,
        update=changed,
    )
    cell_rays: IntProperty(
        name="Cell Rays",
        description="Rays from each cell of the grid, by which light is reflected from cell to cell",
        default=_DEFAULT.cell_rays,
        min=1,
        soft_max=256,
        max=1024,
        update=changed,
    )


class DeepGBufferIndirectSettings(bpy.types.PropertyGroup):
    """How light that surfaces reflect at each other is found."""

    method: EnumProperty(
        name="Method",
        description="How light is found that surfaces reflect at each other, and diffuse light of the world",
        items=METHOD_ITEMS,
        default=IndirectMethod.MARCH_GRID.value,
        update=changed,
    )
    bounces: IntProperty(
        name="Bounces",
        description="How often light is reflected at most before it reaches the surface that is seen, as Cycles' "
        "diffuse bounces",
        default=4,
        min=1,
        soft_max=16,
        max=1024,
        update=changed,
    )
    unlimited_bounces: BoolProperty(
        name="Unlimited Bounces",
        description="Reflect light as often as it takes until nothing is left of it",
        default=False,
        update=changed,
    )
    radius: FloatProperty(
        name="Radius",
        description="Distance from a pixel's surface within which others are looked for",
        default=1.0,
        min=1e-4,
        soft_max=10.0,
        max=1e6,
        precision=3,
        subtype="DISTANCE",
        update=changed,
    )
    march_distance: FloatProperty(
        name="Distance",
        description="Length of the rays; 0 for no limit",
        default=0.0,
        min=0.0,
        soft_max=100.0,
        max=1e9,
        precision=3,
        subtype="DISTANCE",
        update=changed,
    )
    exit_surfaces: BoolProperty(
        name="Exit Surfaces",
        description="Let rays know where objects end behind their visible side, so that they pass behind thin objects "
        "and stop at thick ones",
        default=False,
        update=changed,
    )
    cell_size: FloatProperty(
        name="Cell Size",
        description="Side of the grid's smallest cells; 0 chooses it by the view and the number of cells",
        default=0.0,
        min=0.0,
        soft_max=10.0,
        max=1e6,
        precision=3,
        subtype="DISTANCE",
        update=changed,
    )
    grid_memory: EnumProperty(
        name="Memory Limit",
        description="Graphics memory of the cells: with less, they are larger. Points on surfaces that cells are "
        "filled with, and a second grid while one takes the place of another, come on top",
        items=MEMORY_ITEMS,
        default="512",
        update=changed,
    )
    spatial_filter: BoolProperty(
        name="Spatial Filter",
        description="Smooth noise of indirect light between pixels that see the same surface; less and less of it as "
        "samples make it useless",
        default=True,
        update=changed,
    )
    temporal_filter: BoolProperty(
        name="Temporal Filter",
        description="In viewports, blend indirect light with that of the pictures before, where they saw the same "
        "surface",
        default=True,
        update=changed,
    )
    paper_composite: BoolProperty(
        name="Composite of the Paper (Not Energy-Correct)",
        description="Combine light as the authors of the method do, with more saturated colors and ambient light where "
        "nothing was found: looks as in their paper, but not like Cycles",
        default=False,
        update=changed,
    )
    render: PointerProperty(
        name="Render",
        description="Numbers of final renders",
        type=DeepGBufferIndirectQuality,
    )
    viewport: PointerProperty(
        name="Viewport",
        description="Numbers of viewports",
        type=DeepGBufferIndirectQuality,
    )
