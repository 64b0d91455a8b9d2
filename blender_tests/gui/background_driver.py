# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare with Cycles in `blender --background`, as a script does. See steps.py. This only does and records."""

import sys
from pathlib import Path

import bpy

sys.path.append(sys.argv[sys.argv.index("--") + 1])

from steps import install, module, results, write

install()
scene = bpy.context.scene
scene.render.engine = "DEEP_GBUFFER"
scene.deep_gbuffer.samples = 4
done = bpy.ops.deep_gbuffer.compare_with_cycles(samples=4, percent=10)
results["done"] = list(done)
results["images"] = sorted(image.name for image in bpy.data.images if image.name.startswith("Comparison"))
results["folders"] = len(list(Path(bpy.app.tempdir).glob("comparison_*")))
results["tables"] = module("ui.compare_panels").tables(module("ui.comparing").numbers())
write()
