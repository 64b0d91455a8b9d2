# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry, textures and camera of real scenes: our passes against Cycles' through the same pixel centres.

Cycles' conventions, measured: Depth is view depth, 1e10 where empty; Normal is in world space, turned towards the
viewer on back faces; Normal, Position and Diffuse Color are 0 where empty.
"""

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import pytest
from agreement_fixtures import Pair, render_pair
from engine_fixtures import registered_fixture  # noqa: F401


@dataclass(frozen=True)
class RealScene:
    """A .blend, below ../shared/scenes or below scenes/, and a frame of it."""

    path: str
    frame: int | None = None
    ours: bool = False


SCENES = {
    "sponza": RealScene("sponza/sponza.blend"),
    "living_room": RealScene("living_room/living_room.blend"),
    "robot_dance": RealScene("robot_expressive/robot_dance.blend", frame=20),
    "cornell_box": RealScene("cornell_box.blend", ours=True),
    "colonnade": RealScene("colonnade.blend", ours=True),
    "turntable": RealScene("turntable.blend", frame=7, ours=True),
}


@pytest.fixture(scope="module", params=SCENES)
def pair(
    request: pytest.FixtureRequest, registered: None, repository: Path, tmp_path_factory: pytest.TempPathFactory
) -> Pair:
    """One scene through both engines at 320×180; rendered once for all tests."""
    real = SCENES[request.param]
    folder = repository / "scenes" if real.ours else request.getfixturevalue("shared_scenes")
    bpy.ops.wm.open_mainfile(filepath=str(folder / real.path))
    scene = bpy.context.scene
    if real.frame is not None:
        scene.frame_set(real.frame)
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 320, 180, 100
    return render_pair(scene, tmp_path_factory.mktemp(request.param))


def test_coverage(pair: Pair) -> None:
    theirs, ours = pair.coverage
    assert theirs.mean() > 0.3, "the case must show something"
    assert (theirs != ours).mean() <= 0.005


def test_depth(pair: Pair) -> None:
    theirs, ours = (passes["Depth"][pair.covered] for passes in (pair.cycles, pair.ours))
    error = np.abs(ours - theirs) / theirs
    assert np.median(error) <= 1e-4
    assert (error > 1e-3).mean() <= 0.005, "but for silhouettes, the same surfaces are seen"


def test_normal(pair: Pair) -> None:
    theirs, ours = (passes["Normal"][pair.covered] for passes in (pair.cycles, pair.ours))
    lengths = np.linalg.norm(theirs, axis=-1) * np.linalg.norm(ours, axis=-1)
    known = lengths > 0.5
    angle = np.degrees(np.arccos(np.clip((theirs * ours).sum(axis=-1)[known] / lengths[known], -1.0, 1.0)))
    assert known.mean() > 0.999
    assert np.median(angle) <= 0.5
    assert (angle > 5.0).mean() <= 0.01
    assert (angle > 90.0).mean() <= 0.001, "back faces are turned towards the viewer"


def test_position(pair: Pair) -> None:
    theirs, ours = (passes["Position"][pair.covered] for passes in (pair.cycles, pair.ours))
    error = np.linalg.norm(ours - theirs, axis=-1) / pair.cycles["Depth"][pair.covered][:, 0]
    assert np.median(error) <= 1e-4
    assert (pair.ours["Position"][~pair.coverage[1]] == 0.0).all()


def test_diffuse_color(pair: Pair) -> None:
    """Textures sit where Cycles has them. One sample of Cycles does not filter a texture and ours does, so the
    colours are compared over blocks of 4×4 pixels; glass, which we show opaque, is the rest."""
    theirs, ours = (
        np.where(pair.covered[..., None], passes["Diffuse Color"][..., :3], 0.0).reshape(45, 4, 80, 4, 3).mean((1, 3))
        for passes in (pair.cycles, pair.ours)
    )
    error = np.abs(ours - theirs).mean() / theirs.mean()
    assert error <= 0.06, f"colours differ by {error:.1%}"
    correlation = np.corrcoef(theirs.ravel(), ours.ravel())[0, 1]
    assert correlation > 0.97
