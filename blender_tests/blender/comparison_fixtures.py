# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparisons with Cycles in background: a scene, the processes that they start, what they leave."""

import subprocess
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.report import comparison
from addon.ui import compared_images, comparing

SAMPLES = 4


@pytest.fixture(name="scene")
def scene_fixture(plane_scene, tmp_path):
    """The plane below a camera in a file that was saved, and 64 × 36 pixels that were not."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "plane.blend"))
    plane_scene.render.resolution_x, plane_scene.render.resolution_y = 64, 36
    yield plane_scene
    comparing.clear()


@pytest.fixture(name="children")
def children_fixture(monkeypatch):
    """Every process that a comparison started."""
    started = []

    class Recorded(subprocess.Popen):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            started.append(self)

    monkeypatch.setattr(comparison.subprocess, "Popen", Recorded)
    return started


def compare(**options):
    return bpy.ops.deep_gbuffer.compare_with_cycles(**{"samples": SAMPLES, "percent": 100, **options})


def folders():
    return list(Path(bpy.app.tempdir).glob("comparison_*"))


def comparison_images():
    """Those that comparisons made, under their own names or not yet."""
    images = bpy.data.images
    return [image for image in images if image.name.startswith("Comparison") or "comparison_" in image.filepath]


def pixels(attribute):
    """An image of the comparison as (H, W, 3), top row first."""
    image = bpy.data.images[compared_images.IMAGES[attribute]]
    flat = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(flat)
    return flat.reshape(image.size[1], image.size[0], -1)[::-1, :, :3]


def started(scene):
    """A comparison whose renders take for ever, at its first sample."""
    scene.deep_gbuffer.samples = 1_000_000
    comparing.start(scene, SAMPLES, 100)
    while comparing.running().progress.fraction == 0.0:
        assert comparing.step()
