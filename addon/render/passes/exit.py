# SPDX-License-Identifier: GPL-3.0-or-later
"""The exit surfaces: where a ray that enters a layer's solid leaves it, the first back face behind each layer."""

from collections.abc import Iterator

from ..device import Device
from ..layout import EXIT_CHANNELS
from ..plan import PlannedPass
from ..programs import ProgramSpec
from .base import Frame
from .rasterize import GeometryProgram, GeometryView, Rasterizer


class ExitPass:
    """Draws every batch once more, keeping back faces behind the finished layers."""

    name = "exit"

    def __init__(self, device: Device) -> None:
        self._rasterizer = Rasterizer(device)

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """None of its own: its programs are among the G-buffer's."""
        yield from ()

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """Nothing; draws and geometry are the view's."""

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Draw the exit of every layer, the way the layers were drawn."""
        plan = frame.plan
        names = tuple(channel.target_name for channel in EXIT_CHANNELS)
        program = GeometryProgram(EXIT_CHANNELS, frozenset({"EXIT"}), plan.drawn_layers, frame.layering)
        layers = frame.pool.texture("gbuffer.view_depth")
        turns = (None,) if plan.one_pass else range(plan.layers)
        for into in turns:
            view = GeometryView(frame.moment, program, names, into, first_layer=into or 0, oracle=layers)
            self._rasterizer.draw(frame, view)

    def release(self) -> None:
        """Free the pass's uniforms."""
        self._rasterizer.release()
