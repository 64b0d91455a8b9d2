# SPDX-License-Identifier: GPL-3.0-or-later
"""The one comparison with Cycles that runs, and the numbers that the last one found."""

import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ..engine import messages
from ..report.compared import Numbers, compare
from ..report.comparison import Comparison, ComparisonError, Request
from . import compared_images

LEAST_PIXELS = 4
"""Blender's least width and height of a picture."""

PACKAGE = __name__.rpartition(".ui.")[0]


class CancelledError(ComparisonError):
    """Somebody ended the comparison."""

    def __init__(self) -> None:
        super().__init__("The comparison was cancelled.")


@dataclass
class _State:
    """`running`: what runs now. `numbers`: of the last one."""

    running: Comparison | None = None
    numbers: Numbers | None = None


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
        found = compare(_state.running.result(), _state.running.request.samples)
        compared_images.make(found, _new_folder())
        _state.numbers = found.numbers
    except ComparisonError:
        cancel()
        raise
    except MemoryError as error:
        cancel()
        raise ComparisonError("There is not enough memory to compare the pictures.") from error
    except Exception as error:  # whatever it is, nothing may be left half done
        cancel()
        raise ComparisonError(f"The pictures could not be compared: {_reason(error)}") from error
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
    compared_images.remove_files()


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
    ours = compared_images.IMAGES.values()
    return [image.name for image in bpy.data.images if image.is_dirty and image.name not in ours]


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
        raise ComparisonError(f"The scene could not be saved for the comparison: {_reason(error)}") from error
    finally:
        bpy.data.use_autopack = packs
    return path


def _reason(error: Exception) -> str:
    """What an error says, without the word that Blender starts it with."""
    return str(error).strip().removeprefix("Error: ") or type(error).__name__
