# SPDX-License-Identifier: GPL-3.0-or-later
# pyright: reportAttributeAccessIssue=false, reportOptionalMemberAccess=false
import bpy

settings = bpy.context.scene.deep_gbuffer
settings.layers = 2
settings.separation_unit = "RELATIVE"
settings.relative_separation = 0.05
