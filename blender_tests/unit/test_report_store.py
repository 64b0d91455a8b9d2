# SPDX-License-Identifier: GPL-3.0-or-later
"""A report's measurements on disk: what was kept comes back, and only for what it was measured of."""

import dataclasses
import errno
import json
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.report.metrics import Errors
from addon.report.sweep import Point
from tooling.console import ToolError
from tooling.report import store as store_module
from tooling.report.plan import Task
from tooling.report.results import Judgement, Reference, Run, Subject
from tooling.report.store import Measured, Store, WriteError, writing

POINT = Point("Cycles", "4 spp", "CYCLES", {"samples": "4"})
OURS = Point("Samples", "4 spp", "DEEP_GBUFFER", {"samples": "4"})
MEASURED = Measured(
    Run(2.5, (0.5, 0.25)), 7.0, ("a texture is missing",), (("layer 2", "nothing reads it"),), "a rasteriser"
)
finite = st.floats(allow_nan=False, allow_infinity=False)


@pytest.fixture(name="subject")
def make_subject(tmp_path):
    blend = tmp_path / "room.blend"
    blend.write_bytes(b"a room")
    return Subject("room", blend, (1,), (640, 360), None)


@pytest.fixture(name="reference")
def make_reference(tmp_path):
    picture = tmp_path / "reference.exr"
    picture.write_bytes(b"the truth")
    return Reference("Cycles", 64, 0.01, 0.02, (picture,))


@pytest.fixture(name="store")
def make_store(tmp_path):
    return Store(tmp_path / "report", "5.2.3 LTS", "one machine")


def judgement(store, psnr=30.0, flicker=None):
    """A judgement whose pictures are in the store."""
    store.pictures.mkdir(parents=True, exist_ok=True)
    for name in ("a.png", "a_flip.png"):
        (store.pictures / name).write_bytes(b"picture")
    errors = Errors(0.1, 0.2, psnr, (0.1, -0.2, 0.3), 1.5, 2)
    return Judgement(errors, 0.25, flicker, "digest", store.pictures / "a.png", store.pictures / "a_flip.png")


def test_what_was_measured_comes_back(store, subject):
    task = Task(subject, POINT, 1)
    assert store.measured(task) is None
    store.keep_measured(task, MEASURED)
    assert store.measured(task) == MEASURED


@pytest.mark.parametrize("psnr", [30.5, math.inf])
@pytest.mark.parametrize("flicker", [None, 0.125])
def test_what_was_judged_comes_back(store, subject, reference, psnr, flicker):
    assert store.judgement(subject, POINT, reference) is None
    kept = judgement(store, psnr, flicker)
    store.keep_judgement(subject, POINT, reference, kept)
    assert store.judgement(subject, POINT, reference) == kept


@given(cold=finite, warm=st.lists(finite), texts=st.lists(st.text()))
def test_any_times_and_texts_come_back(tmp_path_factory, cold, warm, texts):
    folder = tmp_path_factory.mktemp("store")
    blend = folder / "room.blend"
    blend.write_bytes(b"")
    task = Task(Subject("room", blend, (1,), (8, 8), None), POINT, 1)
    measured = Measured(Run(cold, tuple(warm)), 1.0, tuple(texts), tuple((text, text) for text in texts))
    store = Store(folder, "5.2", "machine")
    store.keep_measured(task, measured)
    assert store.measured(task) == measured


def test_the_files_are_json_that_any_parser_reads(store, subject, reference):
    store.keep_measured(Task(subject, POINT, 1), MEASURED)
    store.keep_judgement(subject, POINT, reference, judgement(store, psnr=math.inf))

    def refuse(word):
        raise AssertionError(word)

    for path in store.pictures.parent.rglob("*.json"):
        content = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
        assert content["engine"] == "CYCLES"
        assert content["settings"] == {"samples": "4"}


def test_another_state_of_anything_is_measured_again(store, subject, tmp_path):
    task = Task(subject, POINT, 1)
    store.keep_measured(task, MEASURED)
    other_blend = tmp_path / "other.blend"
    other_blend.write_bytes(b"another room")
    others = [
        dataclasses.replace(task, round=2),
        dataclasses.replace(task, point=dataclasses.replace(POINT, settings={"samples": "5"})),
        dataclasses.replace(task, point=dataclasses.replace(POINT, engine="EEVEE")),
        *(
            dataclasses.replace(task, subject=dataclasses.replace(subject, **changed))
            for changed in ({"frames": (2,)}, {"resolution": (8, 8)}, {"crop": (8, 8)}, {"blend": other_blend})
        ),
    ]
    assert [store.measured(other) for other in others] == [None] * len(others)
    assert Store(tmp_path / "report", "4.5.1 LTS", "one machine").measured(task) is None
    assert Store(tmp_path / "report", "5.2.3 LTS", "another machine").measured(task) is None


