# SPDX-License-Identifier: GPL-3.0-or-later
"""`build.py render`: start a Blender with the job, show what it says, put its pictures in place."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from argparse import Namespace
from pathlib import Path
from typing import Any

from tooling import environments, jobs, packaging, places
from tooling.console import Progress, ToolError, say, warn

JOB = places.REPOSITORY / "tooling" / "render_job.py"
SNAPSHOT_JOB = places.REPOSITORY / "tooling" / "snapshot_job.py"
SNAPSHOT_SUFFIX = ".npz"
SUFFIXES = (".png", ".exr")
FRAME_DIGITS = 4
ANY_WRITE_BIT = 0o222


def numbered(output: Path, frame: int) -> Path:
    """`output` with the frame number in its name as Blender puts it: in place of the #s, else after the stem."""
    hashes = list(re.finditer("#+", output.name))
    if hashes:
        start, end = hashes[-1].span()
        return output.with_name(output.name[:start] + _digits(frame, end - start) + output.name[end:])
    return output.with_name(output.stem + _digits(frame, FRAME_DIGITS) + output.suffix)


def _digits(frame: int, width: int) -> str:
    """The frame number filled up with zeros to `width` digits, the sign before them."""
    return f"{'-' if frame < 0 else ''}{abs(frame):0{width}d}"


def default_output(source: Path, engine: str) -> Path:
    """Where the picture goes without -o: beside the file, or into the current folder where that cannot be written."""
    folder = source.parent if is_writable(source.parent) else Path.cwd()
    suffix = ".exr" if source.suffix == SNAPSHOT_SUFFIX else ".png"
    return folder / f"{source.stem}_{engine.lower()}{suffix}"


def is_writable(folder: Path) -> bool:
    """Whether files may be made in `folder`: root, too, keeps out of one that is marked read-only for everybody."""
    return bool(folder.stat().st_mode & ANY_WRITE_BIT) and os.access(folder, os.W_OK)


def check_output(output: Path) -> None:
    """Raise ToolError where `output` has another suffix than ours or its folder cannot be written."""
    if output.suffix.lower() not in SUFFIXES:
        raise ToolError(f"{output}: the picture is written as .png or .exr.")
    if not output.parent.is_dir() or not is_writable(output.parent):
        raise ToolError(f"{output.parent} is not a folder that can be written.")


def check_statistics(path: Path) -> None:
    """Raise ToolError where no file can be written at `path`."""
    if path.is_dir() or not path.parent.is_dir() or not is_writable(path.parent):
        raise ToolError(f"{path}: statistics cannot be written there.")


def blender_command(choice: str | None) -> tuple[list[str], bool]:
    """The command that runs a Python script inside the chosen Blender, and whether that is a real Blender."""
    if choice is None or choice in {blender.version for blender in environments.BLENDERS}:
        return [str(environments.blender_python(choice)), "-P", str(JOB), "--"], False
    path = shutil.which(choice)
    if path is None:
        versions = ", ".join(blender.version for blender in environments.BLENDERS)
        raise ToolError(f"--blender {choice}: neither a version ({versions}) nor a program.")
    return [path, "--background", "--python-exit-code", "1", "--python", str(JOB), "--"], True


def snapshot_command(options: Namespace, output: Path) -> list[str]:
    """The command that renders a snapshot without Blender. Raises ToolError for what only a Blender can do."""
    if options.engine != "DEEP_GBUFFER" or options.blender or options.frames or options.frame is not None:
        raise ToolError("A snapshot is one frame for our own engine: no --engine, --blender, --frame or --frames.")
    if output.suffix != ".exr":
        raise ToolError(f"{output}: a snapshot has no view transform, so its picture is written as .exr.")
    return [str(environments.development_python()), "-P", str(SNAPSHOT_JOB), "--"]


def render(options: Namespace) -> int:
    """Run the verb with the parsed command line; the exit code. Raises ToolError with the reason of any failure."""
    source = Path(options.file).resolve()
    if not source.is_file():
        raise ToolError(f"{options.file}: no such file.")
    output = Path(options.output).resolve() if options.output else default_output(source, options.engine)
    check_output(output)
    if options.stats:
        check_statistics(Path(options.stats).resolve())
    if source.suffix == SNAPSHOT_SUFFIX:
        command, real = snapshot_command(options, output), False
    else:
        command, real = blender_command(options.blender)
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_") as scratch:
        extension = None
        if real and options.engine == "DEEP_GBUFFER":
            tool = packaging.extension_tool_of(command[0])
            extension = str(packaging.for_this_machine(Path(scratch) / "extension", tool))
        frames = options.frames or ([options.frame] if options.frame is not None else None)
        job = {
            "file": str(source),
            "engine": options.engine,
            "frames": frames,
            "resolution": options.resolution,
            "samples": options.samples,
            "time_limit": options.time_limit,
            "set": options.set,
            "repeat": options.repeat,
            "layers_path": f"{output.with_suffix('')}_",
            "suffix": output.suffix.lower(),
            "scratch": scratch,
            "extension": extension,
        }
        run = Run(output, numbers=options.frames is not None)
        run.execute([*command, json.dumps(job)], Path(scratch))
    if options.stats:
        try:
            Path(options.stats).write_text(json.dumps(run.statistics, indent=1) + "\n", encoding="utf-8")
        except OSError as error:
            raise ToolError(f"{options.stats} could not be written: {error.strerror}.") from error
    return 0


class Run:
    """One Blender at work: follows its output and takes its pictures."""

    def __init__(self, output: Path, numbers: bool) -> None:
        """Pictures go to `output`, with frame numbers in the name where `numbers`."""
        self.statistics: list[dict[str, Any]] = []
        self._output = output
        self._numbers = numbers
        self._pictures = 0
        self._progress = Progress("Rendering")

    def execute(self, command: list[str], scratch: Path) -> None:
        """Run Blender to its end, inside the folder `scratch`. Raises ToolError and KeyboardInterrupt as `jobs.run`."""
        try:
            jobs.run(command, scratch, self._take, lambda: self._pictures > 0)
        finally:
            self._progress.clear()

    def _take(self, kind: str, content: Any) -> None:
        """Act on one message of the job."""
        if kind == "progress":
            self._progress.show(content)
        elif kind == "statistics":
            self.statistics = content
            for warning in dict.fromkeys(text for entry in content for text in entry["warnings"]):
                warn(f"warning: {warning}")
            for path in dict.fromkeys(path for entry in content for path in entry.get("files") or ()):
                say(f"wrote {path}")
        elif kind == "picture":
            target = numbered(self._output, content["frame"]) if self._numbers else self._output
            put_in_place(Path(content["path"]), target)
            self._pictures += 1
            self._progress.clear()
            say(f"wrote {target}")


def put_in_place(source: Path, target: Path) -> None:
    """Move a finished file to `target` so that `target` is never half a file. Raises ToolError where it cannot be."""
    try:
        with places.replacing(target) as draft:
            shutil.copyfile(source, draft)
    except OSError as error:
        raise ToolError(f"{target} could not be written: {error.strerror}.") from error
    source.unlink()
