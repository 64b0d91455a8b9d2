# SPDX-License-Identifier: GPL-3.0-or-later
# pyright: reportAttributeAccessIssue=false, reportOptionalMemberAccess=false
import bpy

settings = bpy.context.scene.deep_gbuffer
settings.samples = 64
settings.viewport_samples = 32
settings.time_limit = 0.0
