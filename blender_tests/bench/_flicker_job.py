# SPDX-License-Identifier: GPL-3.0-or-later
"""A .blend with a camera that moves sideways or a sun that turns, as another file; runs in Blender.

The one argument is JSON: `file`, `output`, `frames` (the last one, from 1), `step` (metres by which the camera moves to
its left, each frame) and `turn` (degrees by which every sun turns about the vertical, each frame).
"""

import json
import math
import sys
from typing import Any

import bpy
from mathutils import Matrix, Vector


def write(job: dict[str, Any]) -> None:
    """Do the job."""
    bpy.ops.wm.open_mainfile(filepath=job["file"], load_ui=False)
    scene = bpy.context.scene
    camera = scene.camera
    moved = camera.matrix_world.to_3x3() @ Vector((-job["step"], 0.0, 0.0))
    start = camera.location.copy()
    suns = {light: light.matrix_world.copy() for light in scene.objects if light.type == "LIGHT"}
    scene.frame_start, scene.frame_end = 1, job["frames"]
    for frame in range(job["frames"] + 2):  # one more at each end: engines may ask for what is before and after
        if job["step"]:
            camera.location = start + (frame - 1) * moved
            camera.keyframe_insert("location", frame=frame)
        for light, pose in suns.items() if job["turn"] else ():
            turned = Matrix.Rotation(math.radians((frame - 1) * job["turn"]), 4, "Z") @ pose
            light.rotation_euler = turned.to_euler("XYZ", light.rotation_euler)
            light.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(1)
    bpy.ops.wm.save_as_mainfile(filepath=job["output"], compress=True)


if __name__ == "__main__":
    write(json.loads(sys.argv[1]))
