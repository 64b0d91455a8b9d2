# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report is really made with: Blender in processes of its own, Cycles' references, FLIP, the page."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from addon.report.sweep import OURS, PICTURE, Point
from tooling.console import ToolError
from tooling.report import blender, device, judging, page, references
from tooling.report.interfaces import Rendered, Working
from tooling.report.plan import Look
from tooling.report.results import Reference, Run, Subject

LAYERS_FILE = "layers.exr"
"""How the names of our layer files end."""

MOTION = {**PICTURE, "samples": "1", "save_layers": "True", "save_motion": "True"}
"""Settings of ours that write depth and motion."""


@dataclass(frozen=True)
class BlenderInstruments:
    """`tooling.report.interfaces.Instruments` with the Blender of `python`.

    `warm_seconds` are spent on warm renders of each process; references are rendered with `reference_samples`.
    """

    python: Path
    warm_seconds: float
    reference_samples: int

    def device(self) -> str:
        """What our engine draws with."""
        return device.name()

    def look(self, blend: Path, resolution: tuple[int, int] | None) -> Look:
        """Open a file."""
        return blender.look(self.python, blend, resolution)

    def reference(self, subject: Subject, version: str, working: Working) -> Reference:
        """The one beside the file, or Cycles'."""
        return references.provide(subject, self.reference_samples, version, working)

    def layers(self, subject: Subject, folder: Path, working: Working) -> tuple[Path, ...]:
        """One sample of every frame by our engine, which says how surfaces move in the first view layer."""
        rendered = self._render(subject, blender.Render("motion", OURS, MOTION), folder, working)
        files = tuple(path for path in rendered.files if path.name.endswith(LAYERS_FILE))
        return one_of_each(files, len(subject.frames))

    def render(self, subject: Subject, point: Point, folder: Path, working: Working) -> Rendered:
        """Render and time a point."""
        render = blender.Render("point", point.engine, point.settings, self.warm_seconds)
        rendered = self._render(subject, render, folder, working)
        pictures = tuple(rendered.pictures[frame] for frame in subject.frames)
        run = Run(rendered.cold, rendered.warm)
        return Rendered(run, rendered.warnings, rendered.left_out, rendered.device, pictures)

    def _render(self, subject: Subject, render: blender.Render, folder: Path, working: Working) -> blender.Rendered:
        """What came of `render` in a process of its own."""
        found: list[blender.Rendered] = []
        blender.render(
            self.python,
            subject.blend,
            subject.frames,
            subject.resolution,
            [render],
            folder,
            working,
            lambda _render, rendered: found.append(rendered),
        )
        return found[0]

    judge = staticmethod(judging.judge)
    reference_flicker = staticmethod(judging.reference_flicker)
    write = staticmethod(page.write)


def one_of_each(files: Sequence[Path], frames: int) -> tuple[Path, ...]:
    """The first of each frame's layer files; they are in order of the frames, as many of each as it has view layers.

    Raises ToolError where a frame has none, or not as many as the others.
    """
    if not files or len(files) % frames:
        raise ToolError(f"{frames} frames have {len(files)} files with motion vectors.")
    return tuple(files[:: len(files) // frames])
