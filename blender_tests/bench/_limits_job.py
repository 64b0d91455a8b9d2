# SPDX-License-Identifier: GPL-3.0-or-later
"""A .blend's picture by any engine with the passes that tell kinds of light apart; runs in Blender.

The one argument is JSON: `file`, `resolution` (width, height), `engine`, its `settings` as text by name, `lamps_only`
(whether the world is left out), and `picture`, the multi-layer EXR to write.
"""

import json
import sys
from typing import Any

import addon
from addon.report import rendering
from addon.report.engines import ENGINES, assign

PASSES = (
    *(f"{kind}_{part}" for kind in ("diffuse", "glossy", "transmission") for part in ("color", "direct", "indirect")),
    *("emit", "environment"),
)


def render(job: dict[str, Any]) -> None:
    """Do the job. Raises JobError, ValueError or RuntimeError (Blender's) saying why there is no picture."""
    engine = ENGINES[job["engine"]]
    scene = rendering.open_scene(job["file"])
    rendering.set_resolution(scene, *job["resolution"])
    rendering.choose_engine(scene, engine)
    for name, text in job["settings"].items():
        assign(getattr(scene, engine.settings), name, text)
    for layer in scene.view_layers:
        for name in PASSES:
            setattr(layer, f"use_pass_{name}", True)
    if job["lamps_only"]:
        scene.world = None
    scene.render.use_compositing = scene.render.use_sequencer = False
    rendering.choose_format(scene, ".exr")
    rendering.render_once(scene)
    rendering.save_picture(scene, job["picture"])


if __name__ == "__main__":
    addon.register()
    render(json.loads(sys.argv[1]))
    addon.unregister()
