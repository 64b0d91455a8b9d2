# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's settings of the engine: `Scene.deep_gbuffer`."""

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from ..engine.settings import GuardBandUnit, SeparationUnit
from ..scene import DebugView, ShadingModel, Variant
from ..scene.settings import MAXIMUM_LAYERS
from .changes import changed
from .choices import (
    DEBUG_ITEMS,
    GUARD_BAND_ITEMS,
    MEMORY_ITEMS,
    SEPARATION_ITEMS,
    SHADING_ITEMS,
    SHADOW_MAP_SIZE_ITEMS,
    VARIANT_ITEMS,
)
from .indirect_properties import DeepGBufferIndirectQuality, DeepGBufferIndirectSettings

_SCENE: Any = bpy.types.Scene  # takes properties that its type does not name


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
        update=changed,
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
    use_noise_threshold: BoolProperty(
        name="Use Noise Threshold",
        description="Stop the final render of a view layer with fewer samples where its noise is low enough",
        default=False,
    )
    noise_threshold: FloatProperty(
        name="Noise Threshold",
        description="Noise at which the final render of a view layer stops: lower values take more samples. It is "
        "estimated as in Cycles, where the picture is noisiest, whenever the number of samples has doubled",
        default=0.01,
        min=1e-5,
        soft_min=0.001,
        soft_max=1.0,
        max=10.0,
        step=1,
        precision=4,
    )
    seed: IntProperty(
        name="Seed",
        description="Changes every sampling pattern; equal seeds give equal pictures",
        default=0,
        min=0,
        max=2**31 - 1,
        update=changed,
    )
    layers: IntProperty(
        name="Layers",
        description="Surfaces behind one another that the deep G-buffer keeps per pixel",
        default=2,
        min=1,
        max=MAXIMUM_LAYERS,
        update=changed,
    )
    variant: EnumProperty(
        name="Variant",
        description="How the layers behind the nearest surfaces are found: what is exact, and what is faster",
        items=VARIANT_ITEMS,
        default=Variant.TWO_PASS.value,
        update=changed,
    )
    separation_unit: EnumProperty(
        name="Separation",
        description="What the minimum separation of layers is measured in",
        items=SEPARATION_ITEMS,
        default=SeparationUnit.DISTANCE.value,
        update=changed,
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
        update=changed,
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
        update=changed,
    )
    use_guard_band: BoolProperty(
        name="Guard Band",
        description="Render past the picture's edge internally, so that effects which look up neighboring pixels or "
        "the previous frame find data there; the picture itself keeps its size",
        default=False,
        update=changed,
    )
    guard_band_unit: EnumProperty(
        name="Unit",
        description="What the width of the guard band is measured in",
        items=GUARD_BAND_ITEMS,
        default=GuardBandUnit.PIXELS.value,
        update=changed,
    )
    guard_band_pixels: IntProperty(
        name="Width",
        description="Pixels that are rendered past each edge of the picture",
        default=64,
        min=0,
        soft_max=256,
        max=4096,
        subtype="PIXEL",
        update=changed,
    )
    guard_band_percent: FloatProperty(
        name="Width",
        description="Percentage of the picture's longer side that is rendered past each edge",
        default=3.0,
        min=0.0,
        soft_max=10.0,
        max=50.0,
        subtype="PERCENTAGE",
        update=changed,
    )
    shading_model: EnumProperty(
        name="Shading",
        description="How surfaces reflect the light that reaches them directly. Phong and Gouraud are previews",
        items=SHADING_ITEMS,
        default=ShadingModel.PHYSICAL.value,
        update=changed,
    )
    light_threshold: FloatProperty(
        name="Light Threshold",
        description="With many lights, one that adds less than this to a white surface is sampled only now and then: "
        "higher values are faster and noisier, in the mean nothing is lost; 0 samples every light always",
        default=0.01,
        min=0.0,
        soft_max=1.0,
        precision=3,
        update=changed,
    )
    world_directions: IntProperty(
        name="World Directions",
        description="From how many directions the world lights each sample, brighter ones being likelier: more give "
        "less noise under a sky, and take longer",
        default=8,
        min=1,
        soft_max=16,
        max=64,
        update=changed,
    )
    shadow_map_size: EnumProperty(
        name="Shadow Map Size",
        description="Pixels of the largest shadow maps on each side: more give sharper shadows of fine things. Each "
        "map is only as large as what the view shows of its shadows",
        items=SHADOW_MAP_SIZE_ITEMS,
        default="2048",
        update=changed,
    )
    shadow_memory: EnumProperty(
        name="Shadow Pool Size",
        description="Graphics memory for shadow maps: with more, more lights keep theirs while nothing moves; with "
        "less, maps are smaller",
        items=MEMORY_ITEMS,
        default="512",
        update=changed,
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
        update=changed,
    )
    indirect: PointerProperty(
        name="Indirect Light",
        description="Settings of light that surfaces reflect at each other",
        type=DeepGBufferIndirectSettings,
    )
    debug_view: EnumProperty(
        name="Debug View",
        description="Show one channel of the deep G-buffer instead of the picture, in viewports and final renders",
        items=DEBUG_ITEMS,
        default=DebugView.NONE.value,
        update=changed,
    )
    debug_layer: IntProperty(
        name="Layer",
        description="Layer of the deep G-buffer that the debug view shows, 1 being the nearest",
        default=1,
        min=1,
        max=MAXIMUM_LAYERS,
        update=changed,
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


_CLASSES = (DeepGBufferIndirectQuality, DeepGBufferIndirectSettings, DeepGBufferSettings)


def register() -> None:
    """Give scenes their settings."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    _SCENE.deep_gbuffer = PointerProperty(type=DeepGBufferSettings)


def unregister() -> None:
    """Take the settings away."""
    del _SCENE.deep_gbuffer
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
