# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine that Blender sees. It forwards each callback to the module of its mode and reports what went wrong."""

import logging
from concurrent.futures import CancelledError
from typing import Any

import bpy

from ..render import DeviceError, RenderError, ShaderError
from . import final, layer_output, messages, passes, preview, sessions, statistics, viewport

logger = logging.getLogger(__name__)


class DeepGBufferEngine(bpy.types.RenderEngine):
    """Blender makes one of these per frame and per viewport; what has to last longer is kept in `sessions`."""

    bl_idname = statistics.ENGINE
    bl_label = "Deep G-Buffer"
    bl_use_preview = True
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    def __init__(self, *args: object, **keywords: object) -> None:
        super().__init__(*args, **keywords)
        self._layers: dict[str, statistics.Measured] = {}

    def update_render_passes(  # pyright: ignore[reportIncompatibleMethodOverride] - passed by position
        self, scene: Any = None, renderlayer: Any = None
    ) -> None:
        """Tell Blender which passes will come."""
        passes.register(self, scene, renderlayer)

    def render(self, depsgraph: Any) -> None:
        """Render the view layer of `depsgraph`: F12, `blender -b`, or a preview icon."""
        try:
            if self.is_preview:
                preview.render(self, depsgraph)
            else:
                self._render_final(depsgraph)
        except CancelledError:  # the GL thread was stopped
            return
        except KeyboardInterrupt:  # Blender would print it and go on with the next frame
            self._fail(messages.INTERRUPTED)
        except (messages.EngineError, DeviceError, RenderError, ShaderError) as error:
            self._fail(str(error))
        except MemoryError:
            self._fail(messages.out_of_memory(self.resolution_x, self.resolution_y))
        except Exception as error:  # Blender would print it and show an empty picture
            logger.exception("rendering failed")
            self._fail(messages.internal(error))

    def view_update(self, context: Any, depsgraph: Any) -> None:
        """Something in the scene or the viewport's settings changed."""
        viewport.update(context, depsgraph)

    def view_draw(self, context: Any, depsgraph: Any) -> None:
        """Paint the viewport."""
        viewport.draw(self, context, depsgraph)

    def _render_final(self, depsgraph: Any) -> None:
        job = final.FinalRender(self, sessions.final(depsgraph))
        scene, layer_name = depsgraph.scene, depsgraph.view_layer.name
        finished = job.run(depsgraph)
        if layer_name in self._layers:  # Persistent Data: the same engine object renders the next frame
            self._layers.clear()
        self._layers[layer_name] = job.measured
        if scene.render.use_multiview:
            job.measured.warnings += (messages.STEREO,)
        if finished:
            saved = layer_output.save(depsgraph, job.frames, job.layers)
            job.measured.files = saved.files
            job.measured.warnings += saved.failures
        statistics.record(scene.name, list(self._layers.values()))
        for text in sessions.unreported(job.measured.warnings):
            self.report({"WARNING"}, text)

    def _fail(self, text: str) -> None:
        """Make F12 show the error, and the operator fail. (With `error_set` as well it would be shown twice.)"""
        self.report({"ERROR"}, text)
