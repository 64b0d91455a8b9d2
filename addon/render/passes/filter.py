# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance of every pixel from what fewer pixels gathered: noise smoothed within surfaces, then joint upsampling.

The smoothing fades out by itself while the film accumulates samples: sample i, counted from 1, is smoothed over a width
that shrinks as 1/√i, so over an area that shrinks as 1/i. As many gathered values enter a pixel of the film as of the
first sample, from nearer and nearer. Where the width would be below a texel, from sample 4^ITERATIONS on, nothing is
smoothed any more, and the film's mean tends to that of what was gathered.
"""

from collections.abc import Iterator
from math import log2

import moderngl

from ..gathering import GATHER_UNIFORMS, gather_uniforms
from ..indirect_plan import FILTER_SCRATCH, FILTER_SURFACES, IRRADIANCE_TARGET
from ..plan import PlannedPass
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .base import Frame
from .fullscreen import FullscreenPass, fullscreen_program

FILTER_UNIFORMS = UniformBlock(
    "FilterUniforms",
    (
        *GATHER_UNIFORMS,
        ("stride", "int"),  # texels between a texel and its neighbours
        ("neighbour_share", "float"),  # 0…1, of the weight that neighbours have in a full iteration
    ),
)

ITERATIONS = 3
"""Of the à-trous filter in sample 0; each doubles its width."""

_OWN_SAMPLERS = ("surfaces", "unfiltered")


def iterations(index: int) -> float:
    """How many times sample `index` 0, 1, … is smoothed; of the last time, neighbours count the fraction.

    The width is 2 to that power, in texels; see the module's text for the rule.
    """
    return max(ITERATIONS - log2(index + 1) / 2.0, 0.0)


class FilterPass(FullscreenPass):
    """Smooths, then upsamples."""

    name = "filter"
    block = FILTER_UNIFORMS

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """One program per step."""
        yield from (_SURFACES, _SMOOTH, _UPSAMPLE)

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Write `indirect.irradiance`."""
        self._device.context.enable_only(moderngl.NOTHING)
        source = planned.reads[-1]
        self._step(frame, planned, _SURFACES, source, FILTER_SURFACES)
        if "SPATIAL" in planned.defines:
            left, target, other = iterations(frame.sample.index), *FILTER_SCRATCH
            stride = 1
            while left > 0.0:
                self._step(frame, planned, _SMOOTH, source, target, stride, min(left, 1.0))
                source, target, other = target, other, target
                stride, left = 2 * stride, left - 1.0
        self._step(frame, planned, _UPSAMPLE, source, IRRADIANCE_TARGET)

    def _step(
        self,
        frame: Frame,
        planned: PlannedPass,
        spec: ProgramSpec,
        source: str,
        target: str,
        stride: int = 1,
        neighbour_share: float = 1.0,
    ) -> None:
        """Draw one step from one irradiance target into another target."""
        frame.pool.framebuffer(((target, 0),)).use()
        self._fullscreen.bind(frame, spec, planned)
        frame.pool.texture(FILTER_SURFACES).use(spec.samplers.index("surfaces"))
        frame.pool.texture(source).use(spec.samplers.index("unfiltered"))
        self._fullscreen.draw(spec, **gather_uniforms(frame), stride=stride, neighbour_share=neighbour_share)


def _program(step: str) -> ProgramSpec:
    return fullscreen_program(f"filter/{step}.frag", FILTER_UNIFORMS, frozenset(), samplers=_OWN_SAMPLERS)


_SURFACES, _SMOOTH, _UPSAMPLE = _program("surfaces"), _program("smooth"), _program("upsample")
