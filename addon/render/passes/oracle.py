# SPDX-License-Identifier: GPL-3.0-or-later
"""The oracle of variants that draw all layers in one pass: view depth of the layers that the next are tested against.

What an earlier picture left is used where the variant says so; the rest is peeled here, depth only.
"""

from ...scene import Moment, Variant
from ...scene.history import is_cut, same_population
from ..layout import CHANNELS
from ..plan import HISTORY_TARGET, ORACLE_SCRATCH, ORACLE_TARGET, PlannedPass
from .base import Frame
from .rasterize import GeometryPass, GeometryProgram, GeometryView

_VIEW_DEPTH = tuple(channel for channel in CHANNELS if channel.name == "view_depth")


class OraclePass(GeometryPass):
    """Completes the oracle for the sample that is about to be drawn."""

    name = "oracle"

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Peel the layers that are not known yet."""
        state, moment = frame.oracle, frame.moment
        state.source = ORACLE_TARGET
        known = 0
        if state.shows(ORACLE_TARGET, moment):
            known = state.shown.exact
        elif state.shows(HISTORY_TARGET, moment):
            state.source = HISTORY_TARGET
            known = state.shown.exact
        elif _carries(frame):
            state.source = HISTORY_TARGET
            known = state.shown.layers
        else:
            if frame.history is not None:
                moment = Moment(frame.history.scene, frame.jittered(frame.history.camera, frame.sample))
            state.show(ORACLE_TARGET, moment, 0)
        for layer in range(known, frame.plan.layers - 1):
            self._peel(frame, moment, layer)
        state.complete(frame.plan.layers - 1, exact=state.shown.moment.equals(moment))

    def _peel(self, frame: Frame, moment: Moment, layer: int) -> None:
        """Draw one layer of the oracle, depth only."""
        source = frame.oracle.source
        target = ORACLE_SCRATCH if layer > 0 else source
        drift = frame.drift_since(frame.oracle.shown.moment, moment) if layer > 0 else 0.0
        defines = {*(("ORACLE",) if layer > 0 else ()), *(("DRIFT",) if drift > 0.0 else ())}
        view = GeometryView(
            moment,
            GeometryProgram(_VIEW_DEPTH, frozenset(defines), layering=frame.layering),
            targets=(target,),
            into=0,
            first_layer=layer,
            oracle=frame.pool.texture(source) if layer > 0 else None,
            oracle_drift=drift,
        )
        self._rasterizer.draw(frame, view)
        if layer > 0:
            frame.pool.copy(ORACLE_SCRATCH, 0, source, layer)


def _carries(frame: Frame) -> bool:
    """Whether the depth that the last view left serves although it shows another moment."""
    left, previous = frame.oracle.history, frame.previous
    if left is None or previous is None or not frame.continuous or frame.sample.index > 0:
        return False
    if previous.equals(Moment(frame.scene, frame.view)) or is_cut(previous, frame.moment):
        return False
    if not same_population(previous.scene, frame.scene):
        return False
    if frame.plan.variant is Variant.PREDICT:
        return True
    return frame.plan.variant in (Variant.PREVIOUS, Variant.REPROJECT) and left.equals(previous)
