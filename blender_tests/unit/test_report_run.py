# SPDX-License-Identifier: GPL-3.0-or-later
"""Making a report, with stand-ins for Blender, the judge and the page: what is measured, when, and what is left out."""

import dataclasses
import errno
from pathlib import Path

import pytest

from addon.report.metrics import Errors
from addon.report.sweep import Point
from tooling.console import ToolError
from tooling.report import run
from tooling.report.blender import NoEngineError
from tooling.report.interfaces import Options, Rendered
from tooling.report.plan import Look
from tooling.report.results import Judgement, Reference, Run
from tooling.report.run import make
from tooling.report.store import Store, WriteError

FAST = Point("Samples", "1 spp", "DEEP_GBUFFER", {"samples": "1"})
SLOW = Point("Samples", "4 spp", "DEEP_GBUFFER", {"samples": "4"})
PEER = Point("Cycles", "1 spp", "CYCLES", {"samples": "1"})
PEER_4 = Point("Cycles", "4 spp", "CYCLES", {"samples": "4"})
POINTS = (FAST, SLOW, PEER, PEER_4)


class Stand:
    """Instruments that only keep a record of what they were asked for.

    `rendered`: (scene, label of the series and point, …) in order. `trouble`: asked before each render what to raise.
    """

    warm_seconds = 1.0

    def __init__(self):
        self.rendered = []
        self.judged = []
        self.moved = []
        self.pages = []
        self.trouble = lambda subject, point: None
        self.judge_trouble = None
        self.motion_trouble = None
        self.flicker = 0.5

    def device(self):
        return "a rasteriser"

    def look(self, blend, resolution):
        if b"broken" in blend.read_bytes():
            raise ToolError(f"{blend.name} could not be opened: it is no Blender file.")
        return Look(1, resolution or (640, 360), "5.2.3 LTS")

    def reference(self, subject, version, working):
        assert version == "5.2.3 LTS"
        working("part 1 of 2")
        if b"endless" in subject.blend.read_bytes():
            raise ToolError(f"{subject.name} has no reference: This Blender has no engine CYCLES.")
        return Reference("Cycles", 64, 0.01, 0.02, (subject.blend,))

    def layers(self, subject, folder, working):
        self.moved.append(subject.name)
        if self.motion_trouble:
            raise self.motion_trouble
        return tuple(folder / f"{frame}.exr" for frame in subject.frames)

    def render(self, subject, point, folder, working):
        assert folder.is_dir()
        if error := self.trouble(subject, point):
            raise error
        self.rendered.append((subject.name, point.series, point.label))
        return Rendered(
            Run(2.0, (1.0,)), ("a warning",), (("layer 2", "unused"),), "a rasteriser", (folder / "picture.exr",)
        )

    def judge(self, pictures, reference, subject, layers, folder, name):
        if self.judge_trouble:
            raise self.judge_trouble
        assert (layers is None) == (len(subject.frames) == 1 or self.motion_trouble is not None)
        self.judged.append((subject.name, name))
        folder.mkdir(parents=True, exist_ok=True)
        for path in (folder / f"{name}.png", folder / f"{name}_flip.png"):
            path.write_bytes(b"")
        errors = Errors(0.1, 0.2, 30.0, (0.0, 0.0, 0.0), 0.0, 0)
        flicker = None if layers is None else 0.1
        return Judgement(errors, 0.3, flicker, "digest", folder / f"{name}.png", folder / f"{name}_flip.png")

    def reference_flicker(self, reference, subject, layers):
        assert len(layers) == len(subject.frames)
        return self.flicker

    def write(self, report, folder):
        (folder / "index.html").write_text("page", encoding="utf-8")
        self.pages.append(report)


def scene(folder, name="room", content="a room"):
    """A file that stands for a .blend."""
    blend = folder / f"{name}.blend"
    blend.write_text(content, encoding="utf-8")
    return blend


@pytest.fixture(name="options")
def make_options(tmp_path):
    folder = tmp_path / "report"
    folder.mkdir()
    return Options(((scene(tmp_path), None),), folder, True, None, None, 2, "python3 build.py report room.blend")


def with_scenes(options, *blends):
    return dataclasses.replace(options, scenes=tuple((blend, None) for blend in blends))


def test_rounds_go_over_all_scenes_and_points_in_turn(options, tmp_path):
    stand = Stand()
    both = with_scenes(options, scene(tmp_path), scene(tmp_path, "hall", "a hall"))
    assert make(both, (FAST, PEER), stand) == []
    once = [(name, point.series, point.label) for name in ("room", "hall") for point in (FAST, PEER)]
    assert stand.rendered == [*once, *once]
    assert len(set(stand.judged)) == len(stand.judged) == len(once)


