# SPDX-License-Identifier: GPL-3.0-or-later
"""`build.py render`: EXR files without loss; an interrupt leaves neither a process nor a file behind."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import bpy
import pytest

from addon.report.messages import INTERRUPTED
from addon.report.rendering import choose_format

MANY = 65536  # minutes of work


def test_exr_files_are_compressed_without_loss_whatever_the_file_says(empty_scene):
    image = empty_scene.render.image_settings
    choose_format(empty_scene, ".exr")
    image.exr_codec = "DWAA"
    image.color_depth = "16"
    choose_format(empty_scene, ".exr")
    assert (image.file_format, image.exr_codec, image.color_depth) == ("OPEN_EXR_MULTILAYER", "ZIP", "32")


def processes_with(text):
    """Command lines of the processes that have `text` in their environment."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if text.encode() in (process / "environ").read_bytes():
                found.append((process / "cmdline").read_bytes())
        except OSError:  # it ended meanwhile, or is another user's
            continue
    return found


@pytest.mark.skipif(not Path("/proc/self/environ").is_file(), reason="looks for processes in /proc")
def test_an_interrupted_render_leaves_nothing_behind(repository, tmp_path):
    import pty  # not on Windows, which has no /proc either

    pictures, scratch = tmp_path / "pictures", tmp_path / "scratch"
    pictures.mkdir()
    scratch.mkdir()
    version = ".".join(str(number) for number in bpy.app.version[:2])
    command = [sys.executable, str(repository / "build.py"), "render", str(repository / "scenes" / "cornell_box.blend")]
    command += ["-o", str(pictures / "out.png"), "--samples", str(MANY), "--resolution", "640x360"]
    ours, theirs = pty.openpty()  # on a terminal, progress is shown at once
    child = subprocess.Popen(
        [*command, "--blender", version],
        stdout=theirs,
        stderr=theirs,
        env={**os.environ, "TMPDIR": str(scratch)},
        start_new_session=True,
    )
    os.close(theirs)
    try:
        seen = read_until(ours, b"Sample ")
        assert b"Sample " in seen, seen.decode(errors="replace")
        assert processes_with(str(scratch))
        child.send_signal(signal.SIGINT)
        assert b"interrupted" in read_until(ours, b"interrupted")
        assert child.wait() == INTERRUPTED
    finally:
        child.kill()
        child.wait()
        os.close(ours)
    assert processes_with(str(scratch)) == []
    assert list(pictures.iterdir()) == []
    assert list(scratch.iterdir()) == []


def read_until(terminal, text):
    """What comes from `terminal` until `text` is in it or the other end is closed."""
    seen = b""
    while text not in seen:
        try:
            part = os.read(terminal, 4096)
        except OSError:  # how Linux says that the other end of a terminal is closed
            break
        if not part:
            break
        seen += part
    return seen
