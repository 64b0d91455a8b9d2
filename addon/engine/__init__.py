# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's callbacks turned into jobs: final renders, viewports, previews, and what they cost."""

import atexit

import bpy

from ..render import stop_gl_thread
from . import sessions, statistics, viewport
from .engine import DeepGBufferEngine

__all__ = ["DeepGBufferEngine", "register", "statistics", "unregister"]


@bpy.app.handlers.persistent
def _before_load(_path: str) -> None:
    """The file is about to be replaced: nothing that was mirrored exists any more."""
    _release()


@bpy.app.handlers.persistent
def _job_begins(scene: bpy.types.Scene, *_arguments: object) -> None:
    """F12, an animation or `blender -b` begins."""
    sessions.begin_job()
    statistics.forget(scene.name)


@bpy.app.handlers.persistent
def _job_ends(scene: bpy.types.Scene, *_arguments: object) -> None:
    """It ended or was cancelled."""
    if not scene.render.use_persistent_data:
        sessions.release_renderers()


def _release() -> None:
    viewport.release()
    sessions.release()
    statistics.clear()


def register() -> None:
    """Make the engine known to Blender."""
    bpy.utils.register_class(DeepGBufferEngine)
    bpy.app.handlers.load_pre.append(_before_load)
    bpy.app.handlers.render_init.append(_job_begins)
    bpy.app.handlers.render_complete.append(_job_ends)
    bpy.app.handlers.render_cancel.append(_job_ends)
    atexit.register(unregister)  # bpy 4.5 as a module does not end cleanly while Python classes are registered


def unregister() -> None:
    """Free everything, stop the GL thread, and take the engine away."""
    atexit.unregister(unregister)
    bpy.app.handlers.load_pre.remove(_before_load)
    bpy.app.handlers.render_init.remove(_job_begins)
    bpy.app.handlers.render_complete.remove(_job_ends)
    bpy.app.handlers.render_cancel.remove(_job_ends)
    _release()
    stop_gl_thread()
    bpy.utils.unregister_class(DeepGBufferEngine)
