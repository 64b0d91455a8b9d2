# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects that a scene asks for and that are not rendered yet, told once per final render."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .changes import Messages

if TYPE_CHECKING:
    import bpy


def effect_messages(depsgraph: bpy.types.Depsgraph, messages: Messages) -> None:
    """Report the effects that the scene of `depsgraph` would show; nothing while editing."""
    if depsgraph.mode != "RENDER":
        return
    scene: Any = depsgraph.scene_eval
    camera = scene.camera
    if camera is not None and camera.type == "CAMERA" and camera.data.dof.use_dof:
        text = f"Camera “{camera.name}” has depth of field, which is not rendered yet; everything is in focus."
        messages.add("camera", "depth of field", text)
    if scene.render.use_motion_blur:
        messages.add("scene", "motion blur", "Motion blur is not rendered yet; moving objects are shown sharp.")
