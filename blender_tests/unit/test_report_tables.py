# SPDX-License-Identifier: GPL-3.0-or-later
"""A report's figures: which points are the best, what files say of them, and the peers beside what is known of them."""

import csv
import io
import json
import math
import shlex
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.report.metrics import Errors
from addon.report.sweep import Point
from blender_tests.bench import _peers
from blender_tests.bench import report as bench
from blender_tests.report_builders import errors, measurement, report, scene, swept
from build import command_line
from tooling import readme_tables
from tooling.report import columns, tables
from tooling.report.commands import repeat

NAN, INF = math.nan, math.inf
FIGURES = st.floats(allow_nan=True, allow_infinity=True) | st.sampled_from([0.0, 1.0, 2.0])
PLACES = st.lists(st.tuples(FIGURES, FIGURES), max_size=12)


def dominates(first, second):
    """Whether the first point makes the second needless."""
    return first[0] <= second[0] and first[1] <= second[1] and first != second


@given(PLACES)
def test_nothing_on_the_front_is_beaten_and_everything_else_is(places):
    front = tables.pareto_front(places)
    known = [place for place in places if not any(map(math.isnan, place))]
    for place, best in zip(places, front, strict=True):
        beaten = any(map(math.isnan, place)) or any(dominates(other, place) for other in known)
        assert best is not beaten


def test_ties_are_on_the_front_together_and_unknown_times_are_not():
    assert tables.pareto_front([(1, 2), (1, 2), (2, 2), (1, 3), (NAN, 0), (0, NAN)]) == [True, True] + [False] * 4
    assert tables.pareto_front([]) == []


def test_a_picture_belongs_to_the_first_point_that_made_it():
    same = [measurement(digest=digest) for digest in "abacb"]
    assert tables.originals(same) == [0, 1, 0, 3, 1]


def fabricated():
    """A report with equal pictures, odd figures and an odd label."""
    odd = Point('A "series", odd', "1; 2", "CYCLES", {"samples": "1", "use_denoising": "True"})
    figures = errors(psnr=INF, rmse=0.0, fireflies=NAN)
    perfect = measurement(odd, flip=0.0, errors=figures, warnings=("one", "two\nlines"))
    return report(scene([*swept(), perfect]), scene([], "empty"))


def same(first, second):
    """Equal, where NaN equals itself."""
    return first == second or (isinstance(first, float) and math.isnan(first) and math.isnan(second))


def test_json_gives_every_row_back_and_any_parser_reads_it():
    made = fabricated()
    text = tables.json_text(made)

    def refuse(name):
        raise AssertionError(name)

    assert json.loads(text, parse_constant=refuse)["command"] == made.command
    expected = [tables.rows(each, made.blender) for each in made.scenes]
    found = tables.rows_of(text)
    assert [len(rows) for rows in found] == [len(rows) for rows in expected]
    for first, second in zip(found[0], expected[0], strict=True):
        assert all(same(getattr(first, name), getattr(second, name)) for name in tables.Row.__dataclass_fields__)


def test_a_json_of_another_format_is_refused():
    with pytest.raises(ValueError, match="format 2"):
        tables.rows_of('{"format": 2}')


def test_csv_has_a_line_per_point_and_units_in_its_header():
    made = fabricated()
    lines = list(csv.DictReader(io.StringIO(tables.csv_text(made))))
    expected = tables.rows(made.scenes[0], made.blender)
    assert [(line["series"], line["label"]) for line in lines] == [(row.series, row.label) for row in expected]
    assert [float(line["warm_s [s]"]) for line in lines] == [row.warm_s for row in expected]
    assert [float(line["flip [0 to 1]"]) for line in lines] == [row.flip for row in expected]
    assert (lines[-1]["psnr [dB]"], lines[-1]["warnings"]) == ("inf", "one; two\nlines")
    assert lines[-1]["settings"] == "samples=1; use_denoising=True"


