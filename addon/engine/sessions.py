# SPDX-License-Identifier: GPL-3.0-or-later
"""What outlives an engine object: Blender makes and destroys one per frame, mirrors and GPU data stay here.

Everything is keyed by plain numbers and names; nothing here holds a reference to Blender's data.
"""

from dataclasses import dataclass, field

import bpy

from ..render import Device, Renderer, gl_thread
from ..sync import Mirror


@dataclass
class FinalSession:
    """One view layer's mirror and renderer, kept from frame to frame. The renderer lives on the GL thread."""

    mirror: Mirror = field(default_factory=Mirror)
    renderer: Renderer | None = None

    def renderer_on(self, device: Device) -> Renderer:
        """The renderer, made on first use. Call inside GL jobs only."""
        if self.renderer is None:
            self.renderer = Renderer(device)
        return self.renderer

    def release(self) -> None:
        """Give the GPU data back; does not wait for it."""
        if self.renderer is not None:
            renderer, self.renderer = self.renderer, None
            gl_thread().submit(lambda _device: renderer.release())


_final: dict[tuple[int, str], FinalSession] = {}
_mirrors: dict[tuple[int, str], Mirror] = {}
_reported: set[str] = set()
"""Warnings of the render job under way, an animation's every frame included."""


def _key(depsgraph: bpy.types.Depsgraph) -> tuple[int, str]:
    scene, view_layer = depsgraph.scene, depsgraph.view_layer
    assert scene is not None
    assert view_layer is not None
    return scene.session_uid, view_layer.name


def _forget_deleted(kept: dict[tuple[int, str], FinalSession] | dict[tuple[int, str], Mirror]) -> None:
    """Drop the sessions of scenes and view layers that are no longer in the file."""
    present = {(scene.session_uid, layer.name) for scene in bpy.data.scenes for layer in scene.view_layers}
    for key in kept.keys() - present:
        gone = kept.pop(key)
        if isinstance(gone, FinalSession):
            gone.release()


def final(depsgraph: bpy.types.Depsgraph) -> FinalSession:
    """The session of the final renders of this scene and view layer."""
    _forget_deleted(_final)
    return _final.setdefault(_key(depsgraph), FinalSession())


def viewport_mirror(depsgraph: bpy.types.Depsgraph) -> Mirror:
    """The mirror that all viewports of this scene and view layer share."""
    _forget_deleted(_mirrors)
    return _mirrors.setdefault(_key(depsgraph), Mirror())


def release_viewport_mirrors() -> None:
    """Forget the scenes that viewports showed; for when no viewport is left."""
    _mirrors.clear()


def unreported(warnings: tuple[str, ...]) -> list[str]:
    """Those of `warnings` that the render job has not reported before; each is taken as reported then."""
    fresh = [text for text in dict.fromkeys(warnings) if text not in _reported]
    _reported.update(fresh)
    return fresh


def begin_job() -> None:
    """A new render job begins: every warning may be reported again."""
    _reported.clear()


def release_renderers() -> None:
    """Give the GPU data of final renders back; what was read of their scenes is kept, to read only changes again."""
    for session in _final.values():
        session.release()


def release() -> None:
    """Forget every scene and give all GPU data of final renders back."""
    release_renderers()
    _final.clear()
    _mirrors.clear()
