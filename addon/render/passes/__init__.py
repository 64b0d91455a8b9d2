# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes, in the order a sample runs them."""

from .base import Frame, Pass
from .composite import CompositePass
from .direct import DirectPass
from .gbuffer import GBufferPass

PASSES: tuple[type[Pass], ...] = (GBufferPass, DirectPass, CompositePass)

__all__ = ["PASSES", "CompositePass", "DirectPass", "Frame", "GBufferPass", "Pass"]