def test_the_report_has_everything(options):
    stand = Stand()
    make(options, POINTS, stand)
    report = stand.pages[-1]
    assert (report.command, report.blender, report.quick) == (options.command, "5.2.3 LTS", True)
    assert report.problems == ()
    assert report.machine.endswith("; a rasteriser")
    (room,) = report.scenes
    assert room.subject.name == "room"
    assert [each.point for each in room.measurements] == list(POINTS)
    for each in room.measurements:
        assert each.runs == (Run(2.0, (1.0,)),) * 2
        assert (each.warnings, each.left_out) == (("a warning",), (("layer 2", "unused"),))


def test_the_page_is_written_after_each_round(options):
    stand = Stand()
    make(options, POINTS, stand)
    assert [len(page.scenes[0].measurements[0].runs) for page in stand.pages] == [1, 2]


def test_starting_again_repeats_nothing(options):
    make(options, POINTS, Stand())
    again = Stand()
    assert make(options, POINTS, again) == []
    assert (again.rendered, again.judged) == ([], [])
    assert len(again.pages[-1].scenes[0].measurements) == len(POINTS)


@pytest.mark.parametrize("stop_before", range(8))
def test_an_interrupted_report_goes_on_where_it_was(options, stop_before):
    first, second = Stand(), Stand()
    first.trouble = lambda subject, point: KeyboardInterrupt() if len(first.rendered) == stop_before else None
    with pytest.raises(KeyboardInterrupt):
        make(options, POINTS, first)
    assert len(first.rendered) == stop_before
    shown = first.pages[-1].scenes[0].measurements if first.pages else ()
    assert len(shown) == min(stop_before, len(POINTS))
    make(options, POINTS, second)
    whole = [("room", point.series, point.label) for _ in range(2) for point in POINTS]
    assert first.rendered + second.rendered == whole
    assert len(first.judged) + len(second.judged) == len(POINTS)


def test_what_was_not_judged_yet_is_rendered_once_more(options):
    make(options, POINTS, Stand())
    for path in (options.folder / "judged").glob("*.json"):
        path.unlink()
    again = Stand()
    make(options, POINTS, again)
    assert len(again.rendered) == len(again.judged) == len(POINTS)
    assert len(again.pages[-1].scenes[0].measurements) == len(POINTS)


def test_more_rounds_add_to_what_is_there(options):
    make(options, POINTS, Stand())
    more = Stand()
    make(dataclasses.replace(options, rounds=3), POINTS, more)
    assert len(more.rendered) == len(POINTS)
    assert more.judged == []
    assert [len(each.runs) for each in more.pages[-1].scenes[0].measurements] == [3] * len(POINTS)


def test_a_point_that_fails_is_one_problem_and_the_others_go_on(options, capfd):
    stand = Stand()
    stand.trouble = lambda subject, point: ToolError("It ran out of memory.") if point == SLOW else None
    (problem,) = make(options, POINTS, stand)
    assert problem == "room · Samples: 4 spp is left out: It ran out of memory."
    assert stand.pages[-1].scenes[0].problems == (problem,)
    assert [each.point for each in stand.pages[-1].scenes[0].measurements] == [FAST, PEER, PEER_4]
    assert capfd.readouterr().err.count("out of memory") == 1


def test_pictures_that_do_not_fit_their_reference_are_a_problem(options):
    stand = Stand()
    stand.judge_trouble = ValueError("the picture is 8×8×3 and its reference 4×4×3")
    (problem,) = make(options, [FAST], stand)
    assert problem == "room · Samples: 1 spp is left out: the picture is 8×8×3 and its reference 4×4×3."


def test_a_missing_engine_is_one_problem_and_tried_once(options, tmp_path):
    stand = Stand()
    tried = []

    def no_cycles(subject, point):
        if point.engine != "CYCLES":
            return None
        tried.append(point)
        return NoEngineError("This Blender (5.2.3 LTS) has no engine CYCLES.")

    stand.trouble = no_cycles
    (problem,) = make(with_scenes(options, scene(tmp_path), scene(tmp_path, "hall", "a hall")), POINTS, stand)
    assert "no engine CYCLES" in problem
    assert len(tried) == 1
    assert stand.pages[-1].problems == (problem,)
    assert [[each.point for each in room.measurements] for room in stand.pages[-1].scenes] == [[FAST, SLOW]] * 2


@pytest.mark.parametrize(("content", "words"), [("broken", "no Blender file"), ("endless", "has no reference")])
def test_a_scene_that_cannot_be_measured_is_a_problem_and_the_others_go_on(options, tmp_path, content, words):
    stand = Stand()
    (problem,) = make(with_scenes(options, scene(tmp_path, "bad", content), scene(tmp_path)), POINTS, stand)
    assert "bad is left out" in problem
    assert words in problem
    assert stand.pages[-1].problems == (problem,)
    assert [room.subject.name for room in stand.pages[-1].scenes] == ["room"]


