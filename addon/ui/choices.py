# SPDX-License-Identifier: GPL-3.0-or-later
"""What the choices among our settings are called, and their tooltips.

Files store an item's place in its list: new ones go to the end.
"""

from ..engine.settings import GuardBandUnit, SeparationUnit
from ..scene import DebugView, IndirectMethod, ShadingModel, Variant
from ..scene.quality import Quality

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
    (
        DebugView.INDIRECT.value,
        "Indirect Light",
        "Light that reaches the surface after it was reflected elsewhere, as a white surface would show it",
    ),
    (
        DebugView.GRID_CELLS.value,
        "Grid Cells",
        "Cells of the radiance grid, each in a color of its own; black where there is none",
    ),
    (DebugView.GRID_RADIANCE.value, "Grid Radiance", "Light that the cells of the radiance grid send on"),
    (
        DebugView.MARCH_HITS.value,
        "March Hits",
        "Share of marched rays that met a layer of the deep G-buffer: white where all did",
    ),
    (
        DebugView.LIGHT_ORIGIN.value,
        "Light Origin",
        "Where indirect light comes from: layers of the deep G-buffer (red), radiance grid (green), world (blue)",
    ),
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
MEMORY_ITEMS = [
    (
        str(2**power),
        f"{2**power} MB" if power < 10 else f"{2 ** (power - 10)} GB",
        f"At most {2**power} MB of graphics memory",
    )
    for power in range(4, 13)
]
GUARD_BAND_ITEMS = [
    (GuardBandUnit.PIXELS.value, "Pixels", "The same number of pixels whatever the picture's size"),
    (GuardBandUnit.PERCENT.value, "Percent", "A share of the picture's longer side"),
]
METHOD_ITEMS = [
    (
        IndirectMethod.NONE.value,
        "None",
        "Only light that reaches surfaces directly",
    ),
    (
        IndirectMethod.MARCH_GRID.value,
        "March + Grid",
        "Rays that find fine detail near the pixel in the layers of the deep G-buffer, then everything else, also what "
        "the camera does not see, in a grid of cells around it, then the world",
    ),
    (
        IndirectMethod.DEEP_MARCH.value,
        "Deep March",
        "Rays marched through the layers of the deep G-buffer, then the world: finds only what is in the picture or "
        "hidden behind it",
    ),
    (
        IndirectMethod.RADIOSITY.value,
        "Radiosity",
        "Surfaces of all layers around the pixel light it as if nothing were in between: smooth and stable, but "
        "without shadows of reflected light (Mara et al. 2016)",
    ),
    (
        IndirectMethod.OCCLUSION.value,
        "Ambient Occlusion",
        "No reflected light: only the world's light, darkened where surfaces of the layers are close",
    ),
    (
        IndirectMethod.SSAO.value,
        "SSAO",
        "As Ambient Occlusion, by random comparisons of depth: noisier, kept to compare with",
    ),
]
QUALITY_ITEMS = [
    (Quality.DRAFT.value, "Draft", "Fastest; coarse and noisy, for moving about"),
    (Quality.MEDIUM.value, "Medium", "For work on lights and materials, and for many samples"),
    (Quality.HIGH.value, "High", "Finer cells and more rays, for final pictures"),
    (Quality.ULTRA.value, "Ultra", "Full resolution and the most rays; slow"),
    ("CUSTOM", "Custom", "The numbers below are of no preset: change any of them to get here"),
]
DIVISOR_ITEMS = [
    ("1", "1:1", "Every pixel gathers its own indirect light"),
    ("2", "1:2", "One pixel of 2 x 2 gathers indirect light, the others share it where they see the same surface"),
    ("4", "1:4", "One pixel of 4 x 4 gathers indirect light, the others share it where they see the same surface"),
]
