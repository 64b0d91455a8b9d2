# SPDX-License-Identifier: GPL-3.0-or-later
"""Plain scene data: frozen dataclasses of numpy arrays. No Blender, no OpenGL.

Everything here is a value: arrays are never written to after construction, so a scene may be read by the GL
thread while `sync` builds the next one. What changed between two scenes is told by keys and versions.
"""

from .camera import Camera
from .geometry import InstanceBatch, Mesh, SlotRange
from .indirect import IndirectMethod, IndirectSettings
from .lights import ALL_GROUPS, LINK_GROUPS, AreaShape, Light, LightKind
from .materials import BaseColorSource, EmissionSampling, Extension, Image, ImageTexture, Interpolation, Material
from .scene import EnvironmentMap, Scene, SunDisc, Versions, World
from .sequence import Moment, Sequence
from .settings import Channel, DebugView, Layering, RenderSettings, ShadingModel, Variant

__all__ = [
    "ALL_GROUPS",
    "LINK_GROUPS",
    "AreaShape",
    "BaseColorSource",
    "Camera",
    "Channel",
    "DebugView",
    "EmissionSampling",
    "EnvironmentMap",
    "Extension",
    "Image",
    "ImageTexture",
    "IndirectMethod",
    "IndirectSettings",
    "InstanceBatch",
    "Interpolation",
    "Layering",
    "Light",
    "LightKind",
    "Material",
    "Mesh",
    "Moment",
    "RenderSettings",
    "Scene",
    "Sequence",
    "ShadingModel",
    "SlotRange",
    "SunDisc",
    "Variant",
    "Versions",
    "World",
]
