# SPDX-License-Identifier: GPL-3.0-or-later
"""A comparison's process, its messages and its numbers, with a program in Blender's place."""

import json
import os
import signal
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from addon.output import write_channels
from addon.report import compared
from addon.report.comparison import (
    FIRST,
    OURS,
    SECOND,
    SHARES,
    Comparison,
    ComparisonError,
    Render,
    Request,
    job,
    python_path,
)
from addon.report.messages import MARK

SAYS = "import sys, time; sys.stdout.write({text!r}); sys.stdout.flush(); time.sleep({seconds})"

DEAF = "import signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); print('ready', flush=True); time.sleep(60)"
"""Ignores what `cancel` says first."""


def request(folder, says=(), seconds=0, package="addon"):
    """A comparison by a program that says some lines, and lives for some seconds more."""
    lines = [line if isinstance(line, str) else MARK + json.dumps(line) for line in says]
    program = SAYS.format(text="".join(f"{line}\n" for line in lines), seconds=seconds)
    folder.mkdir()
    return Request([sys.executable, "-c", program], folder / "scene.blend", "Scene", (64, 36), 8, package, folder)


def progress(name, text):
    return {"kind": "progress", "content": {"name": name, "text": text}}


def finished(name):
    """What is said of a render that was made."""
    picture = {"kind": "picture", "content": {"name": name, "frame": 1, "path": f"/pictures/{name}.exr"}}
    return picture, {"kind": "done", "content": {"name": name, "cold_s": 2.5}}


def followed(comparison):
    """Poll to the end; the progress after each line."""
    seen = []
    while comparison.poll():
        seen.append(comparison.progress)
    return [*seen, comparison.progress]


def test_the_job_is_ours_as_it_is_set_and_two_independent_halves_of_cycles(tmp_path):
    told = job(request(tmp_path / "work"))
    ours, first, second = told["renders"]
    assert [render["name"] for render in told["renders"]] == list(SHARES) == [OURS, FIRST, SECOND]
    assert (ours["engine"], first["engine"], second["engine"]) == ("DEEP_GBUFFER", "CYCLES", "CYCLES")
    assert all(name.startswith("save_") and value == "False" for name, value in ours["settings"].items())
    assert first["settings"].pop("seed") != second["settings"].pop("seed")
    assert first["settings"] == second["settings"]
    assert {"samples": "8", "use_denoising": "False", "time_limit": "0"}.items() <= first["settings"].items()
    assert json.loads(json.dumps(told)) == told


def test_a_python_that_is_started_finds_the_add_on(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "elsewhere")
    assert python_path("addon").split(os.pathsep) == [str(Path(compared.__file__).parents[2]), "elsewhere"]


def test_progress_grows_from_render_to_render_and_never_shrinks(tmp_path):
    says = [
        "Blender 5.2.2",
        progress(OURS, "Fra:1 | Time:00:00.00 | Sample 1/2"),
        progress(FIRST, "Scene, View Layer | Sample 4/8"),
        progress(FIRST, "Scene, A second layer | Sample 1/8"),
        progress(SECOND, "Synchronizing object | Cube"),
        progress(SECOND, "Sample 9/8"),
    ]
    comparison = Comparison(request(tmp_path / "work", says))
    fractions = []
    comparison._reader.join()
    while not comparison._lines.empty():
        comparison._take(comparison._lines.get())
        fractions.append(comparison.progress.fraction)
    assert fractions == pytest.approx([0.0, 0.1, 0.4, 0.4, 0.6, 1.0])
    assert comparison.progress.text == "Cycles, second half: Sample 9/8"
    comparison.cancel()


def test_what_was_made_is_known_in_the_end(tmp_path):
    says = [line for name in SHARES for line in finished(name)]
    comparison = Comparison(request(tmp_path / "work", says))
    assert followed(comparison)[-1].fraction == 0.0
    assert comparison.result() == {name: Render(Path(f"/pictures/{name}.exr"), 2.5) for name in SHARES}
    comparison.cancel()
    assert not (tmp_path / "work").exists()


def test_a_render_that_is_missing_is_no_result(tmp_path):
    comparison = Comparison(request(tmp_path / "work", [*finished(OURS), *finished(FIRST), "Segmentation fault"]))
    followed(comparison)
    with pytest.raises(ComparisonError, match=r"too early .*It last said: .*Segmentation fault"):
        comparison.result()
    comparison.cancel()


def test_cancelling_ends_a_process_that_works(tmp_path):
    comparison = Comparison(request(tmp_path / "work", ["ready"], seconds=600))
    while comparison._lines.empty():
        assert comparison._reader.is_alive()
    for _ in range(2):
        comparison.cancel()
    assert comparison._child.returncode != 0
    assert not comparison._reader.is_alive()
    assert not (tmp_path / "work").exists()


def test_cancelling_ends_a_process_that_does_not_listen(tmp_path, monkeypatch):
    monkeypatch.setattr("addon.report.comparison.GRACE_SECONDS", 0.01)
    deaf = Comparison(replace(request(tmp_path / "work"), blender=[sys.executable, "-c", DEAF]))
    while deaf._lines.empty():
        assert deaf._reader.is_alive()
    deaf.cancel()
    assert deaf._child.returncode == -signal.SIGKILL
    assert not (tmp_path / "work").exists()


def renders(folder, **pictures):
    """Renders of pictures (H, W, 3), as files."""
    made = {}
    for (name, picture), key in zip(pictures.items(), SHARES, strict=True):
        path = folder / f"{name}.exr"
        write_channels(path, {f"View Layer.Combined.{letter}": picture[::-1, :, i] for i, letter in enumerate("RGB")})
        made[key] = Render(path, float(len(made) + 1))
    return made


def test_the_reference_is_the_mean_of_the_halves_and_its_noise_half_their_distance(tmp_path):
    ours = np.full((3, 5, 3), 0.75, np.float32)
    first, second = np.full_like(ours, 0.25), np.full_like(ours, 0.5)
    found = compared.compare(renders(tmp_path, ours=ours, first=first, second=second), 8)
    np.testing.assert_array_equal(found.ours, ours)
    np.testing.assert_array_equal(found.cycles, np.float32(0.375))
    np.testing.assert_array_equal(found.difference, np.float32(0.375))
    numbers = found.numbers
    assert (numbers.resolution, numbers.samples) == ((5, 3), 16)
    assert (numbers.our_seconds, numbers.cycles_seconds) == (1.0, 5.0)
    assert (numbers.errors.rmse, numbers.noise_rmse) == (0.375, 0.125)
    assert not numbers.noise_counts


def test_broken_pixels_of_either_engine_do_not_stop_it(tmp_path):
    ours, first, second = (np.zeros((4, 4, 3), np.float32) for _ in range(3))
    ours[0, 0], first[1, 1], second[2, 2] = np.inf, np.nan, -np.inf
    found = compared.compare(renders(tmp_path, ours=ours, first=first, second=second), 1)
    assert found.numbers.errors.invalid == 1
    assert np.isfinite(found.cycles).all()
    assert np.isfinite(found.difference).all()
    assert not found.numbers.noise_counts


def test_pictures_of_other_sizes_are_refused(tmp_path):
    ours, cycles = np.zeros((4, 4, 3), np.float32), np.zeros((4, 5, 3), np.float32)
    with pytest.raises(ValueError, match="4×4"):
        compared.compare(renders(tmp_path, ours=ours, first=cycles, second=cycles), 1)