def test_a_row_has_every_error_in_its_own_place():
    figures = Errors(0.1, 0.2, 0.3, (0.4, 0.5, 0.6), 0.7, 8)
    row = tables.rows(scene([measurement(cold=9.0, flip=0.9, flicker=0.8, errors=figures)]), "5.2")[0]
    assert (row.rmse, row.relative_mse, row.psnr, row.fireflies, row.invalid) == (0.1, 0.2, 0.3, 0.7, 8)
    assert (row.bias_red, row.bias_green, row.bias_blue) == (0.4, 0.5, 0.6)
    assert (row.flip, row.flicker, row.cold_s, row.cold_renders) == (0.9, 0.8, 9.0, 1)


def test_medians_are_over_all_processes_and_an_untimed_point_has_none():
    row = tables.rows(scene([measurement(warm=(3.0, 1.0, 2.0))]), "5.2")[0]
    assert (row.warm_s, row.warm_least_s, row.warm_greatest_s, row.warm_renders) == (2.0, 1.0, 3.0, 3)
    untimed = tables.rows(scene([measurement(warm=())]), "5.2")[0]
    assert math.isnan(untimed.warm_s)
    assert not untimed.pareto
    assert columns.cells(untimed, sequence=True)[1:3] == ["–", "–"]
    assert columns.cells(row, sequence=True)[1:3] == ["2.00", "1.00–3.00"]


def test_a_single_render_has_no_range():
    row = tables.rows(scene([measurement(warm=(3.0,))]), "5.2")[0]
    assert columns.cells(row, sequence=False)[1:3] == ["3.00", "once"]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (0.10049, "0.100"),
        (0.9996, "1.00"),
        (12.345, "12.3"),
        (12345.6, "12,300"),
        (-0.0123, "−0.0123"),
        (0.0000123, "1.23e−5"),
        (NAN, "–"),
        (INF, "∞"),
        (-INF, "−∞"),
    ],
)
def test_numbers_have_three_digits(value, text):
    assert columns.number(value) == text


@pytest.mark.parametrize(
    ("value", "text"), [(0.0123, "+0.012"), (-0.0123, "−0.012"), (-0.0004, "0.000"), (12.34, "+12.3"), (NAN, "–")]
)
def test_signed_errors_have_a_sign(value, text):
    assert columns.signed(value) == text


@given(FIGURES)
def test_every_number_is_a_short_text(value):
    assert 1 <= len(columns.number(value)) <= 10
    assert 1 <= len(columns.seconds(value)) <= 10
    assert 1 <= len(columns.signed(value)) <= 10


def test_a_markdown_table_holds_any_text():
    table = columns.markdown_table(["a", "b"], [["x | y\nz", "<b>"]])
    assert table == "| a | b |\n| --- | --: |\n| x \\| y z | \\<b\\> |\n"


def test_the_command_of_every_point_is_one_that_build_py_takes():
    for each in swept(quick=False):
        words = shlex.split(repeat(scene([]).subject, each.point, "5.2.1"))
        assert words[:2] == ["python3", "build.py"]
        options = command_line().parse_args(words[2:])
        given_settings = dict(options.set)
        assert (options.file, options.engine, options.frame) == ("scenes/box.blend", each.point.engine, 1)
        assert options.blender == "5.2"
        if "samples" in each.point.settings:
            assert options.samples == int(each.point.settings["samples"])
        rest = set(each.point.settings) - {"samples", "taa_render_samples", "resolution_percentage"}
        assert given_settings == {name: each.point.settings[name] for name in rest}


def test_a_resolution_in_percent_becomes_pixels_and_odd_names_are_quoted():
    point = Point("Resolution scale", "50 %", "DEEP_GBUFFER", {"resolution_percentage": "50"})
    subject = scene([], "my scene; rm -rf").subject
    options = command_line().parse_args(shlex.split(repeat(subject, point, "unknown"))[2:])
    assert options.resolution == (24, 13)  # 27 lines at 50 %: Blender cuts
    assert options.file == "scenes/my scene; rm -rf.blend"
    assert options.blender is None


KNOWN = """
Words | with a line.

| | box | hall |
|---|---|---|
| Cycles 1 spp + fast denoiser | 0.41 s, .101 | 0.9 s, .112 |
| Cycles 16 spp, none | 2.9 s, .089 | 10 s, .105 |
| EEVEE 1 sample, ray tracing | 2.0 s (cold 22.8), .580 | 5.4 s (cold 24.9), .698 |
| EEVEE 16 samples, ray tracing | 9.9 s, .544 | 17.6 s, .711 |
| Workbench | 0.15 s, .709 | 0.37 s, .569 |
"""


