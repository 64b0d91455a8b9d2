# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes, in the order a sample runs them."""

from .base import Frame, Pass
from .composite import CompositePass
from .deep_march import DeepMarchPass
from .depth_tiles import DepthTilesPass
from .direct import DirectPass
from .exit import ExitPass
from .filter import FilterPass
from .gather import GatherPass
from .gbuffer import GBufferPass
from .gouraud import GouraudPass
from .light_tiles import LightTilesPass
from .occlusion import OcclusionPass
from .oracle import OraclePass
from .radiance_grid import RadianceGridPass
from .radiosity import RadiosityPass
from .shadow_maps import ShadowMapsPass
from .temporal import TemporalPass

PASSES: tuple[type[Pass], ...] = (
    OraclePass,
    GBufferPass,
    ExitPass,
    DepthTilesPass,
    ShadowMapsPass,
    LightTilesPass,
    DirectPass,
    GouraudPass,
    OcclusionPass,
    RadiosityPass,
    DeepMarchPass,
    RadianceGridPass,
    GatherPass,
    TemporalPass,
    FilterPass,
    CompositePass,
)

__all__ = ["PASSES", "Frame", "Pass"]
