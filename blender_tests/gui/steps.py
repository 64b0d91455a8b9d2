# SPDX-License-Identifier: GPL-3.0-or-later
"""What scenarios in a real Blender window share: blender --python SCENARIO.py -- FOLDER.

FOLDER holds extension.zip; screenshots (NAME.png) and results.json are written into it. The tests judge them.
"""

import json
import os
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy

FOLDER = Path(sys.argv[sys.argv.index("--") + 1])
PACKAGE = "bl_ext.user_default.deep_gbuffer"
STEP_SECONDS = 0.02
PATIENCE_SECONDS = 60

results: dict[str, object] = {}


def module(name: str):
    """A module of the installed extension."""
    return sys.modules[f"{PACKAGE}.{name}"]


def window():
    return bpy.context.window_manager.windows[0]


def viewports():
    """Areas with a 3D viewport, from the left."""
    return sorted((area for area in window().screen.areas if area.type == "VIEW_3D"), key=lambda area: area.x)


def main_region(area):
    return next(region for region in area.regions if region.type == "WINDOW")


def screenshot(name: str) -> None:
    """Save the screen, and where each viewport lies on it (left, top, width, height)."""
    subprocess.run(["import", "-window", "root", str(FOLDER / f"{name}.png")], check=True)
    regions = [main_region(area) for area in viewports()]
    height = window().height
    results[name] = [(region.x, height - region.y - region.height, region.width, region.height) for region in regions]


def wait(ready: Callable[[], bool]) -> Iterator[None]:
    """Let Blender work until `ready`."""
    end = time.monotonic() + PATIENCE_SECONDS
    while not ready():
        if time.monotonic() > end:
            raise TimeoutError(ready.__name__)
        yield


def frames(count: int) -> Iterator[None]:
    """Let Blender work for some turns of its event loop."""
    for _ in range(count):
        yield


def install() -> None:
    """Install the zip through Blender's own installer."""
    bpy.ops.extensions.package_install_files(
        filepath=str(FOLDER / "extension.zip"), repo="user_default", enable_on_install=True
    )


def run(running: Iterator[None]) -> None:
    """Run a scenario between Blender's own events."""

    def step() -> float | None:
        try:
            next(running)
        except StopIteration:
            finish(0)
        except Exception:
            results["error"] = traceback.format_exc()
            finish(1)
        return STEP_SECONDS

    bpy.app.timers.register(step, first_interval=0.5, persistent=True)


def write() -> None:
    """Write the results."""
    (FOLDER / "results.json").write_text(json.dumps(results), encoding="utf-8")


def finish(code: int) -> None:
    """Leave without questions about unsaved changes."""
    write()
    sys.stdout.flush()
    os._exit(code)