def peers(**flips):
    """Rows of the scene `box` with the known FLIP, but for those given."""
    known = {"denoised": 0.101, "noisy": 0.089, "eevee_1": 0.58, "eevee_16": 0.544, "workbench": 0.709} | flips
    points = {
        "denoised": Point("Cycles, denoised", "1 spp", "CYCLES", {}),
        "noisy": Point("Cycles", "16 spp", "CYCLES", {}),
        "eevee_1": Point("EEVEE", "1 spp", "EEVEE", {}),
        "eevee_16": Point("EEVEE", "16 spp", "EEVEE", {}),
        "workbench": Point("Workbench", "", "WORKBENCH", {}),
    }
    measured = [measurement(points[name], flip=flip) for name, flip in known.items() if flip is not None]
    return [tables.rows(scene(measured), "5.2")]


def wrong(**flips):
    """What the comparison says where these are measured."""
    return _peers.failures(_peers.compare(_peers.known(KNOWN), peers(**flips)))


def test_the_known_table_is_read():
    known = _peers.known(KNOWN)
    assert known["hall"] == {
        "Cycles, denoised: 1 spp": 0.112,
        "Cycles: 16 spp": 0.105,
        "EEVEE: 1 spp": 0.698,
        "EEVEE: 16 spp": 0.711,
        "Workbench": 0.569,
    }
    with pytest.raises(ValueError, match="no table"):
        _peers.known("nothing\n")


def test_peers_as_they_were_are_right():
    assert wrong() == []
    assert wrong(denoised=0.1109, eevee_1=0.65) == []


def test_another_flip_of_cycles_another_order_and_a_missing_point_are_told():
    assert wrong(denoised=0.1111) == ["box: Cycles, denoised: 1 spp has FLIP 0.1111, and had 0.101."]
    assert wrong(eevee_1=0.54) == ["box: EEVEE: 1 spp and EEVEE: 16 spp have changed places."]
    assert wrong(workbench=None) == ["box: Workbench was not measured."]
    assert len(wrong(denoised=NAN)) > 0


def test_the_comparison_is_written_with_what_is_wrong():
    pairs = _peers.compare(_peers.known(KNOWN), peers(workbench=None, noisy=0.5))
    text = bench.compared(pairs)
    assert "| box | Workbench | 0.709 | – |" in text
    assert "- box: Cycles: 16 spp has FLIP 0.5000" in text
    assert "the same throughout" in bench.compared(_peers.compare(_peers.known(KNOWN), peers()))


