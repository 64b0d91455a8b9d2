# SPDX-License-Identifier: GPL-3.0-or-later
"""The exit surfaces: where a ray that enters a layer's solid leaves it, the first back face behind each layer."""

from ..layout import EXIT_CHANNELS
from ..plan import PlannedPass
from .base import Frame
from .rasterize import GeometryPass, GeometryProgram, GeometryView


class ExitPass(GeometryPass):
    """Draws every batch once more, keeping back faces behind the finished layers."""

    name = "exit"

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Draw the exit of every layer, the way the layers were drawn."""
        plan = frame.plan
        names = tuple(channel.target_name for channel in EXIT_CHANNELS)
        at_once = plan.layers if plan.one_pass else 1
        program = GeometryProgram(EXIT_CHANNELS, frozenset({"EXIT"}), at_once, frame.layering)
        layers = frame.pool.texture("gbuffer.view_depth")
        turns = (None,) if plan.one_pass else range(plan.layers)
        for into in turns:
            view = GeometryView(frame.moment, program, names, into, first_layer=into or 0, oracle=layers)
            self._rasterizer.draw(frame, view)
