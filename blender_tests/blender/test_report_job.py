# SPDX-License-Identifier: GPL-3.0-or-later
"""The report's job inside Blender: what it renders, how often, and that nothing of one render is left in the next."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.report import measuring, rendering
from addon.report.messages import INTERRUPTED, read
from addon.report.pictures import combined
from addon.report.sweep import PERCENT
from tooling.console import ToolError
from tooling.report import blender

SIZE = (96, 54)
SURROUNDINGS = {**os.environ, "PYTHONPATH": str(Path(measuring.__file__).parents[2])}
MANY = "60000"  # minutes of work
A_WARM_RENDER = 1e-6  # seconds: one takes longer
OURS_ONCE = {"name": "ours", "engine": "DEEP_GBUFFER", "settings": {"samples": "1"}}
CYCLES_ONCE = {"name": "cycles", "engine": "CYCLES", "settings": {"samples": "1", "use_denoising": "False"}}
WITHOUT_CYCLES = """
import runpy, sys
import bpy
import addon_utils
addon_utils.disable("cycles")
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


@dataclass
class Told:
    """What a job told: its exit code and its messages (kind, content)."""

    code: int
    messages: list

    def all(self, kind):
        """Content of the messages of this kind, by the render's name."""
        return {content["name"]: content for told, content in self.messages if told == kind}

    def picture(self, name):
        """Pixels of a render's only picture."""
        return combined(Path(self.all("picture")[name]["path"]))


@pytest.fixture(name="cornell", scope="module")
def cornell_fixture(repository):
    return repository / "scenes" / "cornell_box.blend"


def command(repository, file, folder, renders, *, prelude=None, **changes):
    """The command line of a job of these renders; `prelude` runs the script it is given."""
    job = {"file": str(file), "scene": None, "frames": None, "resolution": SIZE, "folder": str(folder)}
    job |= {"package": "addon", **changes}
    job["renders"] = [{"warm_seconds": 0, **render} for render in renders]
    script = str(repository / "addon" / "report" / "job.py")
    return [sys.executable, "-P", *(["-c", prelude] if prelude else []), script, "--", json.dumps(job)]


def run(*arguments, **changes):
    """Run a job to its end."""
    child = subprocess.run(
        command(*arguments, **changes), env=SURROUNDINGS, stdout=subprocess.PIPE, text=True, check=False
    )
    messages = [message for line in child.stdout.split("\n") if (message := read(line))]
    return Told(child.returncode, messages)


@pytest.fixture(name="told", scope="module")
def told_fixture(repository, cornell, tmp_path_factory):
    """A job with renders of all kinds, two of which cannot be made."""
    bright = {**CYCLES_ONCE["settings"], "film_exposure": "4", PERCENT: "50"}
    renders = [
        {**OURS_ONCE, "warm_seconds": A_WARM_RENDER},
        CYCLES_ONCE,
        {"name": "no property", "engine": "CYCLES", "settings": {"sampels": "1"}},
        {"name": "bright", "engine": "CYCLES", "settings": bright, "warm_seconds": A_WARM_RENDER},
        {"name": "no value", "engine": "DEEP_GBUFFER", "settings": {"samples": "many"}},
        {"name": "workbench", "engine": "WORKBENCH", "settings": {"render_aa": "OFF"}},
        {**CYCLES_ONCE, "name": "cycles again"},
    ]
    return run(repository, cornell, tmp_path_factory.mktemp("pictures"), renders)


def test_it_tells_of_the_file_first(told):
    version = bpy.app.version_string
    assert told.code == 0
    assert told.messages[0] == ("opened", {"frame": 1, "resolution": list(SIZE), "blender": version})


def test_every_render_that_can_be_made_is(told):
    assert list(told.all("done")) == ["ours", "cycles", "bright", "workbench", "cycles again"]
    assert list(told.all("failed")) == ["no property", "no value"]
    assert told.all("picture").keys() == told.all("done").keys()


def test_a_warm_render_follows_the_cold_one_only_where_one_is_asked_for(told):
    warm = {name: len(done["warm_s"]) for name, done in told.all("done").items()}
    assert warm == {"ours": 1, "cycles": 0, "bright": 1, "workbench": 0, "cycles again": 0}
    assert all(done["cold_s"] > 0.0 for done in told.all("done").values())


def test_failures_name_what_is_wrong(told):
    failed = told.all("failed")
    assert "has no property 'sampels'; did you mean" in failed["no property"]["reason"]
    assert failed["no value"]["reason"] == "samples is a whole number, not 'many'."
    assert not any(failure["engine_missing"] for failure in failed.values())


