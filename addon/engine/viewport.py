# SPDX-License-Identifier: GPL-3.0-or-later
"""Viewports: `update` syncs, `draw` asks for the current view and paints the newest finished picture, at once.

A timer on Blender's thread looks for newer pictures and for viewports that are gone; the GL thread never calls
Blender.
"""

import logging
from dataclasses import replace
from typing import Any

import bpy

from ..scene import Camera, Scene
from ..sync import Mirror, render_camera, viewport_camera, without_hidden
from . import messages, regions, sessions, settings, statistics
from .presenter import Presenter
from .viewport_session import ViewportSession

logger = logging.getLogger(__name__)

BUSY_SECONDS = 1 / 60
IDLE_SECONDS = 0.25


class Viewport:
    """What Blender's thread keeps of one viewport region."""

    def __init__(self) -> None:
        self.session = ViewportSession()
        self.presenter = Presenter()
        self._mirror: Mirror | None = None
        self._scene = Scene()
        self._warnings: tuple[str, ...] = ()
        self._fault: str | None = None
        self._drawn = -1

    @property
    def outdated(self) -> bool:
        """Whether there is something newer to paint than what was painted last."""
        return self.session.revision != self._drawn

    def sync(self, depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D) -> None:
        """Read the scene again. A scene in which nothing that the viewport shows changed is not taken over."""
        mirror = sessions.viewport_mirror(depsgraph)
        synced = mirror.sync(depsgraph, space)
        scene = without_hidden(synced.scene, synced.hidden, self._scene)
        self._warnings, self._fault = synced.warnings, None
        if mirror is not self._mirror or replace(scene.versions, camera=0) != replace(self._scene.versions, camera=0):
            self._mirror, self._scene = mirror, scene

    def draw(self, engine: bpy.types.RenderEngine, context: Any, depsgraph: Any) -> None:
        """Ask for the current view and paint the newest picture."""
        if self._mirror is not sessions.viewport_mirror(depsgraph):
            self.sync(depsgraph, context.space_data)
        region = context.region
        space = context.space_data
        view = viewport_camera(depsgraph, space, context.region_data)
        frame = _frame(context, depsgraph)
        rectangle = regions.viewport_rectangle(depsgraph.scene, space, region, view, frame)
        if rectangle.empty:
            self.presenter.message(messages.EMPTY_REGION, region)
            return
        pixel_size = int(engine.get_preview_pixel_size(depsgraph.scene))
        self.session.show(
            self._scene,
            view.cropped(*rectangle.fractions(region.width, region.height)),
            settings.viewport(depsgraph.scene, *rectangle.pixels(pixel_size)),
        )
        self._drawn = self.session.revision
        picture, error = self.session.picture, self.session.error
        if picture is not None:
            self.presenter.picture(picture, rectangle)
        error = self._fault or error
        if error is not None:
            self.presenter.message(error, region)
        elif picture is None:
            self.presenter.message(messages.PREPARING, region)
        else:
            progress = f"Sample {picture.samples}/{picture.view.settings.samples}"
            engine.update_stats("", messages.status(progress, self._warnings))

    def fail(self, error: Exception) -> None:
        """Remember a fault of our own until the next sync, to be painted."""
        logger.error("the viewport failed", exc_info=error)
        self._fault = messages.internal(error)

    def release(self) -> None:
        """Stop rendering and free the GPU data; does not wait for it."""
        self.session.close()
        self.presenter.release()


_viewports: dict[int, Viewport] = {}


def update(context: Any, depsgraph: bpy.types.Depsgraph) -> None:
    """Blender's data changed: read it again."""
    viewport = _viewport(context.region)
    try:
        viewport.sync(depsgraph, context.space_data)
    except Exception as error:  # Blender would print it and go on showing the old scene
        viewport.fail(error)


def draw(engine: bpy.types.RenderEngine, context: Any, depsgraph: bpy.types.Depsgraph) -> None:
    """Ask for the region's current view, and paint the newest finished picture. Never waits for the GL thread."""
    viewport = _viewport(context.region)
    try:
        viewport.draw(engine, context, depsgraph)
    except Exception as error:  # Blender would print it and leave the region empty
        viewport.fail(error)
        viewport.presenter.message(messages.internal(error), context.region)


def redraw() -> None:
    """Have every viewport painted again, because a setting changed."""
    for region in _shown_regions().values():
        region.tag_redraw()


def release() -> None:
    """Close every viewport's session and stop the timer."""
    for viewport in _viewports.values():
        viewport.release()
    _viewports.clear()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)


def _viewport(region: bpy.types.Region) -> Viewport:
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick)
    return _viewports.setdefault(region.as_pointer(), Viewport())


def _frame(context: Any, depsgraph: Any) -> Camera | None:
    """The scene camera's own picture where the region looks through it, else None."""
    space = context.space_data
    through_another = space.use_local_camera and space.camera != depsgraph.scene.camera
    if context.region_data.view_perspective != "CAMERA" or through_another:
        return None
    render = depsgraph.scene.render
    scale = render.resolution_percentage / 100
    return render_camera(depsgraph, int(render.resolution_x * scale), int(render.resolution_y * scale))


def _tick() -> float | None:
    """Redraw regions that have a newer picture, release those that are gone; the seconds until the next look."""
    shown = _shown_regions()
    for pointer in _viewports.keys() - shown.keys():
        _viewports.pop(pointer).release()
    if not _viewports:
        sessions.release_viewport_mirrors()
        return None
    for pointer, viewport in _viewports.items():
        if viewport.outdated:
            shown[pointer].tag_redraw()
    return BUSY_SECONDS if any(viewport.session.busy for viewport in _viewports.values()) else IDLE_SECONDS


def _windows() -> list[Any]:
    """Blender's windows that show a scene of our engine."""
    windows = [window for manager in bpy.data.window_managers for window in manager.windows]
    return [window for window in windows if window.scene.render.engine == statistics.ENGINE]


def _shown_regions() -> dict[int, Any]:
    """Every region that our engine draws now, by address."""
    return {
        region.as_pointer(): region
        for window in _windows()
        for area in window.screen.areas
        if area.type == "VIEW_3D" and area.spaces.active.shading.type == "RENDERED"
        for region in area.regions
        if region.type == "WINDOW"
    }
