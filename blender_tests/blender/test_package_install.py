# SPDX-License-Identifier: GPL-3.0-or-later
"""The built zip installs through Blender's own installer into a scratch profile and renders with F12."""

import json
import os
import subprocess
import sys
import zipfile

import pytest

from tooling import packaging

SCRIPT = """
import json, os, sys, bpy

bpy.ops.extensions.package_install_files(filepath=sys.argv[1], repo="user_default", enable_on_install=True)
scene = bpy.context.scene
scene.render.engine = "DEEP_GBUFFER"
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 32, 24, 100
scene.deep_gbuffer.samples = 1
outcome = bpy.ops.render.render()
scene.render.image_settings.file_format = "PNG"
bpy.data.images["Render Result"].save_render(sys.argv[2], scene=scene)
picture = bpy.data.images.load(sys.argv[2])
pixels = list(picture.pixels)
package = sys.modules["bl_ext.user_default.deep_gbuffer"]
answer = {
    "outcome": sorted(outcome),
    "file": package.__file__,
    "spread": max(pixels[0::4]) - min(pixels[0::4]),
    "top_level": [name for name in sys.modules if name == "addon" or name.startswith("addon.")],
}
bpy.ops.preferences.addon_disable(module="bl_ext.user_default.deep_gbuffer")
answer["registered"] = hasattr(bpy.types.Scene, "deep_gbuffer")
print("ANSWER " + json.dumps(answer), flush=True)
os._exit(0)
"""


@pytest.fixture(scope="session")
def extension_zip(tmp_path_factory):
    """The extension for this machine."""
    return packaging.for_this_machine(tmp_path_factory.mktemp("extension"), packaging.extension_tool())


def test_zip_holds_the_shaders_and_no_bytecode(extension_zip):
    names = zipfile.ZipFile(extension_zip).namelist()
    assert any(name.startswith("shaders/") for name in names)
    assert any(name.startswith("wheels/moderngl-") for name in names)
    assert not [name for name in names if "__pycache__" in name or name.endswith(".pyc")]


def test_installs_renders_and_goes_without_a_trace(extension_zip, tmp_path):
    profile = tmp_path / "profile"
    profile.mkdir()
    script = tmp_path / "install.py"
    script.write_text(SCRIPT, encoding="utf-8")
    answer = subprocess.run(
        [sys.executable, "-P", str(script), str(extension_zip), str(tmp_path / "picture.png")],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(profile)},
        capture_output=True,
        text=True,
        timeout=180,
        check=False,
    )
    lines = [line for line in answer.stdout.splitlines() if line.startswith("ANSWER ")]
    assert lines, answer.stdout + answer.stderr
    told = json.loads(lines[0].removeprefix("ANSWER "))
    assert told["outcome"] == ["FINISHED"]
    assert told["file"].startswith(str(profile))
    assert told["spread"] > 0.1, "the default cube does not stand out from the background"
    assert told["top_level"] == []
    assert told["registered"] is False
