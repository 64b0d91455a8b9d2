# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures and the deep G-buffer's layers as EXR files."""

from .deep_exr import write_deep
from .exr import write_channels
from .layers_exr import write_layers

__all__ = ["write_channels", "write_deep", "write_layers"]