def test_where_no_scene_can_be_opened_the_page_says_so(options, tmp_path, capfd):
    """In place of an old page, which would look like what was asked for now."""
    stand = Stand()
    (problem,) = make(with_scenes(options, scene(tmp_path, "bad", "broken")), POINTS, stand)
    assert stand.rendered == []
    assert [(page.scenes, page.problems, page.blender) for page in stand.pages] == [((), (problem,), "unknown")]
    assert f"wrote {options.folder / 'index.html'}" in capfd.readouterr().out


def test_without_a_new_page_none_is_said_to_be_written(options, tmp_path, capfd):
    (options.folder / "index.html").write_text("an old page", encoding="utf-8")
    stand = Stand()
    stand.device = interrupt
    with pytest.raises(KeyboardInterrupt):
        make(options, POINTS, stand)
    assert "wrote" not in capfd.readouterr().out


def interrupt(*_unused):
    raise KeyboardInterrupt


def no_space(*_unused, **_how):
    raise OSError(errno.ENOSPC, "No space left on device", "/scratch/room")


@pytest.mark.parametrize(("trouble", "kind"), [(interrupt, KeyboardInterrupt), (no_space, ToolError)])
def test_a_page_is_not_replaced_before_every_scene_was_looked_at(options, tmp_path, monkeypatch, trouble, kind):
    both = with_scenes(options, scene(tmp_path), scene(tmp_path, "hall", "a hall"))
    make(both, POINTS, Stand())
    again = Stand()
    look = again.look
    again.look = lambda blend, resolution: look(blend, resolution) if blend.stem == "room" else trouble()
    with pytest.raises(kind):
        make(both, POINTS, again)
    assert again.pages == []


def test_a_full_folder_for_temporary_files_is_told_of_and_the_page_is_written(options, monkeypatch):
    stand = Stand()
    fill = len(POINTS)
    stand.trouble = lambda subject, point: no_space() if len(stand.rendered) == fill else None
    with pytest.raises(ToolError, match=r"^/scratch/room: No space left on device\. What was finished before is kept"):
        make(options, POINTS, stand)
    assert len(stand.pages[-1].scenes[0].measurements) == len(POINTS)
    monkeypatch.setattr("tempfile.mkdtemp", no_space)
    with pytest.raises(ToolError, match=r"^/scratch/room: No space left on device"):
        make(options, POINTS, Stand())


def test_no_folder_for_temporary_files_is_told_of(options, monkeypatch):
    monkeypatch.setenv("TMPDIR", "/nowhere")
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.setattr("tempfile._get_default_tempdir", _no_folder)
    with pytest.raises(ToolError, match=r"^No usable temporary directory found in \['/nowhere'\]\. What"):
        make(options, POINTS, Stand())


def _no_folder(*_unused):
    raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/nowhere']")


def test_a_file_that_cannot_be_read_is_a_problem_and_the_others_go_on(options, tmp_path):
    """It goes away while its reference is made."""
    stand = Stand()
    reference = stand.reference

    def lose(subject, version, working):
        made = reference(subject, version, working)
        if subject.name == "lost":
            subject.blend.unlink()
        return made

    stand.reference = lose
    (problem,) = make(with_scenes(options, scene(tmp_path, "lost", "a cave"), scene(tmp_path)), POINTS, stand)
    assert problem.startswith(f"lost is left out: {tmp_path / 'lost.blend'} could not be read: ")
    assert [len(room.measurements) for room in stand.pages[-1].scenes] == [len(POINTS)]


def test_what_was_measured_before_is_dated(options, monkeypatch):
    monkeypatch.setattr(run, "date", Day("2026-11-02"))
    make(dataclasses.replace(options, rounds=1), POINTS, Stand())
    monkeypatch.setattr(run, "date", Day("2026-11-22"))
    first, second = Stand(), Stand()
    make(dataclasses.replace(options, rounds=1), POINTS, first)
    assert first.pages[-1].made == "2026-11-22, measured on 2026-11-02"
    make(options, POINTS, second)
    assert second.pages[-1].made == "2026-11-22, measured from 2026-11-02 to 2026-11-22"


def test_what_was_measured_today_needs_no_other_date(options):
    stand = Stand()
    make(options, POINTS, stand)
    assert stand.pages[-1].made == stand.pages[-1].date


class Day:
    """Stands for datetime.date, where today is this."""

    def __init__(self, today):
        self._today = today

    def today(self):
        return self

    def isoformat(self):
        return self._today


