# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes, in the order a sample runs them."""

from .base import Frame, Pass
from .composite import CompositePass
from .depth_tiles import DepthTilesPass
from .direct import DirectPass
from .exit import ExitPass
from .gbuffer import GBufferPass
from .gouraud import GouraudPass
from .light_tiles import LightTilesPass
from .oracle import OraclePass
from .shadow_maps import ShadowMapsPass

PASSES: tuple[type[Pass], ...] = (
    OraclePass,
    GBufferPass,
    ExitPass,
    DepthTilesPass,
    ShadowMapsPass,
    LightTilesPass,
    DirectPass,
    GouraudPass,
    CompositePass,
)

__all__ = ["PASSES", "Frame", "Pass"]
