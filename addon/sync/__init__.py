# SPDX-License-Identifier: GPL-3.0-or-later
"""From Blender's evaluated scene to plain data. The only code that reads Blender's scene data."""

from .camera import render_camera, viewport_camera
from .mirror import Mirror, SyncResult
from .visibility import without_hidden

__all__ = ["Mirror", "SyncResult", "render_camera", "viewport_camera", "without_hidden"]
