# SPDX-License-Identifier: GPL-3.0-or-later
"""What people read of a report: a page whole in itself, safe whatever files are called, and never half there."""

import colorsys
import math
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image, ImageDraw

from addon.report.sweep import Point
from blender_tests.report_builders import SIZE, errors, measurement, picture, report, scene, swept
from tooling.report import crops, html_page, labels, markdown_page, page, panels, plots, tables, words
from tooling.report.html_page import Media, Shot

VOID = {"meta", "img", "input", "br"}
EVIL = '<script>alert("x")</script> & "quotes"'


class Reader(HTMLParser):
    """Reads a page: fails where tags do not match, and keeps texts, tags and addresses."""

    def __init__(self):
        super().__init__()
        self.open, self.texts, self.tags, self.addresses, self.identities = [], [], [], [], []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.addresses += [value for name, value in attrs if name in {"src", "href", "srcset", "action", "data"}]
        self.identities += [value for name, value in attrs if name == "id"]
        assert not any(name.startswith("on") for name, _ in attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


def read(text):
    """The page, which must be balanced and load nothing."""
    reader = Reader()
    reader.feed(text)
    reader.close()
    assert reader.open == []
    for address in reader.addresses:
        assert address.startswith(("data:", "#")), address
    assert len(set(reader.identities)) == len(reader.identities)
    assert {address[1:] for address in reader.addresses if address.startswith("#")} <= set(reader.identities)
    style = re.search(r"<style>(.*?)</style>", text, re.DOTALL)
    assert not re.search(r"url\(|@import", style[1])
    return reader


def said(reader):
    """All text of the page on one line."""
    return " ".join(" ".join(reader.texts).split())


SHOT = Shot("a picture", "0.5 s", b"whole", b"crop", b"heat")
MEDIA = Media((("FLIP", "<svg/>"),), (SHOT, replace(SHOT, crop_heat=None)))


def test_every_point_is_on_the_page_with_its_command():
    made = report(scene(swept(quick=False)))
    reader = read(html_page.document(made, [MEDIA]))
    text = said(reader)
    rows = tables.rows(made.scenes[0], made.blender)
    assert reader.tags.count("tr") == len(rows) + 1
    for row in rows:
        assert row.name in text
        assert " ".join(row.command.split()) in text
    assert "layer 2: nothing reads it" in text
    assert "same picture as Samples: 4 spp" in text
    for known in (made.machine, made.command, made.commit, "FLIP", "Pareto front", "noise"):
        assert known in text


def test_pictures_and_plots_are_in_the_page_itself():
    reader = read(html_page.document(report(scene(swept())), [MEDIA]))
    assert sum(address.startswith("data:image/jpeg") for address in reader.addresses) == 5
    assert sum(address.startswith("data:image/svg+xml") for address in reader.addresses) == 1


def test_names_from_outside_are_text_and_nothing_else():
    point = Point(EVIL, EVIL, "CYCLES", {"samples": EVIL, EVIL: EVIL})
    odd = measurement(point, warnings=(EVIL,), left_out=((EVIL, EVIL),))
    subject = scene([odd, odd], EVIL, problems=(EVIL,))
    source = replace(subject.reference, source=EVIL)
    made = report(replace(subject, reference=source), command=EVIL, machine=EVIL, commit=EVIL, problems=(EVIL,))
    media = Media(((EVIL, f"<svg>{EVIL}</svg>"),), (replace(SHOT, name=EVIL, note=EVIL),), EVIL)
    text = html_page.document(made, [media])
    reader = read(text)
    assert "script" not in reader.tags
    assert "<script" not in text
    assert EVIL in said(reader)
    prose = re.sub(r"```.*?```", "", markdown_page.document(made, [[f"plots/{EVIL}.png"]]), flags=re.DOTALL)
    assert not re.search(r"(?<!\\)<script", prose)


def test_what_was_left_out_is_told_once_for_all_and_beside_the_point_it_concerns():
    first = measurement(digest="same", left_out=(("exit", "nothing reads it"),))
    point = Point("Layers", "4", "DEEP_GBUFFER", {"layers": "4"})
    more = (("exit", "nothing reads it"), ("layers 2 to 4", "no effect"))
    peer = measurement(Point("Workbench", "", "WORKBENCH", {}), digest="other")
    found = tables.rows(scene([first, measurement(point, digest="same", left_out=more), peer]), "5.2")
    groups = [("All points", ["exit: nothing reads it"]), ("Layers: 4", ["layers 2 to 4: no effect"])]
    assert words.left_out(found) == groups
    assert [words.own_left_out(row, found) for row in found] == [[], ["layers 2 to 4: no effect"], []]
    made = report(scene([first, measurement(point, digest="same", left_out=more), peer]))
    text = said(read(html_page.document(made, [Media()])))
    assert "same picture as Samples: 4 spp left out: layers 2 to 4: no effect" in text
    assert "- layers 2 to 4: no effect" in markdown_page.document(made, [[]])


def test_a_report_that_is_not_finished_says_so():
    half = measurement(warm=())
    waiting = scene([], "hall", problems=("This Blender has no Cycles.",))
    made = report(scene([half]), waiting, problems=("Interrupted.",))
    media = [Media(missing="The pictures cannot be shown: gone."), Media()]
    text = said(read(html_page.document(made, media)))
    for known in ("Interrupted.", "This Blender has no Cycles.", "Nothing of this scene", "cannot be shown: gone."):
        assert known in text
    assert said(read(html_page.document(report(), []))).count("none yet") == 1
    markdown = markdown_page.document(made, [[], []])
    assert "**Problem:** Interrupted" in markdown
    assert "Nothing of this scene" in markdown


@pytest.mark.parametrize(
    ("days", "made_words"),
    [
        (("2026-11-22",), "2026-11-22"),
        (("2026-11-20",), "2026-11-22, measured on 2026-11-20"),
        (("2026-11-20", "2026-10-31", "2026-11-22"), "2026-11-22, measured from 2026-10-31 to 2026-11-22"),
    ],
)
def test_days_of_measurements_are_told_where_they_are_not_the_reports(days, made_words):
    made = report(scene([measurement(days=days[:1])]), scene([measurement(days=days[1:])]))
    assert f"Made {made_words} The command" in said(read(html_page.document(made, [Media(), Media()])))
    assert f", {made_words}.\n\n" in markdown_page.document(made, [[], []])


def test_sequences_have_a_column_of_flicker_and_single_frames_have_none():
    still = scene([measurement()])
    moving = replace(still, subject=replace(still.subject, frames=(1, 2)), reference_flicker=0.012)
    moving = replace(moving, measurements=(measurement(flicker=0.034),))
    assert "<td>0.0340</td>" in html_page.document(report(moving), [Media()])
    assert "flicker</th>" in html_page.document(report(moving), [Media()])
    assert "flicker</th>" not in html_page.document(report(still), [Media()])
    assert [metric.key for metric in panels.metrics(moving)][-1] == "flicker"
    assert "flicker" not in [metric.key for metric in panels.metrics(still)]


def test_drawing_on_the_processor_is_told_to_be_no_graphics_card():
    for driver in ("llvmpipe (LLVM 19.1.7, 256 bits)", "softpipe", "Software Rasterizer swrast"):
        made = report(scene([measurement()]), machine=f"Some Processor; {driver}")
        assert "no graphics card: on one, EEVEE" in said(read(html_page.document(made, [Media()])))
        assert "no graphics card: on one, EEVEE" in markdown_page.document(made, [[]])
    assert words.machine("Some Processor; NVIDIA H100") == "Some Processor; NVIDIA H100"


def test_our_points_are_called_ours_and_the_others_are_not():
    made = report(scene([measurement(digest="same"), *swept()[-1:], measurement(digest="same")]))
    markdown = markdown_page.document(made, [["plots/box.png", "crops/box.jpg"]])
    assert "| ★ Deep G-Buffer · Samples: 4 spp |" in markdown
    assert re.search(r"\n\| (★ )?Workbench \|", markdown)
    assert "picture of Deep G-Buffer · Samples: 4 spp: Samples: 4 spp." in markdown
    assert markdown.count(crops.RULE) == 1
    assert markdown.index("(crops/box.jpg)") < markdown.index(crops.HEAT) < markdown.index("| ★")
    assert crops.RULE not in markdown_page.document(made, [["plots/box.png"]])


def test_looks_of_the_other_engines_are_their_own():
    def hue(color):
        red, green, blue = (int(color[start : start + 2], 16) / 255.0 for start in (1, 3, 5))
        return colorsys.rgb_to_hls(red, green, blue)[0] * 360.0

    assert not {shape for _, shape in plots.OUR_LOOKS} & {shape for _, shape in plots.PEER_LOOKS}
    for color, _ in plots.PEER_LOOKS:
        apart = [abs(hue(color) - hue(ours)) for ours, _ in plots.OUR_LOOKS if ours != "#000000"]
        assert min(min(each, 360.0 - each) for each in apart) > 10.0


def test_captions_fit_into_their_columns():
    draw = ImageDraw.Draw(Image.new("RGB", (1, 1)))
    for row in tables.rows(scene(swept(quick=False)), "5.2"):
        lines = crops.caption(row.title)
        assert len(lines) <= 2
        assert " ".join(lines) == row.title
        assert all(draw.textlength(line, font_size=crops.FONT) <= crops.COLUMN for line in lines)


def test_a_perfect_picture_has_a_place_on_a_logarithmic_axis():
    perfect = measurement(flip=0.0, errors=errors(rmse=0.0, relative_mse=0.0, psnr=math.inf))
    unknown = measurement(flip=math.nan, digest="unknown")
    untimed = measurement(warm=(), digest="untimed")
    for others in ([], [measurement(flip=0.2, digest="other")]):
        for metric in (panels.FLIP, panels.RELATIVE_MSE, panels.RMSE):
            panel = panels.panel(scene([perfect, unknown, untimed, *others]), metric)
            dots = [dot for line in panel.lines for dot in line.dots]
            assert all(0.0 < panel.lowest < dot.error < math.inf for dot in dots)
            assert any(dot.is_zero for dot in dots)
            assert all(error > 0.0 for _, error in panel.front)


def test_lines_join_points_that_differ_in_one_number():
    lines = {line.name: line for line in panels.panel(scene(swept(quick=False)), panels.FLIP).lines}
    assert {name for name, line in lines.items() if line.is_sweep} >= {"Samples", "Layers", "Cycles", "EEVEE"}
    assert not lines["Variant"].is_sweep
    assert not lines["Workbench"].is_sweep
    two = [
        measurement(Point("Layer preset", name, "DEEP_GBUFFER", {"layers": name, "separation": name})) for name in "12"
    ]
    assert not panels.panel(scene(two), panels.FLIP).lines[0].is_sweep
    assert lines["Cycles"].is_peer
    assert not lines["Samples"].is_peer
    named = [panels.label(lines["Samples"], dot) for dot in lines["Samples"].dots]
    assert named == ["Samples: 1 spp", "4 spp", "16 spp", "64 spp"]


def test_a_place_for_a_text_is_beside_its_mark():
    right, below = labels.Place(10.0, (1, 0)), labels.Place(10.0, (0, -1))
    assert right.box((100.0, 100.0), 40.0, 8.0, 2.0) == (120.0, 96.0, 160.0, 104.0)
    assert below.box((100.0, 100.0), 40.0, 8.0, 2.0) == (80.0, 72.0, 120.0, 80.0)
    assert labels.overlap((0.0, 0.0, 2.0, 2.0), [(1.0, 1.0, 3.0, 3.0), (5.0, 5.0, 6.0, 6.0)]) == 1.0
    assert labels.overlap((0.0, 0.0, 2.0, 2.0), []) == 0.0


def test_pictures_shown_are_ours_in_the_peers_time_our_best_and_one_of_each_other_series():
    points = [
        measurement(warm=(0.4,), flip=0.3, digest="a"),
        measurement(Point("Samples", "64 spp", "DEEP_GBUFFER", {}), warm=(9.0,), flip=0.1),
        measurement(Point("Cycles", "1 spp", "CYCLES", {}), warm=(0.45,), flip=0.4),
        measurement(Point("Cycles", "2 spp", "CYCLES", {}), warm=(0.5,), flip=0.3),
        measurement(Point("Cycles", "16 spp", "CYCLES", {}), warm=(5.0,), flip=0.2),
        measurement(Point("Cycles, denoised", "1 spp", "CYCLES", {"use_denoising": "True"}), warm=(0.5,), flip=0.2),
        measurement(Point("EEVEE", "1 spp", "EEVEE", {}), warm=(7.0,), flip=0.5),
        measurement(Point("EEVEE", "16 spp", "EEVEE", {}), warm=(70.0,), flip=0.4),
    ]
    assert crops.chosen(tables.rows(scene(points), "5.2")) == [0, 1, 3, 5, 6]
    assert crops.chosen(tables.rows(scene(points[:2]), "5.2")) == [1]
    assert crops.chosen(tables.rows(scene([measurement(warm=())]), "5.2")) == []


@given(arrays.arrays(np.float64, (3, 12, 15), elements=st.floats(0.0, 1.0)))
def test_the_rectangle_lies_in_the_picture(maps):
    left, top = crops.rectangle(list(maps), 5, 4)
    assert 0 <= left <= 15 - 5
    assert 0 <= top <= 12 - 4


def test_the_rectangle_is_where_errors_differ_most():
    flat, spot = np.full((12, 15), 0.9), np.full((12, 15), 0.9)
    spot[4:8, 10:15] = 0.1
    assert crops.rectangle([flat, spot], 5, 4) == (10, 4)
    assert crops.rectangle([1.0 - spot], 5, 4) == (10, 4)


@pytest.fixture
def drawn(tmp_path, monkeypatch):
    """A measured scene with pictures on disk, and plots that need no matplotlib."""
    monkeypatch.setattr(plots, "svg", lambda panel: f"<svg>{panel.metric.name}</svg>")
    monkeypatch.setattr(plots, "png", lambda _panels, title: title.encode())
    monkeypatch.setattr(crops, "combined", lambda _path: np.full((SIZE[1], SIZE[0], 3), 0.5, np.float32))
    picture(tmp_path / "picture.png", (200, 100, 50))
    picture(tmp_path / "heat.png", (80, 20, 120))
    return scene(swept(tmp_path))


def test_every_file_is_written_and_written_again(drawn, tmp_path):
    made = report(drawn, scene([], "hall"))
    for _ in range(2):
        page.write(made, tmp_path / "out")
    found = {str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out").rglob("*") if path.is_file()}
    assert found == {"index.html", "report.csv", "report.json", "report.md", "plots/box.png", "crops/box.jpg"}
    reader = read((tmp_path / "out" / "index.html").read_text(encoding="utf-8"))
    assert sum(address.startswith("data:image/svg+xml") for address in reader.addresses) == 3
    shown = len(crops.chosen(tables.rows(drawn, "5.2"))) + 1
    assert sum(address.startswith("data:image/jpeg") for address in reader.addresses) == 3 * shown - 1
    markdown = (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert "(plots/box.png)" in markdown
    assert "(crops/box.jpg)" in markdown


def test_pictures_that_are_gone_are_left_away_with_a_sentence(drawn, tmp_path):
    (tmp_path / "heat.png").unlink()
    page.write(report(drawn), tmp_path / "out")
    text = said(read((tmp_path / "out" / "index.html").read_text(encoding="utf-8")))
    assert "The pictures cannot be shown" in text
    assert "heat.png" in text
    assert not (tmp_path / "out" / "crops").exists()


def test_a_picture_of_another_size_is_left_away_with_a_sentence(drawn, tmp_path):
    picture(tmp_path / "heat.png", (0, 0, 0), (5, 5))
    page.write(report(drawn), tmp_path / "out")
    text = said(read((tmp_path / "out" / "index.html").read_text(encoding="utf-8")))
    assert "heat.png is 5×5, the reference 48×27" in text


def test_a_folder_that_cannot_be_written_is_an_error(drawn, tmp_path):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OSError, match="out"):
        page.write(report(drawn), tmp_path / "out")


def test_the_page_stays_below_its_limit_by_coarser_pictures(drawn, tmp_path, monkeypatch):
    noise = np.random.default_rng(1).integers(0, 255, (SIZE[1], SIZE[0], 3), np.uint8)
    Image.fromarray(noise).save(tmp_path / "picture.png")
    page.write(report(drawn), tmp_path / "fine")
    fine = (tmp_path / "fine" / "index.html").stat().st_size
    monkeypatch.setattr(page, "PAGE_BYTES", fine - 200)
    page.write(report(drawn), tmp_path / "coarse")
    assert (tmp_path / "coarse" / "index.html").stat().st_size < fine - 200