def test_the_readme_shows_our_samples_and_all_peers_of_every_scene():
    made = report(scene(swept(), "box"), scene(swept()[:2], "hall"))
    rows = tables.rows_of(tables.json_text(made))
    block = bench.readme_block(json.loads(tables.json_text(made)), rows)
    lines = [line for line in block.splitlines() if line.startswith("|")]
    assert lines[0] == "|  | box | hall |"
    assert lines[2].startswith(
        "| **Deep G-Buffer: 1 spp** | 0.09 s, 0.300 | 0.09 s, 0.300 |".replace("0.09 s", "0.090 s")
    )
    assert any(line.startswith("| Workbench |") and line.endswith(" – |") for line in lines)
    assert not any("Layers" in line for line in lines)
    readme = f"before\n{readme_tables.REPORT.begin}old\n{readme_tables.REPORT.end}after\n"
    once = readme_tables.filled(readme, readme_tables.REPORT, block)
    assert once.startswith("before\n<!-- report")
    assert once.endswith("<!-- end of report -->\nafter\n")
    assert "old" not in once
    assert readme_tables.filled(once, readme_tables.REPORT, block) == once


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A checkout with a README, and beside it the shared scene `cornell` with what is known of its peers."""
    results, shared = tmp_path / "checkout" / "results", tmp_path / "shared"
    results.mkdir(parents=True)
    (shared / "cornell").mkdir(parents=True)
    (shared / "cornell" / "cornell.blend").write_bytes(b"")
    (shared / "README.md").write_text(KNOWN.replace("box", "cornell"), encoding="utf-8")
    readme = f"{readme_tables.REPORT.begin}{readme_tables.REPORT.end}"
    (tmp_path / "checkout" / "README.md").write_text(readme, encoding="utf-8")
    monkeypatch.setattr(bench, "REPOSITORY", tmp_path / "checkout")
    monkeypatch.setattr(bench, "RESULTS", results)
    monkeypatch.setattr(bench, "SHARED", shared)
    monkeypatch.setenv("DEEP_GBUFFER_CACHE", str(tmp_path / "cache"))
    return tmp_path / "checkout"


def reporting(monkeypatch, code, flips):
    """Let the bench find a report with these FLIP, or none where `code` is not 0; the commands it runs."""
    commands = []

    def run(command, **_more):
        commands.append(command)
        folder = Path(command[command.index("-o") + 1])
        measured = [measurement(Point(r.series, r.label, r.engine, {}), flip=r.flip) for r in peers(**flips)[0]]
        for kind, suffix in (("plots", "png"), ("crops", "jpg")):
            (folder / kind).mkdir(parents=True, exist_ok=True)
            (folder / kind / f"cornell.{suffix}").write_bytes(b"picture")
        made = tables.json_text(report(scene([measurement(), *measured], "cornell")))
        (folder / "report.json").write_text(made, encoding="utf-8")
        (folder / "report.md").write_text(f"# Report\n{folder}\n", encoding="utf-8")
        return subprocess.CompletedProcess(command, code)

    monkeypatch.setattr(bench.subprocess, "run", run)
    return commands


def test_the_bench_measures_the_scenes_that_are_here_and_fills_the_readme(checkout, monkeypatch, capsys):
    commands = reporting(monkeypatch, 0, {})
    assert bench.main([]) == 0
    (command,) = commands
    assert "../shared/cornell/cornell.blend@360x360" in command
    assert "left out, as it is not there: sponza.blend" in capsys.readouterr().out
    readme = (checkout / "README.md").read_text(encoding="utf-8")
    assert "results/report_cornell.png" in readme
    assert "| Workbench | 0.55 s, 0.709 |" in readme
    assert (checkout / "results" / "report.md").read_text(encoding="utf-8").startswith("# Report\nFOLDER\n")


@pytest.mark.parametrize(("code", "changed", "said"), [(0, {"denoised": 0.2}, "had 0.101"), (1, {}, "has failed")])
def test_the_bench_takes_nothing_where_peers_are_not_as_they_were_or_the_report_fails(
    checkout, monkeypatch, capsys, code, changed, said
):
    readme = (checkout / "README.md").read_text(encoding="utf-8")
    reporting(monkeypatch, code, changed)
    assert bench.main([]) == 1
    assert said in capsys.readouterr().out
    assert not (checkout / "results" / "report.md").exists()
    assert (checkout / "README.md").read_text(encoding="utf-8") == readme


def test_what_is_committed_names_no_place_on_this_machine(tmp_path, monkeypatch):
    folder, results = tmp_path / "made", tmp_path / "results"
    for kind, suffix in (("plots", "png"), ("crops", "jpg")):
        (folder / kind).mkdir(parents=True)
        (folder / kind / f"box.{suffix}").write_bytes(b"picture")
    text = f"-o {folder} {bench.SHARED.resolve()}/box/box.blend ![box](plots/box.png) ![box](crops/box.jpg)\n"
    (folder / "report.md").write_text(text, encoding="utf-8")
    results.mkdir()
    monkeypatch.setattr(bench, "RESULTS", results)
    bench.take_results(folder, ["box"], "compared\n")
    written = (results / "report.md").read_text(encoding="utf-8")
    links = "![box](report_box.png) ![box](report_box.jpg)"
    assert written.startswith(f"-o FOLDER ../shared/scenes/box/box.blend {links}\n")
    assert written.endswith("compared\n")
    assert (results / "report_box.jpg").read_bytes() == b"picture"
