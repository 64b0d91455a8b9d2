# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that people read of a report, as files."""

from collections.abc import Sequence
from pathlib import Path

from tooling import places
from tooling.report import crops, html_page, markdown_page, panels, plots, tables
from tooling.report.html_page import Media, Shot
from tooling.report.results import Report, SceneReport

PAGE_BYTES = 3_000_000
"""Upper limit of the page, kept by storing its pictures more coarsely."""
QUALITIES = (85, 70, 50, 30)
"""Of JPEG, tried in this order."""


def write(report: Report, folder: Path) -> None:
    """Write index.html, report.csv, report.json, report.md, plots/SCENE.png and crops/SCENE.jpg into `folder`.

    Files that are there are replaced, each only when its successor is complete. Pictures that cannot be read are left
    away, and the page says so. Raises OSError where a file cannot be written.
    """
    found = [_views(scene, report.blender) for scene in report.scenes]
    files = [_write_pictures(scene, views, folder) for scene, (views, _) in zip(report.scenes, found, strict=True)]
    _put(folder / "report.csv", tables.csv_text(report).encode())
    _put(folder / "report.json", tables.json_text(report).encode())
    _put(folder / "report.md", markdown_page.document(report, files).encode())
    _put(folder / "index.html", _page(report, found).encode())


def _views(scene: SceneReport, blender: str) -> tuple[crops.Views | None, str]:
    """The scene's pictures, or None and why there are none ("" where nothing was measured)."""
    if not scene.measurements:
        return None, ""
    try:
        return crops.views(scene, tables.rows(scene, blender)), ""
    except (OSError, ValueError) as error:
        return None, f"The pictures cannot be shown: {error}."


def _write_pictures(scene: SceneReport, views: crops.Views | None, folder: Path) -> list[str]:
    """Plot and crops of a scene as files; their paths relative to `folder`."""
    if not scene.measurements:
        return []
    name = scene.subject.name
    shown = [panels.panel(scene, panels.FLIP), panels.panel(scene, panels.RELATIVE_MSE)]
    made = {f"plots/{name}.png": plots.png(shown, name)}
    if views is not None:
        made[f"crops/{name}.jpg"] = crops.sheet(views)
    for path, content in made.items():
        _put(folder / path, content)
    return list(made)


def _page(report: Report, found: Sequence[tuple[crops.Views | None, str]]) -> str:
    """The page, with pictures as fine as the limit of its size allows."""
    drawn = [_plots(scene) for scene in report.scenes]
    text = ""
    for quality in QUALITIES:
        media = [
            Media(plot, _shots(views, quality), missing) for plot, (views, missing) in zip(drawn, found, strict=True)
        ]
        text = html_page.document(report, media)
        if len(text) < PAGE_BYTES:
            break
    return text


def _plots(scene: SceneReport) -> tuple[tuple[str, str], ...]:
    """The scene's plots and what they are."""
    if not scene.measurements:
        return ()
    return tuple(
        (f"{metric.name} against warm seconds, {scene.subject.name}", plots.svg(panels.panel(scene, metric)))
        for metric in panels.metrics(scene)
    )


def _shots(views: crops.Views | None, quality: int) -> tuple[Shot, ...]:
    """The pictures as JPEG."""
    return tuple(
        Shot(
            view.name,
            view.note,
            crops.jpeg(view.whole, quality),
            crops.jpeg(view.crop, quality),
            crops.jpeg(view.crop_heat, quality) if view.crop_heat else None,
        )
        for view in (views.views if views else ())
    )


def _put(path: Path, content: bytes) -> None:
    """Write a file so that it is never half there; makes the folder."""
    with places.replacing(path) as draft:
        draft.write_bytes(content)
