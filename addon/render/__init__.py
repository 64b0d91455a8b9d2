# SPDX-License-Identifier: GPL-3.0-or-later
"""Scene -> images through a deep G-buffer. Knows OpenGL and the scene contract, nothing of Blender."""

from .device import Device, DeviceError, GLThread, RenderError, gl_thread, stop_gl_thread
from .plan import LeftOut, Plan, PlannedPass, frames_before, plan, reads_past_the_edge
from .programs import ShaderError
from .readback import LayerImages
from .renderer import Renderer
from .statistics import RenderStatistics

__all__ = [
    "Device",
    "DeviceError",
    "GLThread",
    "LayerImages",
    "LeftOut",
    "Plan",
    "PlannedPass",
    "RenderError",
    "RenderStatistics",
    "Renderer",
    "ShaderError",
    "frames_before",
    "gl_thread",
    "plan",
    "reads_past_the_edge",
    "stop_gl_thread",
]