def test_another_device_is_measured_and_judged_again(options):
    make(options, POINTS, Stand())
    other = Stand()
    other.device = lambda: "a graphics card"
    make(options, POINTS, other)
    assert len(other.rendered) == 2 * len(POINTS)
    assert len(other.judged) == len(POINTS)


def test_other_warm_seconds_are_measured_again_but_not_judged(options):
    make(options, POINTS, Stand())
    longer = Stand()
    longer.warm_seconds = 4.0
    make(options, POINTS, longer)
    assert len(longer.rendered) == 2 * len(POINTS)
    assert longer.judged == []


def test_a_sequence_without_motion_is_judged_but_for_flicker(options):
    sequence = dataclasses.replace(options, frames=(1, 2, 3))
    still, again, moving = Stand(), Stand(), Stand()
    for stand in (still, again):
        stand.motion_trouble = ToolError("No OpenGL.")
        (problem,) = make(sequence, POINTS, stand)
        assert problem == "The flicker of room is left out: No OpenGL."
        (room,) = stand.pages[-1].scenes
        assert room.problems == (problem,)
        assert [each.judgement.flicker for each in room.measurements] == [None] * len(POINTS)
    assert again.rendered == []
    assert make(sequence, POINTS, moving) == []
    (room,) = moving.pages[-1].scenes
    assert [each.judgement.flicker for each in room.measurements] == [0.1] * len(POINTS)
    assert room.reference_flicker == 0.5


def test_a_rectangle_larger_than_the_picture_is_a_problem(options):
    too_large = dataclasses.replace(options, scenes=((options.scenes[0][0], (641, 360)),))
    (problem,) = make(too_large, POINTS, Stand())
    assert "a rectangle of 641x360 cannot be judged in a picture of 640x360" in problem


def test_two_files_of_one_name_are_told_apart(options, tmp_path):
    stand = Stand()
    (tmp_path / "other").mkdir()
    make(with_scenes(options, scene(tmp_path), scene(tmp_path / "other", "room", "another room")), POINTS, stand)
    assert [room.subject.name for room in stand.pages[-1].scenes] == ["room", "room_2"]


def test_a_full_disk_ends_the_report_and_what_was_finished_is_kept(options, monkeypatch):
    stand, after = Stand(), Stand()
    stand.judge_trouble = None
    keep = Store.keep_measured

    def full(store, task, measured):
        if len(stand.rendered) == 3:
            raise WriteError("measured/1.json could not be written: No space left on device.")
        keep(store, task, measured)

    with monkeypatch.context() as patch:
        patch.setattr(Store, "keep_measured", full)
        with pytest.raises(WriteError, match="No space left"):
            make(options, POINTS, stand)
    assert len(stand.rendered) == 3
    assert len(stand.pages[-1].scenes[0].measurements) == 2
    make(options, POINTS, after)
    assert len(after.rendered) == 6


def test_a_full_disk_while_judging_ends_the_report(options):
    stand = Stand()
    stand.judge_trouble = OSError(errno.ENOSPC, "No space left on device", "a.png")
    with pytest.raises(WriteError, match="judged could not be written: No space left on device"):
        make(options, POINTS, stand)
    assert len(stand.rendered) == 1


def test_a_page_that_cannot_be_written_is_told_of(options, monkeypatch):
    def full(stand, report, folder):
        raise OSError(errno.EROFS, "Read-only file system", str(folder / "index.html"))

    monkeypatch.setattr(Stand, "write", full)
    with pytest.raises(WriteError, match="Read-only file system"):
        make(options, POINTS, Stand())
    monkeypatch.undo()
    again = Stand()
    make(options, POINTS, again)
    assert len(again.rendered) == len(POINTS)  # the second round: the first was kept


@pytest.mark.parametrize("flicker", [0.5, None])
def test_motion_of_a_sequence_is_rendered_once_and_not_at_all_when_all_is_judged(options, flicker):
    """Without a flicker, too, where nothing of the reference can be followed."""
    first, again = Stand(), Stand()
    first.flicker = again.flicker = flicker
    sequence = dataclasses.replace(options, frames=(1, 2, 3))
    make(sequence, POINTS, first)
    assert first.moved == ["room"]
    assert first.pages[-1].scenes[0].reference_flicker == flicker
    make(sequence, POINTS, again)
    assert again.moved == []
    assert again.pages[-1].scenes[0].reference_flicker == flicker


def test_pictures_are_gone_when_the_report_is_done(options, monkeypatch, tmp_path):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    make(options, POINTS, Stand())
    assert list(tmp_path.glob("deep_gbuffer_report_*")) == []
    assert not any(path.suffix == ".exr" for path in Path(options.folder).rglob("*"))
