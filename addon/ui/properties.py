# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's settings of the engine: `Scene.deep_gbuffer`."""

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ..engine import viewport
from ..engine.settings import GuardBandUnit, SeparationUnit
from ..scene import DebugView, ShadingModel, Variant
from ..scene.settings import MAXIMUM_LAYERS

_SCENE: Any = bpy.types.Scene  # takes properties that its type does not name
# Files store an item's place in its list: new ones go to the end.
DEBUG_ITEMS = [
    (DebugView.NONE.value, "Rendered", "The finished picture"),
    (DebugView.DEPTH.value, "Depth", "Distance from the camera plane"),
    (DebugView.NORMAL.value, "Normal", "World-space shading normal"),
    (DebugView.ALBEDO.value, "Albedo", "Base color of the surface"),
    (DebugView.METALLIC.value, "Metallic", "How metallic the surface is"),
    (DebugView.ROUGHNESS.value, "Roughness", "Perceptual roughness of the surface"),
    (DebugView.EMISSION.value, "Emission", "Radiance that the surface itself emits"),
    (DebugView.OBJECT_INDEX.value, "Object Index", "Pass index of the object"),
    (DebugView.DIRECT.value, "Direct Light", "Light that reaches the layer straight from lights and world"),
    (
        DebugView.MOTION.value,
        "Motion",
        "Movement since the previous frame: gray at rest, redder to the right, greener upwards",
    ),
    (
        DebugView.EXIT_DEPTH.value,
        "Exit Depth",
        "Distance from the camera plane where the view leaves the object again",
    ),
    (DebugView.EXIT_NORMAL.value, "Exit Normal", "World-space normal of the surface through which the view leaves"),
    (DebugView.EXIT_ALBEDO.value, "Exit Albedo", "Base color of the surface through which the view leaves"),
]
VARIANT_ITEMS = [
    (
        Variant.TWO_PASS.value,
        "Two-Pass",
        "Draw the whole scene once per layer. Always exact; scenes with many polygons take longest",
    ),
    (
        Variant.PREPASS.value,
        "Prepass",
        "Draw the scene's depth first, then all layers at once. Always exact; the depth costs an extra, plainer pass",
    ),
    (
        Variant.DELAY.value,
        "Delay",
        "Draw the next picture's depth along with each picture, then all layers at once. Always exact; viewports "
        "show every change one picture late, final renders do not",
    ),
    (
        Variant.PREVIOUS.value,
        "Previous",
        "Draw all layers at once, guided by the previous frame's depth at the same pixel. Fast in viewports, and exact "
        "at rest; around anything that moves, hidden layers miss surfaces or hold some that are too close. Final "
        "renders evaluate the frame before for it and are no faster than with Prepass",
    ),
    (
        Variant.PREDICT.value,
        "Predict",
        "Draw all layers at once, guided by where the last two frames suggest that everything is now. Exact for "
        "steady motion; sudden changes put errors into hidden layers for a frame. Final renders evaluate the two "
        "frames before for it and are no faster than with Prepass",
    ),
    (
        Variant.REPROJECT.value,
        "Reproject",
        "Draw all layers at once, comparing each surface with the previous frame where it was then. Follows any "
        "motion; small errors remain where surfaces come into view, and at the picture's edge without a guard band. "
        "Final renders evaluate the frame before for it and are no faster than with Prepass",
    ),
]
SEPARATION_ITEMS = [
    (SeparationUnit.DISTANCE.value, "Distance", "The same distance everywhere"),
    (
        SeparationUnit.RELATIVE.value,
        "Relative to Depth",
        "A fraction of the distance from the camera, for scenes that reach from near to far",
    ),
]
SHADING_ITEMS = [
    (
        ShadingModel.PHYSICAL.value,
        "Physically Based",
        "Surfaces reflect light as the Principled BSDF does in Cycles",
    ),
    (
        ShadingModel.PHONG.value,
        "Phong",
        "A preview: plain diffuse reflection and a Blinn-Phong highlight, for each pixel; does not look like Cycles",
    ),
    (
        ShadingModel.GOURAUD.value,
        "Gouraud",
        "A preview: as Phong, but for each vertex and blended in between; without shadows, and highlights show the "
        "mesh's triangles",
    ),
]
SHADOW_MAP_SIZE_ITEMS = [
    (str(2**power), f"{2**power} px", f"At most {2**power} x {2**power} pixels for one shadow map")
    for power in range(8, 14)
]
SHADOW_MEMORY_ITEMS = [
    (
        str(2**power),
        f"{2**power} MB" if power < 10 else f"{2 ** (power - 10)} GB",
        f"Keep at most {2**power} MB of them",
    )
    for power in range(4, 13)
]
GUARD_BAND_ITEMS = [
    (GuardBandUnit.PIXELS.value, "Pixels", "The same number of pixels whatever the picture's size"),
    (GuardBandUnit.PERCENT.value, "Percent", "A share of the picture's longer side"),
]


