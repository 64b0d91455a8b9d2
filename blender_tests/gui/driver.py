# SPDX-License-Identifier: GPL-3.0-or-later
"""Viewports and final renders in a real Blender window, as a user makes them. See steps.py.

Final renders are written as NAME_final.png. This only does and records.
"""

import math
import subprocess
import sys
import threading
from collections.abc import Iterator

import bpy

sys.path.append(sys.argv[sys.argv.index("--") + 1])

from steps import (
    FOLDER,
    PACKAGE,
    frames,
    install,
    main_region,
    module,
    results,
    run,
    screenshot,
    viewports,
    wait,
    window,
)

SAMPLES = 8
VARIANTS = ("TWO_PASS", "DELAY", "PREVIOUS", "REPROJECT")
FILLS_THE_REGION = (2.0 - math.sqrt(2.0)) * 50.0
"""The camera view's zoom at which the camera's frame is as large as the region."""


def settled() -> bool:
    """Whether every viewport shows the finished picture of its newest view."""
    kept = module("engine.viewport")._viewports.values()
    return bool(kept) and all(
        not item.outdated
        and not item.session.busy
        and (item.session.error is not None or (item.session.picture is not None and item.session.picture.complete))
        for item in kept
    )


def settle() -> Iterator[None]:
    """Let every viewport redraw, then refine to its end."""
    for area in viewports():
        area.tag_redraw()
    yield from frames(3)
    yield from wait(settled)
    yield from frames(3)


def f12(name: str) -> Iterator[None]:
    """Render as F12 does, in Blender's job, and save the result as Blender's own save does."""
    with bpy.context.temp_override(window=window()):
        bpy.ops.render.render("INVOKE_DEFAULT")
    yield from wait(lambda: bpy.app.is_job_running("RENDER"))
    yield from wait(lambda: not bpy.app.is_job_running("RENDER"))
    bpy.data.images["Render Result"].save_render(str(FOLDER / f"{name}_final.png"))


def build_scene() -> None:
    """The default cube in colour, on a floor, lit directly only, and nothing in front of the picture."""
    scene = bpy.context.scene
    scene.render.engine = "DEEP_GBUFFER"
    scene.render.preview_pixel_size = "1"
    scene.render.dither_intensity = 0.0
    scene.deep_gbuffer.samples = scene.deep_gbuffer.viewport_samples = SAMPLES
    scene.deep_gbuffer.indirect.method = "NONE"
    color("Material", (0.8, 0.1, 0.05))
    bpy.ops.mesh.primitive_plane_add(size=12.0, location=(0.0, 0.0, -1.0))
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    bpy.context.preferences.view.render_display_type = "NONE"


def color(material: str, value: tuple[float, float, float]) -> None:
    """Edit a material's base colour."""
    nodes = bpy.data.materials[material].node_tree.nodes
    nodes["Principled BSDF"].inputs["Base Color"].default_value = (*value, 1.0)


def look_through_camera(area) -> None:
    """A bare viewport that the camera's frame fills, and a render resolution equal to it."""
    space = area.spaces.active
    space.shading.type = "RENDERED"
    space.overlay.show_overlays = space.show_gizmo = False
    space.show_region_header = space.show_region_tool_header = space.show_region_toolbar = False
    space.region_3d.view_perspective = "CAMERA"
    space.region_3d.view_camera_zoom = FILLS_THE_REGION
    space.region_3d.view_camera_offset = (0.0, 0.0)


def match_resolution(area) -> None:
    """Render as many pixels as the viewport has."""
    render, region = bpy.context.scene.render, main_region(area)
    render.resolution_x, render.resolution_y, render.resolution_percentage = region.width, region.height, 100


def scenario() -> Iterator[None]:
    """Everything, in order."""
    yield from frames(5)
    install()
    build_scene()
    area = viewports()[0]
    area.spaces.active.shading.type = "RENDERED"
    yield from settle()
    screenshot("first")
    yield from camera_view(area)
    yield from edits(area)
    yield from variants()
    yield from border(area)
    yield from undo_while_rendering()
    yield from cancel()
    yield from previews()
    yield from two_viewports(area)
    yield from leave(area)


def camera_view(area) -> Iterator[None]:
    """The camera's picture in the viewport and by F12."""
    look_through_camera(area)
    yield from frames(5)
    match_resolution(area)
    yield from settle()
    screenshot("camera")
    yield from f12("camera")


def edits(area) -> Iterator[None]:
    """A material, an object and a debug view change the picture."""
    settings = bpy.context.scene.deep_gbuffer
    color("Material", (0.05, 0.6, 0.1))
    yield from settle()
    screenshot("edited")
    bpy.data.objects["Cube"].location.x = 1.0
    yield from settle()
    screenshot("moved")
    bpy.data.objects["Cube"].location.x = 0.0
    settings.debug_view = "NORMAL"
    yield from settle()
    screenshot("debug")
    yield from f12("debug")
    settings.debug_view = "NONE"


