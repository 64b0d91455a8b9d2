# SPDX-License-Identifier: GPL-3.0-or-later
"""What all tests inside Blender share."""

import bpy
import pytest


@pytest.fixture(name="empty_scene")
def empty_scene_fixture() -> bpy.types.Scene:
    """Factory settings without any object; the only scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene
