# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of a real Blender window; the tests look at what they left."""

import json
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tooling import blender_window, packaging

HERE = Path(__file__).parent
TIMEOUT_SECONDS = 300
PREFERENCES = "import bpy; bpy.context.preferences.view.show_splash = False; bpy.ops.wm.save_userpref()"


@pytest.fixture(scope="session", name="window_blender")
def window_blender_fixture() -> Path:
    """Root of the chroot with a Blender that can open a window; skips where there is none."""
    root = blender_window.locate()
    if root is None:
        pytest.skip(f"NOT TESTED: no Blender window. {blender_window.why_not()}")
    return root


class WindowRun:
    """What a window session left: results.json and pictures."""

    def __init__(self, folder: Path, output: str) -> None:
        self.output = output
        self._folder = folder
        path = folder / "results.json"
        self.results = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}

    def viewport(self, name: str, index: int = 0) -> np.ndarray:
        """One viewport of a screenshot, (H, W, 3) float 0…1, row 0 at the top."""
        left, top, width, height = self.results[name][index]
        return self._image(name)[top : top + height, left : left + width, :3]

    def screen(self, name: str) -> np.ndarray:
        """A whole screenshot, like `viewport`."""
        return self._image(name)[..., :3]

    def final(self, name: str) -> np.ndarray:
        """A final render as Blender saved it, like `viewport`."""
        return self._image(f"{name}_final")[..., :3]

    def coverage(self, name: str) -> np.ndarray:
        """Alpha (H, W) of that final render."""
        return self._image(f"{name}_final")[..., 3]

    def _image(self, name: str) -> np.ndarray:
        with Image.open(self._folder / f"{name}.png") as image:
            return np.asarray(image.convert("RGBA"), np.float32) / 255.0


@pytest.fixture(scope="session", name="window")
def window_fixture(window_blender: Path, tmp_path_factory: pytest.TempPathFactory) -> WindowRun:
    """The scenario of driver.py, run once."""
    return run_scenario(window_blender, tmp_path_factory.mktemp("window"), "driver.py")


@pytest.fixture(scope="session", name="comparison")
def comparison_fixture(window_blender: Path, tmp_path_factory: pytest.TempPathFactory) -> WindowRun:
    """The scenario of comparison_driver.py, run once."""
    return run_scenario(window_blender, tmp_path_factory.mktemp("comparison"), "comparison_driver.py")


@pytest.fixture(scope="session", name="background")
def background_fixture(window_blender: Path, tmp_path_factory: pytest.TempPathFactory) -> WindowRun:
    """The scenario of background_driver.py, run once; there is no screen at all."""
    return run_scenario(window_blender, tmp_path_factory.mktemp("background"), "background_driver.py", WITHOUT_SCREEN)


ON_A_SCREEN = ("python3", "{folder}/xvfb.py", "blender", "--python")
WITHOUT_SCREEN = ("blender", "--background", "--python-exit-code", "1", "--python")


def run_scenario(root: Path, kept: Path, driver: str, starting: Sequence[str] = ON_A_SCREEN) -> WindowRun:
    """Run a scenario in a fresh Blender with a scratch profile and the built zip; what it left goes to `kept`."""
    (root / "var/tmp").mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix="deep_gbuffer_", dir=root / "var/tmp"))
    try:
        inside = Path("/") / folder.relative_to(root)
        shutil.move(packaging.for_this_machine(kept, packaging.extension_tool()), folder / "extension.zip")
        for name in (driver, "steps.py", "xvfb.py"):
            shutil.copy(HERE / name, folder)
        env = {"LIBGL_ALWAYS_SOFTWARE": "1", "HOME": str(inside), "BLENDER_USER_RESOURCES": str(inside / "profile")}
        blender_window.run(root, ["blender", "--background", "--python-expr", PREFERENCES], env, TIMEOUT_SECONDS)
        command = [*(part.format(folder=inside) for part in starting), f"{inside}/{driver}", "--", str(inside)]
        done = blender_window.run(root, command, env, TIMEOUT_SECONDS)
        for path in [*folder.glob("*.png"), *folder.glob("*.json")]:
            shutil.copy(path, kept)
        return WindowRun(kept, done.stdout)
    finally:
        shutil.rmtree(folder)
