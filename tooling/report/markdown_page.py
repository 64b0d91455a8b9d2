# SPDX-License-Identifier: GPL-3.0-or-later
"""A report as Markdown, with pictures beside it."""

from collections.abc import Sequence
from urllib.parse import quote

from tooling.report import columns, explained, summary
from tooling.report.columns import markdown_table, markdown_text
from tooling.report.crops import HEAT, RULE
from tooling.report.results import Report, SceneReport
from tooling.report.tables import Row, rows
from tooling.report.words import SAME_PICTURES, left_out, machine, reference, rounds, subject


def document(report: Report, pictures: Sequence[Sequence[str]]) -> str:
    """The whole report; `pictures`: for each scene the files to show, relative to the document."""
    parts = [
        f"# {explained.TITLE}\n\n{explained.INTRODUCTION}\n\n",
        f"{explained.QUICK}\n\n" if report.quick else "",
        f"Machine: {markdown_text(machine(report.machine))}. Blender {markdown_text(report.blender)}, "
        f"Deep G-Buffer at commit {markdown_text(report.commit)}, {markdown_text(report.made)}.\n\n",
        f"```\n{report.command}\n```\n\n{_problems(report.problems)}",
        f"{explained.PEERS} {explained.FRONT}\n\n",
        "".join(
            f"- **{term}**{f' ({better})' if better else ''}: {meaning}\n" for term, better, meaning in explained.TERMS
        ),
    ]
    for scene, files in zip(report.scenes, pictures, strict=True):
        parts.append(_scene(scene, rows(scene, report.blender), files))
    return "".join(parts)


def _scene(scene: SceneReport, found: Sequence[Row], files: Sequence[str]) -> str:
    """One scene's section."""
    name = markdown_text(scene.subject.name)
    parts = [
        f"\n## {name}\n\n{markdown_text(subject(scene))}\n\n{markdown_text(reference(scene))}\n\n",
        _problems(scene.problems),
    ]
    if not found:
        return "".join([*parts, "Nothing of this scene has been measured yet.\n"])
    sequence = len(scene.subject.frames) > 1
    parts += [f"- {markdown_text(sentence)}\n" for sentence in summary.sentences(found, scene)]
    parts += [f"\n![{name}]({quote(file)})\n" for file in files]
    parts += [f"\n{RULE} {HEAT}\n" for file in files if file.startswith("crops/")]
    body = [columns.cells(row, sequence=sequence) for row in found]
    parts.append(f"\n{markdown_table(columns.headings(sequence=sequence), body)}")
    parts.append(f"\n{rounds(scene)}\n{_copies(found)}{_left_out(found)}{_commands(found)}")
    return "".join(parts)


def _copies(found: Sequence[Row]) -> str:
    """Which points are the same picture, each group in a line."""
    titles = {row.name: row.title for row in found}
    groups: dict[str, list[str]] = {}
    for row in found:
        if row.same_picture_as:
            groups.setdefault(row.same_picture_as, []).append(row.name)
    lines = "".join(
        f"\nBit for bit the picture of {markdown_text(titles[first])}: {markdown_text(', '.join(others))}.\n"
        for first, others in groups.items()
    )
    return f"{lines}\n{SAME_PICTURES}\n" if lines else ""


def _left_out(found: Sequence[Row]) -> str:
    """What our engine did not do for which points, and why."""
    groups = "".join(
        f"{markdown_text(who)}:\n\n{''.join(f'- {markdown_text(reason)}{chr(10)}' for reason in reasons)}\n"
        for who, reasons in left_out(found)
    )
    return (
        f"\n<details><summary>{markdown_text(explained.LEFT_OUT)}</summary>\n\n{groups}</details>\n" if groups else ""
    )


def _commands(found: Sequence[Row]) -> str:
    """The command of each point."""
    lines = "\n".join(row.command for row in found)
    fence = "```" if "```" not in lines else "~~~~"
    return (
        f"\n<details><summary>{markdown_text(explained.COMMANDS)}, in the order of the table</summary>\n\n"
        f"{explained.COMMANDS_NOTE}\n\n{fence}\n{lines}\n{fence}\n\n</details>\n"
    )


def _problems(problems: Sequence[str]) -> str:
    """What went wrong."""
    return "".join(f"- **Problem:** {markdown_text(problem)}\n" for problem in problems) + ("\n" if problems else "")
