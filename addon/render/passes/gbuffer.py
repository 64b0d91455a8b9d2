# SPDX-License-Identifier: GPL-3.0-or-later
"""The deep G-buffer: n layers with minimum separation, by one pass over the geometry per layer or by one for all."""

from collections.abc import Iterator

from ...scene import Moment, Variant
from ...scene.history import same_population
from ..plan import HISTORY_TARGET, ORACLE_TARGET, PlannedPass
from ..programs import ProgramSpec
from ..sampling import film_sample
from .base import Frame
from .rasterize import GeometryPass, GeometryProgram, GeometryView, geometry_variants


class GBufferPass(GeometryPass):
    """Draws all layers; layer k discards what is not behind layer k − 1 by more than Δz, as its oracle knows it."""

    name = "gbuffer"

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """Every program of the passes that rasterise geometry."""
        yield from geometry_variants()

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Draw all layers, and leave behind what the next picture's oracle needs."""
        if frame.plan.one_pass:
            self._draw_at_once(frame)
        else:
            self._draw_in_turn(frame)

    def _draw_in_turn(self, frame: Frame) -> None:
        """Two-pass generation: each layer is the oracle of the next."""
        layers = frame.plan.layers
        for layer in range(layers):
            channels = tuple(channel for channel, count in frame.plan.channels if layer < count)
            program = GeometryProgram(channels, frozenset({"ORACLE"} if layer > 0 else ()), layering=frame.layering)
            view = GeometryView(
                frame.moment,
                program,
                targets=tuple(channel.target_name for channel in channels),
                into=layer,
                first_layer=layer,
                oracle=frame.pool.texture(ORACLE_TARGET) if layer > 0 else None,
                oracle_layer_offset=layer,
                previous=_previous(frame),
            )
            self._rasterizer.draw(frame, view)
            if layer + 1 < layers:
                frame.pool.copy("gbuffer.view_depth", layer, ORACLE_TARGET, 0)

    def _draw_at_once(self, frame: Frame) -> None:
        plan, state = frame.plan, frame.oracle
        channels = tuple(channel for channel, _ in plan.channels)
        shown = state.shown.moment
        exact = state.is_exact(frame.moment)
        ahead = _look_ahead(frame) if plan.look_ahead else None
        defines = {"ORACLE"}
        if not exact:
            defines.add("REPROJECT" if plan.variant is Variant.REPROJECT else "DRIFT")
        if ahead is not None:
            defines.add("LOOK_AHEAD")
        view = GeometryView(
            frame.moment,
            GeometryProgram(channels, frozenset(defines), plan.layers + (ahead is not None), frame.layering),
            targets=tuple(channel.target_name for channel in channels),
            oracle=frame.pool.texture(state.source),
            oracle_drift=frame.drift_since(shown, frame.moment),
            previous=_previous(frame),
            following=ahead,
        )
        self._rasterizer.draw(frame, view)
        self._leave(frame, ahead, exact=exact)

    def _leave(self, frame: Frame, ahead: Moment | None, *, exact: bool) -> None:
        """Keep what the next picture's layers may be tested against: the next sample's, or the next view's.

        Of a view its first sample is kept, which goes through pixel centres as the next view's first does.
        """
        plan, state = frame.plan, frame.oracle
        first = frame.sample.index == 0
        if ahead is not None:
            target = HISTORY_TARGET if _following(frame) is not None else ORACLE_TARGET
            if same_population(frame.scene, ahead.scene):
                frame.pool.copy("gbuffer.view_depth", plan.layers, target, 0)
                state.show(target, ahead, 1)
            else:
                state.targets.pop(target, None)
        elif first and frame.continuous and plan.variant in (Variant.PREVIOUS, Variant.REPROJECT):
            for layer in range(plan.layers - 1):
                frame.pool.copy("gbuffer.view_depth", layer, HISTORY_TARGET, layer)
            state.show(HISTORY_TARGET, frame.moment, plan.layers - 1, plan.layers - 1 if exact else 1)


def _previous(frame: Frame) -> Moment:
    """The previous frame through this sample's jitter; the frame itself where nothing is known."""
    if frame.previous is None:
        return frame.moment
    return Moment(frame.previous.scene, frame.jittered(frame.previous.camera, frame.sample))


def _following(frame: Frame) -> Moment | None:
    """The next frame, where that is what the next picture shows: a prediction holds for a view's first sample only."""
    return None if frame.plan.variant is Variant.PREDICT and frame.sample.index > 0 else frame.ahead


def _look_ahead(frame: Frame) -> Moment | None:
    """The next picture: the next frame's first sample where that is known, else this frame's next sample if any."""
    following = _following(frame)
    if following is not None:
        first = film_sample(0, frame.settings.filter_radius, frame.settings.seed)
        return Moment(following.scene, frame.jittered(following.camera, first))
    if frame.sample.index + 1 == frame.settings.samples:
        return None
    after = film_sample(frame.sample.index + 1, frame.settings.filter_radius, frame.settings.seed)
    return Moment(frame.scene, frame.jittered(frame.view, after))
