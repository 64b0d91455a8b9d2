# SPDX-License-Identifier: GPL-3.0-or-later
"""A report as one HTML document: nothing is loaded from anywhere, and no script is needed to read it."""

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from tooling.report import columns, explained, summary
from tooling.report.crops import HEAT, RULE
from tooling.report.results import Report, SceneReport
from tooling.report.tables import Row, rows
from tooling.report.words import SAME_PICTURES, left_out, machine, own_left_out, reference, rounds, subject

STYLE = Path(__file__).with_name("page.css")


@dataclass(frozen=True)
class Shot:
    """A picture of the page, as JPEG files: all of it, its rectangle, and FLIP's error map of that, if there is one."""

    name: str
    note: str
    whole: bytes
    crop: bytes
    crop_heat: bytes | None


@dataclass(frozen=True)
class Media:
    """What a scene's section shows: plots as (what it is, SVG document), pictures, and why there are none ("")."""

    plots: tuple[tuple[str, str], ...] = ()
    shots: tuple[Shot, ...] = ()
    missing: str = ""


def document(report: Report, media: Sequence[Media]) -> str:
    """The whole page; one `media` per scene."""
    sections = [
        _scene(index, scene, rows(scene, report.blender), each)
        for index, (scene, each) in enumerate(zip(report.scenes, media, strict=True), start=1)
    ]
    flips = _flip_rules(max((len(each.shots) for each in media), default=0))
    names = ", ".join(scene.subject.name for scene in report.scenes)
    body = _header(report) + _explanation() + "".join(sections)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(f'{explained.TITLE}: {names}')}</title>\n"
        f"<style>\n{STYLE.read_text(encoding='utf-8')}{flips}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n"
    )


def _header(report: Report) -> str:
    """What this is, where and how it was made, and what went wrong."""
    links = [
        f'<a href="#scene-{index}">{escape(scene.subject.name)}</a>'
        for index, scene in enumerate(report.scenes, start=1)
    ]
    facts = {
        "Machine": machine(report.machine),
        "Blender": report.blender,
        "Deep G-Buffer": f"commit {report.commit}",
        "Made": report.made,
    }
    listed = "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts.items())
    quick = f'<p class="note">{escape(explained.QUICK)}</p>\n' if report.quick else ""
    return (
        f"<header>\n<h1>{explained.TITLE}</h1>\n<p>{escape(explained.INTRODUCTION)}</p>\n{quick}"
        f'<p>Scenes: {", ".join(links) or "none yet"}.</p>\n<dl class="facts">{listed}</dl>\n'
        f"<p>The command that makes this report again, or goes on with it:</p>\n<pre>{escape(report.command)}</pre>\n"
        f"{_problems(report.problems)}</header>\n"
    )


def _explanation() -> str:
    """How to read the plots and the tables."""
    terms = "".join(
        f"<dt>{escape(term)}{f' <small>{escape(better)}</small>' if better else ''}</dt><dd>{escape(meaning)}</dd>\n"
        for term, better, meaning in explained.TERMS
    )
    return (
        f"<section>\n<h2>How to read it</h2>\n<p>{escape(explained.PEERS)} {escape(explained.FRONT)}</p>\n"
        f'<dl class="terms">\n{terms}</dl>\n</section>\n'
    )


def _scene(index: int, scene: SceneReport, found: Sequence[Row], media: Media) -> str:
    """One scene's section."""
    parts = [
        f'<section id="scene-{index}">\n<h2>{escape(scene.subject.name)}</h2>\n',
        f"<p>{escape(subject(scene))}</p>\n<p>{escape(reference(scene))}</p>\n",
        _problems(scene.problems),
    ]
    if not found:
        return "".join([*parts, "<p>Nothing of this scene has been measured yet.</p>\n</section>\n"])
    parts.append(_list(summary.sentences(found, scene)))
    parts += [_plots(media), _shots(index, media), _table(found, scene), _left_out(found), _commands(found)]
    return "".join([*parts, "</section>\n"])


def _plots(media: Media) -> str:
    """The plots; they stand side by side where there is room."""
    figures = "".join(
        f'<img class="plot" alt="{escape(name)}" src="{_data("image/svg+xml", svg.encode())}">\n'
        for name, svg in media.plots
    )
    return f'<div class="plots">\n{figures}</div>\n' if figures else ""


