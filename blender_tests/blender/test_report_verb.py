# SPDX-License-Identifier: GPL-3.0-or-later
"""A small report with real renders: interrupted, gone on with, and with a file that is broken."""

import subprocess
import sys
from pathlib import Path

import bpy
import pytest

from addon.report.reference import REFERENCE_SETTINGS
from addon.report.sweep import Point
from tooling import environments
from tooling.report import device
from tooling.report.instruments import BlenderInstruments
from tooling.report.interfaces import Options
from tooling.report.run import make

OURS = Point("Samples", "1 spp", "DEEP_GBUFFER", {"samples": "1"})
CYCLES = Point("Cycles", "1 spp", "CYCLES", {**REFERENCE_SETTINGS, "samples": "1"})


class Recorded(BlenderInstruments):
    """Real instruments that keep a record; the page needs matplotlib, which is not where Blender is."""

    def __init__(self):
        super().__init__(Path(sys.executable), warm_seconds=0.01, reference_samples=2)
        self.__dict__.update(rendered=[], judged=[], pages=[], interrupted_at=None)  # the class is frozen

    def render(self, subject, point, folder, working):
        if point == self.interrupted_at:
            raise KeyboardInterrupt
        self.rendered.append(point)
        return super().render(subject, point, folder, working)

    def judge(self, pictures, reference, subject, layers, folder, name):
        self.judged.append(name)
        return super().judge(pictures, reference, subject, layers, folder, name)

    def write(self, report, folder):
        self.pages.append(report)


@pytest.fixture(name="options")
def make_options(repository, tmp_path, monkeypatch):
    """A report of the Cornell box in small, whose reference and environments are this test's own."""
    monkeypatch.setenv("DEEP_GBUFFER_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(environments, "blender_python", lambda _version=None: Path(sys.executable))
    blend = repository / "scenes" / "cornell_box.blend"
    return Options(((blend, (54, 54)),), tmp_path / "report", True, (96, 54), None, 1, "python3 build.py report")


def test_an_interrupted_report_goes_on_and_repeats_nothing(options, tmp_path):
    first, second = Recorded(), Recorded()
    first.__dict__["interrupted_at"] = CYCLES
    with pytest.raises(KeyboardInterrupt):
        make(options, [OURS, CYCLES], first)
    assert first.rendered == [OURS]
    assert [each.point for each in first.pages[-1].scenes[0].measurements] == [OURS]
    parts = {path: path.stat().st_mtime_ns for path in (tmp_path / "cache" / "references").rglob("*.exr")}
    assert parts

    assert make(options, [OURS, CYCLES], second) == []
    assert second.rendered == [CYCLES]
    assert len(second.judged) == 1
    assert {path: path.stat().st_mtime_ns for path in parts} == parts

    (scene,) = second.pages[-1].scenes
    assert (scene.subject.frames, scene.subject.resolution) == ((1,), (96, 54))
    assert scene.reference.samples == 2
    assert scene.reference.noise_rmse > 0.0
    assert [each.point for each in scene.measurements] == [OURS, CYCLES]
    for each in scene.measurements:
        assert each.runs[0].cold > 0.0
        assert each.warm.count >= 1
        assert 0.0 < each.judgement.flip < 1.0
        assert each.judgement.picture.is_file()
    assert second.pages[-1].machine.endswith(f"; {device.name()}")  # what it is kept for is what Blender drew with
    assert scene.measurements[0].left_out  # our engine says what this scene does not need


def test_a_sequence_is_measured_with_its_flicker(options):
    instruments = Recorded()
    scenes = ((options.scenes[0][0].with_name("turntable.blend"), None),)
    sequence = Options(scenes, options.folder, True, (64, 36), (1, 2), 1, options.command)
    assert make(sequence, [OURS], instruments) == []
    (scene,) = instruments.pages[-1].scenes
    assert len(scene.reference.pictures) == 2
    assert scene.reference_flicker > 0.0
    assert scene.measurements[0].judgement.flicker > 0.0


def test_a_broken_file_is_a_problem_and_the_others_are_measured(options, tmp_path):
    broken = tmp_path / "broken.blend"
    broken.write_bytes(options.scenes[0][0].read_bytes()[:1000])
    instruments = Recorded()
    both = Options(((broken, None), *options.scenes), options.folder, True, (96, 54), None, 1, options.command)
    (problem,) = make(both, [OURS], instruments)
    assert "broken.blend" in problem
    assert [scene.subject.name for scene in instruments.pages[-1].scenes] == ["cornell_box"]
    assert len(instruments.pages[-1].scenes[0].measurements) == 1


def test_the_verb_fails_with_a_sentence_where_the_only_file_is_broken(repository, tmp_path):
    broken, folder = tmp_path / "broken.blend", tmp_path / "report"
    broken.write_bytes((repository / "scenes" / "cornell_box.blend").read_bytes()[:1000])
    version = ".".join(str(number) for number in bpy.app.version[:2])
    command = [sys.executable, str(repository / "build.py"), "report", str(broken), "-o", str(folder), "--quick"]
    ended = subprocess.run([*command, "--blender", version], capture_output=True, text=True, check=False)
    assert ended.returncode == 1, ended.stderr
    assert "error: 1 of what was asked for could not be measured:\n  broken is left out: " in ended.stderr
    assert "broken.blend" in ended.stderr
    assert "Traceback" not in ended.stderr
    assert ended.stdout.rstrip().endswith(f"wrote {folder / 'index.html'}")
    assert "broken is left out" in (folder / "index.html").read_text(encoding="utf-8")
