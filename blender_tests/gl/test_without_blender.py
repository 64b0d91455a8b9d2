# SPDX-License-Identifier: GPL-3.0-or-later
"""A saved snapshot renders to the same bits in a process that has no Blender."""

import subprocess
import sys
from dataclasses import fields, replace

import numpy as np
import pytest
from random_scenes import Motion, frames, furnished_moment

from addon.render import LayerImages
from addon.scene import Channel, Moment, Sequence, Variant, snapshot

SETTINGS = {
    "width": 48,
    "height": 32,
    "samples": 2,
    "filter_radius": 1.5,
    "layers": 3,
    "minimum_separation": 0.05,
    "guard_band": 4,
    "deep_output": True,
    "motion_vectors": True,
    "exit_surfaces": True,
}
# Runs alone: nothing of this test suite is imported.
SCRIPT = """
import sys
sys.modules["bpy"] = None  # any import of it now fails
from dataclasses import fields
import numpy as np
from addon.render import LayerImages, Renderer, gl_thread
from addon.scene import Channel, Layering, Moment, RenderSettings, Sequence, Variant, snapshot
loaded = snapshot.load(sys.argv[1])
previous, earlier = (Moment(scene, scene.camera) for scene in (loaded.previous, loaded.earlier))
images = {}

def render(device):
    renderer = Renderer(device)
    for variant in Variant:
        settings = RenderSettings(variant=variant, layering=Layering.GEOMETRY_SHADER, **SETTINGS)
        renderer.begin(loaded.scene, loaded.scene.camera, settings, Sequence(previous=previous, earlier=earlier))
        for _ in range(settings.samples):
            renderer.render_sample()
        images[f"{variant} film"] = renderer.read(Channel.COMBINED)
        for layer in range(settings.layers):
            for field in fields(LayerImages):
                images[f"{variant} {layer} {field.name}"] = getattr(renderer.read_layer(layer), field.name)
    renderer.release()

gl_thread().submit(render).result()
assert not {"bpy", "gpu", "mathutils"} & {name for name, module in sys.modules.items() if module is not None}
np.savez(sys.argv[2], **images)
"""


@pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])
def test_a_snapshot_renders_alike_without_blender(session, repository, tmp_path, orthographic):
    motion = Motion(camera=0.125, turn=0.03125, boxes=0.125, spin=0.125, vertices=0.125)
    moments = frames(furnished_moment(5, orthographic), motion, range(3))
    earlier, previous, scene = (replace(moment.scene, camera=moment.camera) for moment in moments)
    snapshot.save(tmp_path / "scene.npz", scene, previous, earlier)
    command = [sys.executable, "-c", f"SETTINGS = {SETTINGS!r}\n{SCRIPT}", "scene.npz", "out.npz"]
    for name in ("scene.npz", "out.npz"):
        command[command.index(name)] = str(tmp_path / name)
    done = subprocess.run(command, cwd=repository, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    images = np.load(tmp_path / "out.npz")
    sequence = Sequence(previous=Moment(previous, previous.camera), earlier=Moment(earlier, earlier.camera))
    for variant in Variant:
        view = session.show(scene, scene.camera, sequence, variant=variant, **SETTINGS)
        np.testing.assert_array_equal(images[f"{variant} film"], view.channels[Channel.COMBINED])
        for layer, image in enumerate(view.layers):
            for field in fields(LayerImages):
                name = f"{variant} {layer} {field.name}"
                np.testing.assert_array_equal(images[name], getattr(image, field.name), name)
    motions = [images[f"TWO_PASS {layer} motion"] for layer in range(2)]
    assert all(image.any() for image in motions), "the neighbouring frames must have come along"