def _shots(index: int, media: Media) -> str:
    """Pictures to flip between, then the same rectangle of all with its errors."""
    if not media.shots:
        return f'<p class="problem">{escape(media.missing)}</p>\n' if media.missing else ""
    choices, stage, crops = [], [], []
    for number_, shot in enumerate(media.shots, start=1):
        identity = f"flip-{index}-{number_}"
        checked = " checked" if number_ == 1 else ""
        choices.append(
            f'<input type="radio" name="flip-{index}" id="{identity}"{checked}>'
            f'<label for="{identity}">{escape(shot.name)}</label>\n'
        )
        stage.append(f"{_picture(shot.whole, shot.name)}\n")
        crops.append(_crop(shot))
    return (
        '<h3>Pictures</h3>\n<fieldset class="flip">\n'
        "<legend>Choose a picture; the arrow keys flip between them</legend>\n"
        f'{"".join(choices)}<div class="stage">\n{"".join(stage)}</div>\n</fieldset>\n'
        f'<div class="crops">\n{"".join(crops)}</div>\n<p class="small">{escape(f"{RULE} {HEAT}")}</p>\n'
    )


def _crop(shot: Shot) -> str:
    """A picture's rectangle above its errors."""
    heat = _picture(shot.crop_heat, f"FLIP errors of {shot.name}") if shot.crop_heat else ""
    caption = f"<figcaption><b>{escape(shot.name)}</b><br>{escape(shot.note)}</figcaption>"
    return f"<figure>{caption}{_picture(shot.crop, f'Detail of {shot.name}')}{heat}</figure>\n"


def _table(found: Sequence[Row], scene: SceneReport) -> str:
    """Every point's figures."""
    sequence = len(scene.subject.frames) > 1
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in columns.headings(sequence=sequence))
    body = "".join(_row(row, columns.cells(row, sequence=sequence), own_left_out(row, found)) for row in found)
    same = f" {escape(SAME_PICTURES)}" if any(row.same_picture_as for row in found) else ""
    return (
        f'<h3>All points</h3>\n<div class="wide"><table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody>\n'
        f'</table></div>\n<p class="small">{escape(rounds(scene))}{same}</p>\n'
    )


def _row(row: Row, cells: Sequence[str], left: Sequence[str]) -> str:
    """One line of the table; `left`: what was left out to give the same picture as another."""
    notes = [f"same picture as {row.same_picture_as}"] if row.same_picture_as else []
    notes += [f"left out: {reason}" for reason in left]
    notes += [f"{row.invalid} pixels are not finite"] if row.invalid else []
    notes += row.warnings
    small = "".join(f"<br><small>{escape(note)}</small>" for note in notes)
    kind = f"{'ours' if summary.is_ours(row) else 'peer'}{' front' if row.pareto else ''}"
    figures = "".join(f"<td>{escape(cell)}</td>" for cell in cells[1:])
    return f'<tr class="{kind}"><th scope="row">{escape(cells[columns.POINT])}{small}</th>{figures}</tr>\n'


def _left_out(found: Sequence[Row]) -> str:
    """What our engine did not do for which points, and why."""
    groups = "".join(f"<p>{escape(who)}:</p>\n{_list(reasons)}" for who, reasons in left_out(found))
    return f"<details>\n<summary>{escape(explained.LEFT_OUT)}</summary>\n{groups}</details>\n" if groups else ""


def _commands(found: Sequence[Row]) -> str:
    """The command of each point."""
    lines = "".join(f"<dt>{escape(row.title)}</dt><dd><pre>{escape(row.command)}</pre></dd>\n" for row in found)
    return (
        f"<details>\n<summary>{escape(explained.COMMANDS)}</summary>\n<p>{escape(explained.COMMANDS_NOTE)}</p>\n"
        f"<dl>\n{lines}</dl>\n</details>\n"
    )


def _problems(problems: Sequence[str]) -> str:
    """What went wrong, to be seen at once."""
    return f'<div class="problem"><b>Problems</b>\n{_list(problems)}</div>\n' if problems else ""


def _list(texts: Iterable[str]) -> str:
    """Sentences as a list; nothing where there are none."""
    items = "".join(f"<li>{escape(text)}</li>\n" for text in texts)
    return f"<ul>\n{items}</ul>\n" if items else ""


def _picture(jpeg: bytes, what: str) -> str:
    """A picture in the page itself."""
    return f'<img alt="{escape(what)}" src="{_data("image/jpeg", jpeg)}">'


def _data(kind: str, content: bytes) -> str:
    """A file as an address that holds it."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _flip_rules(count: int) -> str:
    """Style rules that show the chosen one of up to `count` pictures."""
    chosen = [
        f".flip input:nth-of-type({each}):checked ~ .stage img:nth-of-type({each})" for each in range(1, count + 1)
    ]
    return f"{', '.join(chosen)} {{ visibility: visible; }}\n" if chosen else ""
