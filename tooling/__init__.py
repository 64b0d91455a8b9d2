# SPDX-License-Identifier: GPL-3.0-or-later
"""What `build.py` does: set-up on demand, rendering, tests, checks, packaging.

Modules that `build.py` imports run on a plain Python 3.9 without packages; those that run inside an environment or
inside Blender (`render_job`, `shader_variants`) say so.
"""
