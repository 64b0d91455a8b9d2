# SPDX-License-Identifier: GPL-3.0-or-later
"""The deep G-buffer's layers as files: a multi-layer EXR and a deep EXR."""

from .deep_exr import write_deep
from .layers_exr import write_layers

__all__ = ["write_deep", "write_layers"]
