# SPDX-License-Identifier: GPL-3.0-or-later
"""The oracle of variants that draw all layers in one pass: view depth of the layers that the next are tested against.

What an earlier picture left is used where the variant says so; the rest is peeled here, depth only.
"""

from collections.abc import Iterator

from ...scene import Moment, Variant
from ...scene.history import is_cut
from ..device import Device
from ..layout import CHANNELS
from ..plan import ORACLE_SCRATCH, ORACLE_TARGET, PlannedPass
from ..programs import ProgramSpec
from .base import Frame
from .rasterize import GeometryProgram, GeometryView, Rasterizer

_VIEW_DEPTH = tuple(channel for channel in CHANNELS if channel.name == "view_depth")


class OraclePass:
    """Completes the oracle for the sample that is about to be drawn."""

    name = "oracle"

    def __init__(self, device: Device) -> None:
        self._rasterizer = Rasterizer(device)

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """None of its own: its programs are among the G-buffer's."""
        yield from ()

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """Nothing; draws and geometry are the view's."""

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Peel the layers that are not known yet."""
        state = frame.oracle
        moment = frame.moment
        if not (state.shows(moment) or _carries(frame)):
            if frame.history is not None:
                moment = Moment(frame.history.scene, frame.jittered(frame.history.camera, frame.sample))
            state.show(moment, frame.view, 0)
        for layer in range(state.layers, frame.plan.layers - 1):
            self._peel(frame, moment, layer)
        state.layers = frame.plan.layers - 1

    def release(self) -> None:
        """Free the pass's uniforms."""
        self._rasterizer.release()

    def _peel(self, frame: Frame, moment: Moment, layer: int) -> None:
        target = ORACLE_SCRATCH if layer > 0 else ORACLE_TARGET
        program = GeometryProgram(_VIEW_DEPTH, frozenset({"ORACLE"} if layer > 0 else ()), layering=frame.layering)
        view = GeometryView(
            moment,
            program,
            targets=(target,),
            into=0,
            first_layer=layer,
            oracle=frame.pool.texture(ORACLE_TARGET) if layer > 0 else None,
        )
        self._rasterizer.draw(frame, view)
        if layer > 0:
            frame.pool.copy(ORACLE_SCRATCH, 0, ORACLE_TARGET, layer)


def _carries(frame: Frame) -> bool:
    """Whether the depth that the last picture left serves although it shows another moment."""
    state = frame.oracle
    return (
        frame.continuous
        and frame.sample.index == 0
        and frame.plan.variant in (Variant.PREVIOUS, Variant.PREDICT, Variant.REPROJECT)
        and state.moment is not None
        and state.has_moved(Moment(frame.scene, frame.view))
        and not is_cut(state.moment, frame.moment)
    )