def test_the_same_under_another_name_is_not_measured_again(store, subject, tmp_path):
    store.keep_measured(Task(subject, POINT, 1), MEASURED)
    moved = tmp_path / "moved.blend"
    moved.write_bytes(subject.blend.read_bytes())
    renamed = Point("Another series", "four", "CYCLES", {"samples": "4"})
    assert store.measured(Task(dataclasses.replace(subject, name="moved", blend=moved), renamed, 1)) == MEASURED


def test_another_reference_is_judged_by_again(store, subject, reference, tmp_path):
    store.keep_judgement(subject, POINT, reference, judgement(store))
    finer = tmp_path / "finer.exr"
    finer.write_bytes(b"nearer the truth")
    assert store.judgement(subject, POINT, dataclasses.replace(reference, pictures=(finer,))) is None


def test_only_ours_depends_on_our_sources(store, subject, monkeypatch):
    for point in (POINT, OURS):
        store.keep_measured(Task(subject, point, 1), MEASURED)
    monkeypatch.setattr(store_module, "rendering_sources", lambda: "other sources")
    assert store.measured(Task(subject, POINT, 1)) == MEASURED
    assert store.measured(Task(subject, OURS, 1)) is None


def test_our_sources_are_what_renders_and_not_what_measures(tmp_path, monkeypatch):
    monkeypatch.setattr(store_module.places, "REPOSITORY", tmp_path)
    rendering = ("addon/engine/final.py", "shaders/sky/sky.frag", "addon/ui/properties.py")
    measuring = ("addon/report/sweep.py", "addon/engine/__pycache__/final.pyc", "addon/ui/panels.py")
    for name in (*rendering, *measuring):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("before", encoding="utf-8")
    sources = store_module.rendering_sources.__wrapped__
    before = sources()
    for name in measuring:
        (tmp_path / name).write_text("after", encoding="utf-8")
        assert sources() == before, name
    for name in rendering:
        (tmp_path / name).write_text("after", encoding="utf-8")
        assert sources() != before, name
        before = sources()


@pytest.mark.parametrize("broken", [b"", b"{", b"[1, 2]", b'{"version": 99}', b'{"version": 1}', b"\xff\xfe", b"null"])
def test_a_broken_file_is_measured_again_and_told_of(store, subject, reference, capfd, broken):
    task = Task(subject, POINT, 1)
    store.keep_measured(task, MEASURED)
    store.keep_judgement(subject, POINT, reference, judgement(store))
    for path in store.pictures.parent.rglob("*.json"):
        path.write_bytes(broken)
    assert store.measured(task) is None
    assert store.judgement(subject, POINT, reference) is None
    assert capfd.readouterr().err.count("measured again") == 2
    store.keep_measured(task, MEASURED)
    assert store.measured(task) == MEASURED


def test_a_judgement_without_its_picture_is_made_again(store, subject, reference, capfd):
    kept = judgement(store)
    store.keep_judgement(subject, POINT, reference, kept)
    kept.heat.unlink()
    assert store.judgement(subject, POINT, reference) is None
    assert "a_flip.png is gone" in capfd.readouterr().err


@pytest.mark.parametrize("flicker", [None, 0.0, 0.5])
def test_the_references_own_flicker_comes_back(store, subject, reference, flicker):
    assert not store.is_reference_judged(subject, reference)
    store.keep_reference_flicker(subject, reference, flicker)
    assert store.is_reference_judged(subject, reference)
    assert store.reference_flicker(subject, reference) == flicker


def test_a_full_disk_is_told_of_and_leaves_the_file_from_before(store, subject, monkeypatch):
    task = Task(subject, POINT, 1)
    store.keep_measured(task, MEASURED)
    files = sorted(store.pictures.parent.rglob("*"))

    def write_half(path, text, **how):
        path.write_bytes(text[:10].encode())
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(Path, "write_text", write_half)
    with pytest.raises(WriteError, match=r"\.json could not be written: No space left on device.*is kept"):
        store.keep_measured(task, dataclasses.replace(MEASURED, process_seconds=9.0))
    assert store.measured(task) == MEASURED
    assert sorted(store.pictures.parent.rglob("*")) == files


def test_a_picture_that_cannot_be_understood_is_no_trouble_with_writing(tmp_path):
    with pytest.raises(ToolError, match="is not an EXR") as caught, writing(tmp_path):
        raise OSError("picture.exr is not an EXR file")
    assert not isinstance(caught.value, WriteError)