def variants() -> Iterator[None]:
    """The second layer after the camera went away and came back, found in several ways."""
    settings, camera = bpy.context.scene.deep_gbuffer, bpy.data.objects["Camera"]
    settings.debug_view, settings.debug_layer = "DIRECT", 2
    place = camera.location.copy()
    for variant in VARIANTS:
        settings.variant = variant
        for distance in (0.1, 0.2, 0.1, 0.0):
            camera.location.x = place.x + distance
            yield from frames(3)
        yield from settle()
        screenshot(variant)
    settings.variant, settings.debug_view, settings.debug_layer = VARIANTS[0], "NONE", 1


def border(area) -> Iterator[None]:
    """A render region in camera view, and in the final render."""
    render = bpy.context.scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.25, 0.75
    yield from settle()
    screenshot("border")
    yield from f12("border")
    render.use_border = False


def undo_while_rendering() -> Iterator[None]:
    """Undo frees Blender's data while the GL thread renders."""
    settings = bpy.context.scene.deep_gbuffer
    with bpy.context.temp_override(window=window()):
        bpy.ops.ed.undo_push(message="before")
        settings.viewport_samples = 100_000
        bpy.data.objects["Cube"].location.z = 1.0
        bpy.ops.ed.undo_push(message="moved")
    steps = 0
    for _ in range(5):
        for operator in (bpy.ops.ed.undo, bpy.ops.ed.redo):
            yield from frames(3)
            with bpy.context.temp_override(window=window()):
                operator()
            steps += 1
    with bpy.context.temp_override(window=window()):
        bpy.ops.ed.undo()
    bpy.context.scene.deep_gbuffer.viewport_samples = SAMPLES
    yield from settle()
    results["undo"] = {"steps": steps, "z": bpy.data.objects["Cube"].location.z}
    screenshot("undone")


def cancel() -> Iterator[None]:
    """Esc ends a long final render and leaves nothing behind."""
    settings = bpy.context.scene.deep_gbuffer
    settings.samples = 100_000
    with bpy.context.temp_override(window=window()):
        bpy.ops.render.render("INVOKE_DEFAULT")
    yield from wait(lambda: bpy.app.is_job_running("RENDER"))
    yield from frames(20)
    subprocess.run(["xdotool", "mousemove", "400", "400", "key", "Escape"], check=True)
    yield from wait(lambda: not bpy.app.is_job_running("RENDER"))
    last = module("engine.statistics").last(bpy.context.scene.name)
    results["cancelled"] = {"samples": last["samples"], "queued": module("render").gl_thread()._jobs.qsize()}
    settings.samples = SAMPLES


def previews() -> Iterator[None]:
    """A material's preview icon is rendered by our engine."""
    preview = module("engine.preview")
    original, calls = preview.render, []

    def counted(engine, depsgraph):
        calls.append(depsgraph.scene.name)
        return original(engine, depsgraph)

    preview.render = counted
    material = bpy.data.materials["Material"]
    icon = material.preview_ensure()
    icon.reload()
    with bpy.context.temp_override(window=window(), id=material):
        bpy.ops.ed.lib_id_generate_preview()
    yield from wait(lambda: bool(calls) and any(icon.image_pixels_float))
    preview.render = original
    pixels = list(icon.image_pixels_float)
    means = [sum(pixels[channel::4]) / len(pixels[channel::4]) for channel in range(4)]
    results["preview"] = {"renders": len(calls), "means": means}


def two_viewports(area) -> Iterator[None]:
    """Splitting makes the old viewport narrower, and adds one with a view of its own."""
    with bpy.context.temp_override(window=window(), area=area, region=main_region(area)):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.5)
    yield from frames(1)
    for each in viewports():
        each.spaces.active.shading.type = "RENDERED"
    viewports()[1].spaces.active.region_3d.view_perspective = "PERSP"
    yield from frames(2)
    screenshot("split")
    yield from settle()
    screenshot("two")
    results["sessions of two"] = len(module("engine.viewport")._viewports)


def leave(area) -> Iterator[None]:
    """Every way to leave: another editor, another shading, another file, the add-on switched off."""
    viewport = module("engine.viewport")
    left, right = viewports()
    right.type = "IMAGE_EDITOR"
    yield from wait(lambda: len(viewport._viewports) == 1)
    left.spaces.active.shading.type = "SOLID"
    yield from wait(lambda: not viewport._viewports)
    yield from wait(lambda: not bpy.app.timers.is_registered(viewport._tick))
    left.spaces.active.shading.type = "RENDERED"
    yield from settle()
    bpy.ops.wm.read_homefile()
    results["sessions after loading"] = len(viewport._viewports)
    yield from frames(5)
    bpy.ops.preferences.addon_disable(module=PACKAGE)
    results["threads"] = [thread.name for thread in threading.enumerate() if thread.name == "GLThread"]
    results["finished"] = True


run(scenario())