def _changed(_settings: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    """Scripts that set a property cause no redraw by themselves."""
    viewport.redraw()


class DeepGBufferSettings(bpy.types.PropertyGroup):
    """Settings of the Deep G-Buffer engine."""

    samples: IntProperty(
        name="Render Samples",
        description="Samples per pixel of the final render: more give smoother edges, lights and indirect light",
        default=16,
        min=1,
        soft_max=256,
        max=65536,
    )
    viewport_samples: IntProperty(
        name="Viewport Samples",
        description="Samples per pixel after which a viewport stops refining",
        default=16,
        min=1,
        soft_max=256,
        max=65536,
        update=_changed,
    )
    time_limit: FloatProperty(
        name="Time Limit",
        description="Stop the final render of a view layer after this time with the samples it has; 0 for no limit",
        default=0.0,
        min=0.0,
        soft_max=60.0,
        max=86400.0,
        step=100,
        unit="TIME_ABSOLUTE",
    )
    seed: IntProperty(
        name="Seed",
        description="Changes every sampling pattern; equal seeds give equal pictures",
        default=0,
        min=0,
        max=2**31 - 1,
        update=_changed,
    )
    layers: IntProperty(
        name="Layers",
        description="Surfaces behind one another that the deep G-buffer keeps per pixel",
        default=2,
        min=1,
        max=MAXIMUM_LAYERS,
        update=_changed,
    )
    variant: EnumProperty(
        name="Variant",
        description="How the layers behind the nearest surfaces are found: what is exact, and what is faster",
        items=VARIANT_ITEMS,
        default=Variant.TWO_PASS.value,
        update=_changed,
    )
    separation_unit: EnumProperty(
        name="Separation",
        description="What the minimum separation of layers is measured in",
        items=SEPARATION_ITEMS,
        default=SeparationUnit.DISTANCE.value,
        update=_changed,
    )
    minimum_separation: FloatProperty(
        name="Minimum Separation",
        description="Least distance along the view between a layer and the next: closer surfaces are skipped, so that "
        "layers hold what is really hidden instead of details right behind a surface",
        default=0.5,
        min=0.0,
        soft_max=10.0,
        precision=3,
        subtype="DISTANCE",
        update=_changed,
    )
    relative_separation: FloatProperty(
        name="Minimum Separation",
        description="Least distance along the view between a layer and the next, as a fraction of the layer's own "
        "distance: closer surfaces are skipped, near the camera finer ones than far away",
        default=0.05,
        min=0.0,
        soft_max=1.0,
        precision=3,
        subtype="FACTOR",
        update=_changed,
    )
    use_guard_band: BoolProperty(
        name="Guard Band",
        description="Render past the picture's edge internally, so that effects which look up neighboring pixels or "
        "the previous frame find data there; the picture itself keeps its size",
        default=False,
        update=_changed,
    )
    guard_band_unit: EnumProperty(
        name="Unit",
        description="What the width of the guard band is measured in",
        items=GUARD_BAND_ITEMS,
        default=GuardBandUnit.PIXELS.value,
        update=_changed,
    )
    guard_band_pixels: IntProperty(
        name="Width",
        description="Pixels that are rendered past each edge of the picture",
        default=64,
        min=0,
        soft_max=256,
        max=4096,
        subtype="PIXEL",
        update=_changed,
    )
    guard_band_percent: FloatProperty(
        name="Width",
        description="Percentage of the picture's longer side that is rendered past each edge",
        default=3.0,
        min=0.0,
        soft_max=10.0,
        max=50.0,
        subtype="PERCENTAGE",
        update=_changed,
    )
    shading_model: EnumProperty(
        name="Shading",
        description="How surfaces reflect the light that reaches them directly. Phong and Gouraud are previews",
        items=SHADING_ITEMS,
        default=ShadingModel.PHYSICAL.value,
        update=_changed,
    )
    light_threshold: FloatProperty(
        name="Light Threshold",
        description="With many lights, one that adds less than this to a white surface is sampled only now and then: "
        "higher values are faster and noisier, in the mean nothing is lost; 0 samples every light always",
        default=0.01,
        min=0.0,
        soft_max=1.0,
        precision=3,
        update=_changed,
    )
    world_directions: IntProperty(
        name="World Directions",
        description="From how many directions the world lights each sample, brighter ones being likelier: more give "
        "less noise under a sky, and take longer",
        default=8,
        min=1,
        soft_max=16,
        max=64,
        update=_changed,
    )
    shadow_map_size: EnumProperty(
        name="Shadow Map Size",
        description="Pixels of the largest shadow maps on each side: more give sharper shadows of fine things. Each "
        "map is only as large as what the view shows of its shadows",
        items=SHADOW_MAP_SIZE_ITEMS,
        default="2048",
        update=_changed,
    )
    shadow_memory: EnumProperty(
        name="Shadow Pool Size",
        description="Graphics memory for shadow maps: with more, more lights keep theirs while nothing moves; with "
        "less, maps are smaller",
        items=SHADOW_MEMORY_ITEMS,
        default="512",
        update=_changed,
    )
    shadow_updates: IntProperty(
        name="Lights per Sample",
        description="How many lights get new shadow maps, seen from another point of theirs, in each sample; with more "
        "lights, the rest keep theirs until it is their turn. Lower values are faster and take more samples to "
        "become as soft",
        default=16,
        min=1,
        soft_max=64,
        max=1024,
        update=_changed,
    )
    debug_view: EnumProperty(
        name="Debug View",
        description="Show one channel of the deep G-buffer instead of the picture, in viewports and final renders",
        items=DEBUG_ITEMS,
        default=DebugView.NONE.value,
        update=_changed,
    )
    debug_layer: IntProperty(
        name="Layer",
        description="Layer of the deep G-buffer that the debug view shows, 1 being the nearest",
        default=1,
        min=1,
        max=MAXIMUM_LAYERS,
        update=_changed,
    )
    save_layers: BoolProperty(
        name="Multi-Layer EXR",
        description="Write every channel of every layer to a multi-layer OpenEXR file after a final render",
        default=False,
    )
    save_motion: BoolProperty(
        name="Motion Vectors",
        description="Add how many pixels each layer's surfaces moved since the previous frame, which is evaluated for "
        "it",
        default=False,
    )
    save_exit: BoolProperty(
        name="Exit Surfaces",
        description="Add depth, normal and base color of where the view leaves the objects of each layer again; in a "
        "deep EXR, this depth ends each sample (ZBack)",
        default=False,
    )
    save_deep: BoolProperty(
        name="Deep EXR",
        description="Write depth and color of every layer to a deep OpenEXR file after a final render, one sample "
        "per layer and pixel, for deep compositing",
        default=False,
    )
    save_snapshot: BoolProperty(
        name="Scene Snapshot",
        description="Write the scene as plain arrays (.npz) after a final render; build.py renders it on machines "
        "without Blender",
        default=False,
    )
    layers_path: StringProperty(
        name="Layer Output Path",
        description="Where these files are written. # stands for a digit of the frame number, // for the folder of "
        "the .blend; a folder takes the .blend's name",
        default="//",
        subtype="FILE_PATH",
    )


def register() -> None:
    """Give scenes their settings."""
    bpy.utils.register_class(DeepGBufferSettings)
    _SCENE.deep_gbuffer = bpy.props.PointerProperty(type=DeepGBufferSettings)


def unregister() -> None:
    """Take the settings away."""
    del _SCENE.deep_gbuffer
    bpy.utils.unregister_class(DeepGBufferSettings)
