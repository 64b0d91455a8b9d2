# SPDX-License-Identifier: GPL-3.0-or-later
# pyright: reportAttributeAccessIssue=false, reportOptionalMemberAccess=false
import bpy

settings = bpy.context.scene.deep_gbuffer
settings.layers = 2
settings.separation_unit = "DISTANCE"
settings.minimum_separation = 0.5
