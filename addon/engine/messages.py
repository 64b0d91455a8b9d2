# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors and warnings a person can read: what is wrong, with which item, and what to do about it."""


class EngineError(RuntimeError):
    """The picture cannot be made; the message is for the user."""


EMPTY_REGION = "The render region lies outside this view."
PREPARING = "Deep G-Buffer is preparing the scene."
INTERRUPTED = "Rendering was interrupted."
STEREO = "Stereoscopy is not supported: every view shows the picture of the active camera."


def no_camera(scene_name: str) -> str:
    """The scene has no active camera."""
    return f"Scene “{scene_name}” has no camera. Add one and make it active: View > Cameras > Set Active Object."


def status(progress: str, warnings: tuple[str, ...]) -> str:
    """A viewport's one line of status: the progress and, where there are any, the first of the warnings."""
    more = f" (and {len(warnings) - 1} more warnings)" if len(warnings) > 1 else ""
    return f"{progress} | {warnings[0]}{more}" if warnings else progress


def progress(done: int, total: int, noise: float | None, ended_by: str) -> str:
    """A final render's one line of status: samples, the `noise` where it is known, and the limit that ended it."""
    parts = [f"Sample {done}/{total}"]
    if noise is not None:
        parts.append(f"Noise {noise:.4f}")
    if ended_by:
        parts.append(f"Finished by {ended_by}")
    return " | ".join(parts)


def internal(error: BaseException) -> str:
    """A fault of the engine itself; the traceback is in the log."""
    return f"Deep G-Buffer failed unexpectedly ({type(error).__name__}: {error}). The system console has the details."


def out_of_memory(width: int, height: int) -> str:
    """The computer could not hold the picture."""
    return f"Not enough memory to render {width} x {height} pixels. Render fewer pixels, layers or passes."


def unsaved(item: str, path: str) -> str:
    """An output path is relative to a .blend that was never saved."""
    return f"The {item} were not written: “{path}” is relative to the .blend, which is not saved yet. Save it first."


def not_written(item: str, path: str, error: BaseException) -> str:
    """A file could not be written."""
    return f"The {item} were not written to “{path}”: {error}."
