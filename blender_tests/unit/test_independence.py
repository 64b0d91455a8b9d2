# SPDX-License-Identifier: GPL-3.0-or-later
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_render_and_scene_import_without_blender():
    code = (
        "import sys\n"
        "sys.modules['bpy'] = None\n"  # any import of it now fails
        "import addon.render, addon.scene.snapshot, addon.render.passes\n"
        "assert not {'gpu', 'mathutils'} & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