def test_pictures_have_the_jobs_resolution_or_a_percentage_of_it(told):
    shapes = {name: told.picture(name).shape for name in told.all("done")}
    whole, half = (SIZE[1], SIZE[0], 3), (SIZE[1] // 2, SIZE[0] // 2, 3)
    assert shapes == {name: half if name == "bright" else whole for name in shapes}


def test_settings_of_one_render_are_not_there_in_the_next(told):
    assert np.array_equal(told.picture("cycles again"), told.picture("cycles"))
    assert told.picture("bright").mean() > 2.0 * told.picture("cycles").mean()


def test_what_our_engine_left_out_is_told(told):
    assert ["direct spot_cones", "no spot light"] in told.all("done")["ours"]["left_out"]
    assert told.all("done")["workbench"]["left_out"] == []


def test_progress_names_its_render(told):
    assert told.all("progress").keys() >= {"ours", "cycles", "bright"}


def test_every_frame_has_a_picture_and_our_files(repository, cornell, tmp_path):
    settings = {"samples": "1", "save_layers": "True", "save_motion": "True"}
    told = run(repository, cornell, tmp_path, [{**OURS_ONCE, "settings": settings}], frames=[1, 2], scene="Scene")
    pictures = [content for kind, content in told.messages if kind == "picture"]
    assert [picture["frame"] for picture in pictures] == [1, 2]
    assert all(combined(Path(picture["path"])).shape == (SIZE[1], SIZE[0], 3) for picture in pictures)
    done = told.all("done")["ours"]
    assert len(done["warm_s"]) == 1
    assert [Path(path).is_file() for path in done["files"]] == [True, True]
    assert {Path(path).parent for path in done["files"]} == {tmp_path}


def test_without_cycles_its_renders_fail_by_name_and_the_others_are_made(repository, cornell, tmp_path):
    told = run(repository, cornell, tmp_path, [CYCLES_ONCE, OURS_ONCE], prelude=WITHOUT_CYCLES)
    assert told.code == 0
    failed = told.all("failed")["cycles"]
    assert failed["reason"] == f"This Blender ({bpy.app.version_string}) has no engine CYCLES."
    assert failed["engine_missing"]
    assert list(told.all("done")) == ["ours"]


@pytest.mark.parametrize("broken", ["missing", "text", "cut"])
def test_a_file_that_cannot_be_opened_is_named(repository, cornell, tmp_path, broken):
    path = tmp_path / f"{broken}.blend"
    if broken != "missing":
        path.write_bytes(b"no scene" if broken == "text" else cornell.read_bytes()[:50_000])
    told = run(repository, path, tmp_path, [CYCLES_ONCE])
    assert told.code == 1
    assert [kind for kind, _ in told.messages] == ["error"]
    assert str(path) in told.messages[0][1]


def test_a_scene_that_is_not_in_the_file_is_named(repository, cornell, tmp_path):
    told = run(repository, cornell, tmp_path, [CYCLES_ONCE], scene="Elsewhere")
    assert (told.code, told.messages) == (1, [("error", f"{cornell} has no scene 'Elsewhere'.")])


def test_an_add_on_that_cannot_be_enabled_is_named():
    assert measuring.enable("no_such_add_on").startswith("The add-on no_such_add_on could not be enabled: ")


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="sends signals as Unix has them")
@pytest.mark.parametrize("engine", ["CYCLES", "DEEP_GBUFFER"])
def test_an_interrupt_ends_it_and_leaves_whole_pictures_only(repository, cornell, tmp_path, engine):
    endless = {"name": "endless", "engine": engine, "settings": {"samples": MANY}}
    child = subprocess.Popen(
        command(repository, cornell, tmp_path, [{**OURS_ONCE, "name": "first"}, endless]),
        env=SURROUNDINGS,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        messages = (message for line in child.stdout if (message := read(line)))
        assert any(content["name"] == "endless" and "Sample " in content["text"] for _, content in progress(messages))
        child.send_signal(signal.SIGINT)
        rest = [message[0] for line in child.stdout if (message := read(line))]
        assert child.wait() == INTERRUPTED
    finally:
        child.kill()
        child.wait()
    assert set(rest) <= {"progress"}
    assert [path.name for path in tmp_path.iterdir()] == ["render_0_frame_1.exr"]
    assert combined(tmp_path / "render_0_frame_1.exr").shape == (SIZE[1], SIZE[0], 3)


def test_a_picture_that_could_not_be_written_whole_is_not_there(empty_scene, monkeypatch, tmp_path):
    def full_disk(_scene, path):
        Path(path).write_bytes(b"half")
        raise RuntimeError("Error: No space left on device")

    monkeypatch.setattr(rendering, "save_picture", full_disk)
    with pytest.raises(RuntimeError, match="No space left"):
        measuring.save(empty_scene, tmp_path / "picture.exr")
    assert not (tmp_path / "picture.exr").exists()


def progress(messages):
    """The messages of progress among these."""
    return (message for message in messages if message[0] == "progress")


@pytest.mark.parametrize(
    ("frames", "warm_seconds", "order"),
    [
        (None, 0.0, [7]),
        (None, 0.5, [7, 7]),
        (None, 2.5, [7, 7, 7, 7]),
        ([3, 4], 0.0, [3, 4]),
        ([3, 4], 0.5, [3, 4]),
        ([3, 4], 2.5, [3, 4, 3, 4]),
    ],
)
def test_renders_are_repeated_until_the_warm_seconds_are_spent(empty_scene, monkeypatch, frames, warm_seconds, order):
    def one_second(scene):
        rendered.append(scene.frame_current)
        return 1.0

    rendered, kept = [], []
    monkeypatch.setattr(rendering, "render_once", one_second)
    empty_scene.frame_set(7)
    cold, warm = measuring.timed(empty_scene, frames, warm_seconds, kept.append)
    assert rendered == kept == order
    assert (cold, warm) == (1.0, [1.0] * (len(order) - 1))


def test_the_reports_side_looks_at_a_file_and_takes_pictures_as_they_are_done(cornell, tmp_path):
    python = Path(sys.executable)
    seen = blender.look(python, cornell)
    assert (seen.frame, seen.blender) == (1, bpy.app.version_string)
    taken = []
    renders = [
        blender.Render("bad", "CYCLES", {"sampels": "1"}),
        blender.Render("good", "CYCLES", CYCLES_ONCE["settings"]),
    ]
    with pytest.raises(ToolError, match="no property 'sampels'"):
        blender.render(
            python, cornell, [1], SIZE, renders, tmp_path, str, lambda *both: taken.append((both[0].name, both[1]))
        )
    ((name, rendered),) = taken
    assert (name, rendered.warm) == ("good", ())
    assert combined(rendered.pictures[1]).shape == (SIZE[1], SIZE[0], 3)
    with pytest.raises(ToolError, match=r"nothing\.blend"):
        blender.look(python, tmp_path / "nothing.blend")
