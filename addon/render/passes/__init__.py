# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes, in the order a sample runs them."""

from .base import Frame, Pass
from .composite import CompositePass
from .direct import DirectPass
from .exit import ExitPass
from .gbuffer import GBufferPass
from .oracle import OraclePass

PASSES: tuple[type[Pass], ...] = (OraclePass, GBufferPass, ExitPass, DirectPass, CompositePass)

__all__ = ["PASSES", "Frame", "Pass"]
