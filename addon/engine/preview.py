# SPDX-License-Identifier: GPL-3.0-or-later
"""Material and world previews: a few samples, nothing kept, nothing written to disk."""

import bpy

from .final import FinalRender
from .sessions import FinalSession

PREVIEW_SAMPLES = 8


def render(engine: bpy.types.RenderEngine, depsgraph: bpy.types.Depsgraph) -> tuple[str, ...]:
    """Render a preview scene into Blender's result; returns the warnings. Raises as FinalRender.run does."""
    session = FinalSession()
    job = FinalRender(engine, session)
    try:
        job.run(depsgraph, PREVIEW_SAMPLES)
    finally:
        session.release()
    return job.measured.warnings
