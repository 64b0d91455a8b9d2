# SPDX-License-Identifier: GPL-3.0-or-later
"""Error against run time: drives engines, ours and its peers, and says how far their pictures are from a reference.

`sweep` is the table of what is measured, `job` measures it inside Blender, `metrics` and `flicker` judge the pictures,
`reference` says how Cycles renders what they are judged by.
"""
