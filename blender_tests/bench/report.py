# SPDX-License-Identifier: GPL-3.0-or-later
"""The full report over three real scenes: small pictures and tables for this folder and the README, peers checked."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from addon.report.sweep import SWEEP
from blender_tests.bench import _peers
from blender_tests.bench._runs import REPOSITORY, RESULTS, SHARED, table
from tooling import places, readme_tables
from tooling.report.columns import seconds
from tooling.report.tables import Row, rows_of

NAME = "report"
SCENES = {"cornell": "@360x360", "sponza": "", "living_room": ""}
"""And which part of their pictures is judged."""
RESOLUTION = "640x360"
ROUNDS = 1
"""More take hours on two cores: there are 61 points a scene."""

OURS = SWEEP[0].name
"""Our series in the README's table."""


def main(arguments: list[str]) -> int:
    """Run the bench; exit code 1 where the report fails or the peers are not as they were."""
    if arguments:
        print(f"{NAME} takes no arguments")
        return 2
    blends = {name: SHARED / name / f"{name}.blend" for name in SCENES}
    for blend in blends.values():
        if not blend.is_file():
            print(f"left out, as it is not there: {blend.name}")
    here = [f"{os.path.relpath(blend, REPOSITORY)}{SCENES[name]}" for name, blend in blends.items() if blend.is_file()]
    if not here:
        return 0
    folder = places.cache_directory() / "reports" / "real_scenes"
    command = [sys.executable, "build.py", "report", *here, "-o", str(folder), "--resolution", RESOLUTION]
    command += ["--rounds", str(ROUNDS)]
    if subprocess.run(
        command, cwd=REPOSITORY, env={**os.environ, "LIBGL_ALWAYS_SOFTWARE": "1"}, check=False
    ).returncode:
        print("the report has failed; nothing was taken from it")
        return 1
    text = (folder / "report.json").read_text(encoding="utf-8")
    scenes = [rows for rows in rows_of(text) if rows]
    expected = _peers.known((SHARED / "README.md").read_text(encoding="utf-8"))
    pairs = _peers.compare(expected, scenes)
    comparison = compared(pairs)
    print(comparison)
    if _peers.failures(pairs):
        print(f"nothing was taken from {folder}")
        return 1
    take_results(folder, [rows[0].scene for rows in scenes], comparison)
    readme = REPOSITORY / "README.md"
    block = readme_block(json.loads(text), scenes)
    readme.write_text(
        readme_tables.filled(readme.read_text(encoding="utf-8"), readme_tables.REPORT, block), encoding="utf-8"
    )
    return 0


def compared(pairs: Sequence[_peers.Pair]) -> str:
    """The peers' figures beside those known, and what is not as it was, as Markdown."""
    rows = [
        [pair.scene, pair.point, f"{pair.known:.3f}", "–" if pair.measured is None else f"{pair.measured:.3f}"]
        for pair in pairs
    ]
    wrong = _peers.failures(pairs)
    verdict = "".join(f"- {sentence}\n" for sentence in wrong) or (
        f"FLIP of Cycles is within {_peers.LIMIT} of the known figures, and the order of FLIP is the same throughout.\n"
    )
    return (
        "## The peers, as they were known\n\nFLIP from `../shared/scenes/README.md` beside that of this report.\n\n"
        f"{table(['scene', 'point', 'known', 'measured'], rows)}\n{verdict}"
    )


def take_results(folder: Path, names: Sequence[str], comparison: str) -> None:
    """Copy the report's document and small pictures from `folder` into the bench's results."""
    replaced = {str(folder): "FOLDER", str(SHARED.resolve()): "../shared/scenes"}
    for name in names:
        for kind, suffix in (("plots", "png"), ("crops", "jpg")):
            target = f"{NAME}_{name}.{suffix}"
            shutil.copyfile(folder / kind / f"{name}.{suffix}", RESULTS / target)
            replaced[f"{kind}/{name}.{suffix}"] = target
    document = with_replaced((folder / "report.md").read_text(encoding="utf-8"), replaced)
    made = f"\n## How this was made\n\n`python3 build.py bench {NAME}`, which runs the command above.\n\n{comparison}"
    (RESULTS / f"{NAME}.md").write_text(document + made, encoding="utf-8")


def with_replaced(text: str, replaced: Mapping[str, str]) -> str:
    """The text with every key replaced by its value."""
    for old, new in replaced.items():
        text = text.replace(old, new)
    return text


def readme_block(report: dict[str, Any], scenes: Sequence[Sequence[Row]]) -> str:
    """What the README shows: a plot per scene, and one table of the peers and of our samples."""
    results = RESULTS.relative_to(REPOSITORY).as_posix()
    names = [rows[0].scene for rows in scenes]
    pictures = "".join(f"![Error against time, {name}]({results}/{NAME}_{name}.png)\n\n" for name in names)
    shown = {row.name: row for rows in scenes for row in rows if row.series == OURS or row.engine != "DEEP_GBUFFER"}
    body = [[_title(row), *(_cell(rows, name) for rows in scenes)] for name, row in shown.items()]
    return (
        f"{pictures}Warm seconds and FLIP (lower is better), {RESOLUTION.replace('x', '×')}, cornell judged in its "
        f"360×360 centre; {report['machine']}, Blender {report['blender']}. Made by `python3 build.py bench {NAME}`; "
        f"all points, errors and commands are in [{NAME}.md]({results}/{NAME}.md).\n\n{table(['', *names], body)}"
    )


def _title(row: Row) -> str:
    """A row's name in the README."""
    return f"**Deep G-Buffer: {row.label}**" if row.series == OURS else row.name


def _cell(rows: Sequence[Row], name: str) -> str:
    """Seconds and FLIP of one point in one scene."""
    row = next((row for row in rows if row.name == name), None)
    return f"{seconds(row.warm_s)} s, {row.flip:.3f}" if row else "–"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
