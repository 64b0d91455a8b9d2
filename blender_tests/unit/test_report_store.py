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
from tooling.report import keys
from tooling.report.keys import Conditions
from tooling.report.plan import Task
from tooling.report.results import Judgement, Reference, Run, Subject
from tooling.report.store import Measured, Store, WriteError, writing

POINT = Point("Cycles", "4 spp", "CYCLES", {"samples": "4"})
OURS = Point("Samples", "4 spp", "DEEP_GBUFFER", {"samples": "4"})
MEASURED = Measured(
    Run(2.5, (0.5, 0.25)),
    7.0,
    "2026-11-22",
    ("a texture is missing",),
    (("layer 2", "nothing reads it"),),
    "a rasteriser",
)
CONDITIONS = Conditions("5.2.3 LTS", "one machine", "a rasteriser", 1.0)
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
    return Store(tmp_path / "report", CONDITIONS)


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
    name = store.picture_name(subject, POINT, reference, followed=True)
    assert store.judgement(name) is None
    kept = judgement(store, psnr, flicker)
    store.keep_judgement(name, subject, POINT, kept)
    assert store.judgement(name) == kept


@given(cold=finite, warm=st.lists(finite), texts=st.lists(st.text()))
def test_any_times_and_texts_come_back(tmp_path_factory, cold, warm, texts):
    folder = tmp_path_factory.mktemp("store")
    blend = folder / "room.blend"
    blend.write_bytes(b"")
    task = Task(Subject("room", blend, (1,), (8, 8), None), POINT, 1)
    measured = Measured(Run(cold, tuple(warm)), 1.0, "2026-11-22", tuple(texts), tuple((text, text) for text in texts))
    store = Store(folder, CONDITIONS)
    store.keep_measured(task, measured)
    assert store.measured(task) == measured


def test_the_files_are_json_that_any_parser_reads(store, subject):
    store.keep_measured(Task(subject, POINT, 1), MEASURED)
    store.keep_judgement("a name", subject, POINT, judgement(store, psnr=math.inf))

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


def test_the_same_under_another_name_is_not_measured_again(store, subject, tmp_path):
    store.keep_measured(Task(subject, POINT, 1), MEASURED)
    moved = tmp_path / "moved.blend"
    moved.write_bytes(subject.blend.read_bytes())
    renamed = Point("Another series", "four", "CYCLES", {"samples": "4"})
    assert store.measured(Task(dataclasses.replace(subject, name="moved", blend=moved), renamed, 1)) == MEASURED


def test_another_reference_is_judged_by_again(subject, reference, tmp_path):
    finer = tmp_path / "finer.exr"
    finer.write_bytes(b"nearer the truth")
    better = dataclasses.replace(reference, pictures=(finer,))
    before, after = (CONDITIONS.judgement(subject, POINT, each, followed=True) for each in (reference, better))
    assert before != after


@pytest.mark.parametrize(
    ("changed", "is_judged_again"),
    [
        ({"blender": "4.5.1 LTS"}, True),
        ({"machine": "another machine"}, False),
        ({"device": "a graphics card"}, True),
        ({"warm_seconds": 4.0}, False),
    ],
)
def test_under_other_conditions_it_is_measured_again(subject, reference, changed, is_judged_again):
    others = dataclasses.replace(CONDITIONS, **changed)
    for point in (POINT, OURS):
        assert CONDITIONS.run(Task(subject, point, 1)) != others.run(Task(subject, point, 1))
        before, after = (each.judgement(subject, point, reference, followed=True) for each in (CONDITIONS, others))
        assert (before != after) == is_judged_again
    assert (CONDITIONS.reference(subject, reference) != others.reference(subject, reference)) == is_judged_again


@pytest.mark.parametrize(
    ("names", "measured_again", "judged_again"),
    [
        (keys.RENDERING, ["DEEP_GBUFFER"], ["DEEP_GBUFFER"]),
        (keys.MEASURING, ["CYCLES", "DEEP_GBUFFER"], ["CYCLES", "DEEP_GBUFFER"]),
        (keys.JUDGING, [], ["CYCLES", "DEEP_GBUFFER"]),
    ],
)
def test_other_sources_are_measured_and_judged_with_again(
    subject, reference, monkeypatch, names, measured_again, judged_again
):
    """Peers depend on what measures and judges, not on our renderer."""

    def found():
        return [
            (
                CONDITIONS.run(Task(subject, point, 1)),
                CONDITIONS.judgement(subject, point, reference, followed=True),
                point.engine,
            )
            for point in (POINT, OURS)
        ]

    before, sources = found(), keys.sources
    monkeypatch.setattr(keys, "sources", lambda asked: "other sources" if asked == names else sources(asked))
    after = found()
    pairs = list(zip(before, after, strict=True))
    assert [old[2] for old, new in pairs if old[0] != new[0]] == measured_again
    assert [old[2] for old, new in pairs if old[1] != new[1]] == judged_again


def test_what_is_judged_without_motion_is_judged_again_with_it(subject, reference):
    names = {CONDITIONS.judgement(subject, POINT, reference, followed=followed) for followed in (True, False)}
    assert len(names) == 2


def test_every_source_is_there():
    """A file under another name would never change."""
    for name in (*keys.RENDERING, *keys.MEASURING, *keys.JUDGING):
        assert (keys.places.REPOSITORY / name).exists(), name
    assert "addon/report/sweep.py" not in (*keys.MEASURING, *keys.JUDGING)


def test_a_file_that_cannot_be_read_is_named(store, subject, reference):
    subject.blend.unlink()
    with pytest.raises(ToolError, match=r"room\.blend could not be read: No such file"):
        store.check(subject, reference)


def test_our_sources_are_what_renders_and_not_what_measures(tmp_path, monkeypatch):
    monkeypatch.setattr(keys.places, "REPOSITORY", tmp_path)
    rendering = ("addon/engine/final.py", "shaders/sky/sky.frag", "addon/ui/properties.py")
    measuring = ("addon/report/sweep.py", "addon/engine/__pycache__/final.pyc", "addon/ui/panels.py")
    for name in (*rendering, *measuring):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("before", encoding="utf-8")

    def sources():
        return keys.sources.__wrapped__(keys.RENDERING)

    before = sources()
    for name in measuring:
        (tmp_path / name).write_text("after", encoding="utf-8")
        assert sources() == before, name
    for name in rendering:
        (tmp_path / name).write_text("after", encoding="utf-8")
        assert sources() != before, name
        before = sources()


@pytest.mark.parametrize("broken", [b"", b"{", b"[1, 2]", b'{"version": 99}', b'{"version": 2}', b"\xff\xfe", b"null"])
def test_a_broken_file_is_measured_again_and_told_of(store, subject, capfd, broken):
    task = Task(subject, POINT, 1)
    store.keep_measured(task, MEASURED)
    store.keep_judgement("a name", subject, POINT, judgement(store))
    for path in store.pictures.parent.rglob("*.json"):
        path.write_bytes(broken)
    assert store.measured(task) is None
    assert store.judgement("a name") is None
    assert capfd.readouterr().err.count("measured again") == 2
    store.keep_measured(task, MEASURED)
    assert store.measured(task) == MEASURED


def test_a_judgement_without_its_picture_is_made_again(store, subject, capfd):
    kept = judgement(store)
    store.keep_judgement("a name", subject, POINT, kept)
    kept.heat.unlink()
    assert store.judgement("a name") is None
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
