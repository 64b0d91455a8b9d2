# SPDX-License-Identifier: GPL-3.0-or-later
"""A viewport's gathered irradiance, blended with what the views before found on the same surfaces.

The first sample of a view takes the history of the view before, where its surfaces were then; later ones go on from
there. Shares are such that the film's mean is that of history and samples together, so history fades out by itself.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import moderngl
import numpy as np

from ...scene import Camera, Moment, RenderSettings
from ...scene.arrays import Float64Array
from ...scene.history import is_cut
from ..device import Device
from ..gathering import GATHER_UNIFORMS, gather_offset, gather_uniforms
from ..indirect_plan import HISTORY_SURFACES, HISTORY_TARGETS
from ..plan import PlannedPass
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .base import Frame
from .fullscreen import FullscreenPass, fullscreen_program

TEMPORAL_UNIFORMS = UniformBlock(
    "TemporalUniforms",
    (
        *GATHER_UNIFORMS,
        ("history_from_relative", "mat4"),  # to the space of the camera that history was seen with
        ("history_window", "vec4"),
        ("history_offset", "vec2"),  # gather_offset then
        ("history_known", "int"),
        ("sample_index", "int"),
    ),
)


@dataclass(frozen=True)
class _Left:
    """What the last view left: what it showed, and in which textures."""

    moment: Moment
    settings: RenderSettings
    textures: tuple[moderngl.TextureArray, ...]


class TemporalPass(FullscreenPass):
    """Blends each sample with the history, and brings that up to date."""

    name = "temporal"
    block = TEMPORAL_UNIFORMS

    def __init__(self, device: Device) -> None:
        super().__init__(device)
        self._left: _Left | None = None
        self._newest = 0

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """For the first sample of a view, and for those after it."""
        yield from (_program(first=True), _program(first=False))

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Write the blended irradiance."""
        first = frame.sample.index == 0
        seen = self._history_camera(frame) if first else frame.view
        spec = _program(first=first)
        read, write = self._newest, 1 - self._newest
        self._device.context.enable_only(moderngl.NOTHING)
        targets = (planned.writes[0].name, HISTORY_TARGETS[write], HISTORY_SURFACES[write])
        frame.pool.framebuffer(tuple((name, 0) for name in targets)).use()
        self._fullscreen.bind(frame, spec, planned)
        for sampler, name in zip(_OWN_SAMPLERS, _textures(planned, read), strict=True):
            frame.pool.texture(name).use(spec.samplers.index(sampler))
        self._fullscreen.draw(
            spec,
            **gather_uniforms(frame),
            history_from_relative=_from_relative(seen or frame.view, frame.view),
            history_window=(seen or frame.view).window,
            history_offset=gather_offset(frame.settings.indirect.divisor, 0),
            history_known=int(seen is not None),
            sample_index=frame.sample.index,
        )
        self._newest = write
        if first:
            self._left = _Left(Moment(frame.scene, frame.view), frame.settings, _held(frame))

    def _history_camera(self, frame: Frame) -> Camera | None:
        """The camera of the view before, where that is the frame before and says anything about this one."""
        left, previous = self._left, frame.previous
        if left is None or previous is None or not frame.continuous:
            return None
        lost = any(now is not then for now, then in zip(_held(frame), left.textures, strict=True))
        if lost or left.settings != frame.settings or not left.moment.equals(previous):
            return None
        return None if is_cut(previous, Moment(frame.scene, frame.view)) else left.moment.camera


_OWN_SAMPLERS = ("found", "history", "history_surfaces")


def _textures(planned: PlannedPass, read: int) -> tuple[str, ...]:
    """Target names for `_OWN_SAMPLERS`."""
    return planned.reads[-1], HISTORY_TARGETS[read], HISTORY_SURFACES[read]


def _held(frame: Frame) -> tuple[moderngl.TextureArray, ...]:
    """The textures of the history; a pool that had to make others does not keep what was in them."""
    return tuple(frame.pool.texture(name) for name in (*HISTORY_TARGETS, *HISTORY_SURFACES))


def _from_relative(camera: Camera, now: Camera) -> Float64Array:
    """(4, 4) from positions relative to where a camera is `now`, in world axes, to the space of another camera."""
    matrix = np.eye(4)
    matrix[:3, :3] = camera.rotation.T
    matrix[:3, 3] = camera.rotation.T @ (now.position - camera.position)
    return matrix


def _program(*, first: bool) -> ProgramSpec:
    defines = frozenset({"REPROJECT"} if first else ())
    return fullscreen_program("temporal/temporal.frag", TEMPORAL_UNIFORMS, defines, samplers=_OWN_SAMPLERS)
