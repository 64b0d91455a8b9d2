# SPDX-License-Identifier: GPL-3.0-or-later
"""The one comparison with Cycles that runs, and what the last one found: its pictures as images, its numbers."""

import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ..engine import messages
from ..output import write_channels
from ..report.compared import Compared, Numbers, compare
from ..report.comparison import Comparison, ComparisonError, Request

DIFFERENCE = "Comparison: Difference"
IMAGES = {"ours": "Comparison: Deep G-Buffer", "cycles": "Comparison: Cycles", "difference": DIFFERENCE}
"""Names of the images, by the attribute of `Compared` that each shows."""

LEAST_PIXELS = 4
"""Blender's least width and height of a picture."""

PACKAGE = __name__.rpartition(".ui.")[0]


class CancelledError(ComparisonError):
    """Somebody ended the comparison."""

    def __init__(self) -> None:
        super().__init__("The comparison was cancelled.")


@dataclass
class _State:
    """`running`: what runs now. `numbers` and `folder`: of the last one, `folder` holds the files behind its images."""

    running: Comparison | None = None
    numbers: Numbers | None = None
    folder: Path | None = None


_state = _State()


def running() -> Comparison | None:
    """The comparison that runs; None where none does."""
    return _state.running


def numbers() -> Numbers | None:
    """What the last comparison found; None where there was none since the file was loaded."""
    return _state.numbers


def start(scene: Any, samples: int, percent: int) -> None:
    """Render `scene` by both engines, `percent` of its resolution, Cycles with `samples` in two halves.

    Raises ComparisonError saying why that cannot be.
    """
    _check(scene)
    folder = _new_folder()
    try:
        _state.running = Comparison(
            Request(
                blender=_command(),
                file=_save_copy(folder),
                scene=scene.name,
                resolution=resolution(scene, percent),
                samples=half(samples),
                package=PACKAGE,
                folder=folder,
            )
        )
    except ComparisonError:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def step() -> bool:
    """Go on without waiting; whether the comparison still runs. In the end there are images and numbers.

    Raises ComparisonError where it failed or was cancelled; then nothing is left of it.
    """
    if _state.running is None:
        raise CancelledError
    try:
        if _state.running.poll():
            return True
        _keep(compare(_state.running.result(), _state.running.request.samples))
    except (ComparisonError, OSError, ValueError, MemoryError) as error:
        cancel()
        raise ComparisonError(str(error) or "There is not enough memory to compare the pictures.") from error
    cancel()
    return False


def cancel() -> None:
    """End the comparison that runs, if any, and remove everything it wrote."""
    if _state.running is not None:
        _state.running.cancel()
        _state.running = None


def clear() -> None:
    """End what runs, forget the numbers, and remove the files behind the images."""
    cancel()
    _state.numbers = None
    _remove_files()


def half(samples: int) -> int:
    """Samples of each half, rounded up."""
    return (samples + 1) // 2


def resolution(scene: Any, percent: int) -> tuple[int, int]:
    """Width and height in pixels of `percent` of the scene's render resolution."""
    scale = scene.render.resolution_percentage * percent
    width, height = scene.render.resolution_x * scale // 10_000, scene.render.resolution_y * scale // 10_000
    return max(LEAST_PIXELS, width), max(LEAST_PIXELS, height)


def lost_edits() -> list[str]:
    """Names of images with pixels that no file holds: the other Blender shows them as they are in their files."""
    return [image.name for image in bpy.data.images if image.is_dirty and image.name not in IMAGES.values()]


def _check(scene: Any) -> None:
    """Raise ComparisonError where a comparison cannot start."""
    if _state.running is not None:
        raise ComparisonError("A comparison with Cycles is running already.")
    if scene.camera is None:
        raise ComparisonError(messages.no_camera(scene.name))
    if not hasattr(scene, "cycles"):
        raise ComparisonError("There is no Cycles to compare with: enable the add-on Cycles Render Engine.")


def _new_folder() -> Path:
    """A new folder that ends with this Blender. Raises ComparisonError where there can be none."""
    try:
        return Path(tempfile.mkdtemp(prefix="comparison_", dir=bpy.app.tempdir))
    except OSError as error:
        raise ComparisonError(f"There is no room for a comparison's files: {error}") from error


def _command() -> list[str]:
    """How to start a Blender like this one, up to a script for it. It trusts scripts in files as this one does."""
    if not bpy.app.binary_path:
        return [sys.executable, "-P"]
    trust = "--disable-autoexec" if bpy.app.autoexec_fail else "--enable-autoexec"
    return [bpy.app.binary_path, "--background", trust, "--python-exit-code", "1", "--python"]


def _save_copy(folder: Path) -> Path:
    """Write what is edited now, unsaved edits too, into `folder`; the file that is open stays the one that it is.

    Raises ComparisonError where it cannot be written.
    """
    path = folder / "scene.blend"
    packs = bpy.data.use_autopack
    bpy.data.use_autopack = False  # it would pack the files of the images that are open here
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, relative_remap=True, compress=False)
    except RuntimeError as error:
        reason = str(error).strip().removeprefix("Error: ")
        raise ComparisonError(f"The scene could not be saved for the comparison: {reason}") from error
    finally:
        bpy.data.use_autopack = packs
    return path


def _keep(found: Compared) -> None:
    """Make images of the pictures, in place of those of the last comparison. Raises OSError."""
    folder = _new_folder()
    try:
        for attribute in IMAGES:
            picture = getattr(found, attribute)[::-1]
            write_channels(folder / f"{attribute}.exr", {letter: picture[..., i] for i, letter in enumerate("RGB")})
    except OSError:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    for attribute, name in IMAGES.items():
        _replace(name, folder / f"{attribute}.exr")
    _remove_files()
    _state.folder, _state.numbers = folder, found.numbers


def _replace(name: str, path: Path) -> None:
    """Load a scene-linear picture as the image `name`, wherever an image of that name was used."""
    old = bpy.data.images.get((name, None))
    image: Any = bpy.data.images.load(str(path))
    working = getattr(bpy.data, "colorspace", None)  # from Blender 5.0 a file has its own
    image.colorspace_settings.name = working.working_space if working else "Linear Rec.709"
    image.use_view_as_render = True
    if old is not None:
        old.user_remap(image)
        bpy.data.images.remove(old)
    image.name = name


def _remove_files() -> None:
    if _state.folder is not None:
        shutil.rmtree(_state.folder, ignore_errors=True)
        _state.folder = None
