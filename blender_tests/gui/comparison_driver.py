# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare with Cycles in a fresh Blender window, as a user does. See steps.py. This only does and records."""

import atexit
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import bpy

sys.path.append(sys.argv[sys.argv.index("--") + 1])

from steps import frames, install, module, results, run, screenshot, viewports, wait, window, write

ENDLESS = 1_000_000
"""More samples than a test has time for."""

children: list[subprocess.Popen] = []


class Recorded(subprocess.Popen):
    """A process that is remembered."""

    def __init__(self, *arguments, **options) -> None:
        super().__init__(*arguments, **options)
        children.append(self)


def comparing():
    """The add-on's own module."""
    return module("ui.comparing")


def press(*keys: str) -> None:
    """Press keys above the 3D viewport, as somebody at the keyboard does."""
    subprocess.run(["xdotool", "mousemove", "400", "400", "key", *keys], check=True)


def ask(samples: int, percent: int) -> Iterator[None]:
    """Open the operator's dialog, and confirm it."""
    with bpy.context.temp_override(window=window()):
        bpy.ops.deep_gbuffer.compare_with_cycles("INVOKE_DEFAULT", samples=samples, percent=percent)
    yield from frames(20)
    screenshot("dialog")
    press("Return")
    yield from wait(running)


def start(samples: int, percent: int) -> None:
    """Start one as a timer's script does, without the dialog, and without a window in its context."""
    with bpy.context.temp_override(window=None):
        bpy.ops.deep_gbuffer.compare_with_cycles("EXEC_DEFAULT", samples=samples, percent=percent)


def running() -> bool:
    return comparing().running() is not None


def rendering() -> bool:
    return running() and comparing().running().progress.fraction > 0.0


def ended() -> bool:
    return not running()


def settings() -> list[str]:
    """Every setting of the scene, as text."""
    scene = bpy.context.scene
    groups = [scene, scene.render, scene.view_settings, scene.cycles, scene.deep_gbuffer, *scene.view_layers]
    kept = ((group, prop) for group in groups for prop in group.bl_rna.properties)
    return [
        f"{prop.identifier} {getattr(group, prop.identifier)}"
        for group, prop in kept
        if prop.type not in {"POINTER", "COLLECTION"} and not getattr(prop, "is_array", False)
    ]


def left(temporary: str) -> dict[str, object]:
    """What there is of comparisons in Blender's temporary folder, and exit codes of all processes so far (None: it
    still runs). Reads nothing of Blender, whose data is gone when Python ends.
    """
    return {
        "folders": len(list(Path(temporary).glob("comparison_*"))),
        "processes": [child.returncode for child in children],
    }


def left_in_the_file() -> dict[str, object]:
    """The same, and the names of images."""
    images = sorted(image.name for image in bpy.data.images if image.name.startswith("Comparison"))
    return {**left(bpy.app.tempdir), "images": images}


def recent_files() -> list[str]:
    """What the menu File > Open Recent offers."""
    path = Path(bpy.utils.user_resource("CONFIG")) / "recent-files.txt"
    return path.read_text(encoding="utf-8").splitlines() if path.is_file() else []


def editors() -> list:
    return [
        area.spaces.active
        for each in bpy.context.window_manager.windows
        for area in each.screen.areas
        if area.type == "IMAGE_EDITOR"
    ]


def scenario() -> Iterator[None]:
    """Cancel one, finish two, load a file during one, and quit during the last."""
    yield from frames(5)
    install()
    module("report.comparison").subprocess = SimpleNamespace(**{**vars(subprocess), "Popen": Recorded})
    scene = bpy.context.scene
    scene.render.engine = "DEEP_GBUFFER"
    yield from frames(5)
    yield from cancelled(scene)
    yield from finished(scene)
    yield from switched()
    yield from undone()
    yield from another_file()
    yield from leave()


def cancelled(scene) -> Iterator[None]:
    """Escape ends it."""
    scene.deep_gbuffer.samples = ENDLESS
    before = settings()
    yield from ask(4, 20)
    yield from wait(rendering)
    yield from frames(20)
    screenshot("running")
    results["second_offered"] = bpy.ops.deep_gbuffer.compare_with_cycles.poll()
    press("Escape")
    yield from wait(ended)
    yield from frames(10)
    screenshot("cancelled")
    results["cancelled"] = left_in_the_file()
    results["unchanged_after_cancelling"] = settings() == before
    scene.deep_gbuffer.samples = 4


def finished(scene) -> Iterator[None]:
    """One opens a window though renders are wanted full screen; the next one takes the editor that is open."""
    bpy.context.preferences.view.render_display_type = "SCREEN"
    with bpy.context.temp_override(window=window()):
        bpy.ops.ed.undo_push(message="The last edit before comparing")
    for name, percent in (("compared", 20), ("compared_again", 10)):
        before = settings()
        start(4, percent)
        yield from wait(ended)
        yield from frames(60)
        screenshot(name)
        shown = editors()
        results[name] = {
            **left_in_the_file(),
            "windows": len(bpy.context.window_manager.windows),
            "shown": [space.image.name for space in shown],
            "sizes": [tuple(space.image.size) for space in shown],
            "sidebars": [space.show_region_ui for space in shown],
            "tables": module("ui.compare_panels").tables(comparing().numbers()),
            "unchanged": settings() == before,
            "viewports": len(viewports()),
            "files": [bpy.data.filepath, *recent_files()],
        }


def switched() -> Iterator[None]:
    """The sidebar's buttons show the other pictures."""
    other = bpy.context.window_manager.windows[-1]
    with bpy.context.temp_override(window=other, area=other.screen.areas[0]):
        bpy.ops.deep_gbuffer.show_compared(image="Comparison: Cycles")
    yield from frames(20)
    screenshot("switched")
    results["switched_to"] = [space.image.name for space in editors()]


def undone() -> Iterator[None]:
    """Undo leaves the pictures where they are."""
    with bpy.context.temp_override(window=window()):
        bpy.context.scene.deep_gbuffer.samples = 7
        bpy.ops.ed.undo_push(message="An edit after comparing")
        bpy.ops.ed.undo()
    yield from frames(20)
    screenshot("undone")
    results["undone"] = {
        "samples": bpy.context.scene.deep_gbuffer.samples,
        "images": left_in_the_file()["images"],
        "shown": [space.image.name if space.image else None for space in editors()],
    }


def another_file() -> Iterator[None]:
    """Loading a file ends it."""
    bpy.context.scene.deep_gbuffer.samples = ENDLESS
    start(4, 20)
    yield from wait(rendering)
    bpy.ops.wm.read_homefile()
    yield from frames(10)
    results["loaded"] = left_in_the_file()


def leave() -> Iterator[None]:
    """Quitting ends it."""
    bpy.context.scene.render.engine = "DEEP_GBUFFER"
    bpy.context.scene.deep_gbuffer.samples = ENDLESS
    start(4, 20)
    yield from wait(rendering)

    temporary = bpy.app.tempdir

    def gone() -> None:
        results["quit"] = left(temporary)
        write()

    atexit.register(gone)
    results["finished"] = True
    write()
    bpy.ops.wm.quit_blender()
    yield


run(scenario())
