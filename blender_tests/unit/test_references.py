# SPDX-License-Identifier: GPL-3.0-or-later
"""References: what the cache tells apart, that no finished part is rendered twice or half, and what noise is told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from addon.report.pictures import combined
from tooling import environments, places
from tooling.console import ToolError
from tooling.report import blender, references
from tooling.report.plan import Look
from tooling.report.references import Parts, provide, write_picture
from tooling.report.results import Subject

SIZE = (64, 48)
VERSION = "5.2.3 LTS"
TRUTH = 0.25
NOISE = 0.02


class Cycles:
    """Renders a grey picture with noise that depends on frame and seed only; ends with an error before `broken`."""

    def __init__(self):
        self.rendered = []
        self.settings = []
        self.broken = None

    def render(self, python, blend, frames, resolution, renders, folder, tell, finished):
        for render in renders:
            (frame,) = frames
            seed = render.settings["seed"]
            if (frame, seed) == self.broken:
                raise self.error
            tell("Sample 1/1")
            path = folder / f"{seed}.exr"
            write_picture(path, noisy(frame, int(seed), resolution))
            self.rendered.append((frame, seed))
            self.settings.append((render.engine, dict(render.settings)))
            finished(render, blender.Rendered(1.0, (), {frame: path}, (), (), (), VERSION))


def noisy(frame, seed, resolution=SIZE):
    """The truth with Gaussian noise of NOISE, independent for every frame and seed."""
    random = np.random.default_rng([frame, seed])
    return (TRUTH + NOISE * random.standard_normal((resolution[1], resolution[0], 3))).astype(np.float32)


@pytest.fixture(name="cycles")
def cycles_fixture(monkeypatch, tmp_path):
    cycles = Cycles()
    monkeypatch.setenv("DEEP_GBUFFER_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(blender, "render", cycles.render)
    monkeypatch.setattr(blender, "look", lambda *_unused: Look(1, SIZE, VERSION))
    monkeypatch.setattr(environments, "blender_python", Path)
    monkeypatch.setattr(references, "flip", lambda first, second: (first, float(np.abs(first - second).mean())))
    return cycles


@pytest.fixture(name="subject")
def subject_fixture(tmp_path):
    blend = tmp_path / "scene" / "box.blend"
    blend.parent.mkdir()
    blend.write_bytes(b"a scene")
    return Subject("box", blend, (1,), SIZE, None)


def show(_text):
    """Nobody watches."""


def parts_of(folder):
    """Names of the parts in the cache."""
    return sorted(path.name for path in folder.glob("references/*/part_*.exr"))


def test_a_reference_is_the_mean_of_parts_with_seeds_of_their_own(cycles, subject):
    reference = provide(subject, 256, VERSION, show)
    assert cycles.rendered == [(1, seed) for seed in "0123"]
    assert reference.samples == 256
    expected = np.mean([noisy(1, seed) for seed in range(4)], axis=0, dtype=np.float64)
    np.testing.assert_allclose(combined(reference.pictures[0]), expected, rtol=4 * np.finfo(np.float32).eps)


def test_cycles_renders_it_without_anything_that_biases_it(cycles, subject):
    provide(subject, 128, VERSION, show)
    wanted = {"samples": "64", "use_denoising": "False", "use_adaptive_sampling": "False", "time_limit": "0"}
    wanted |= {"sample_clamp_direct": "0", "sample_clamp_indirect": "0"}
    assert cycles.settings == [("CYCLES", {**wanted, "seed": seed}) for seed in "01"]


@pytest.mark.parametrize(
    ("samples", "rendered", "parts"),
    [(1, 2, 2), (16, 16, 2), (65, 66, 2), (128, 128, 2), (129, 256, 4), (1024, 1024, 16)],
)
def test_two_halves_of_equal_size_have_at_least_the_samples_asked_for(cycles, subject, samples, rendered, parts):
    assert provide(subject, samples, VERSION, show).samples == rendered
    assert len(cycles.rendered) == parts


def test_its_noise_is_that_of_the_mean(cycles, subject):
    # The mean of 4 pictures has half of their noise; 9216 values estimate it to 1 / √(2 · 9216) = 0.7 % (one sigma).
    assert provide(subject, 256, VERSION, show).noise_rmse == pytest.approx(NOISE / 2.0, rel=0.04)


def test_only_the_judged_rectangle_counts_for_the_noise(cycles, subject):
    whole = provide(subject, 128, VERSION, show)
    first, second = (noisy(1, seed)[20:28, 24:40] for seed in (0, 1))
    cut = provide(replace(subject, crop=(16, 8)), 128, VERSION, show)
    assert cut.noise_rmse == pytest.approx(float(np.sqrt(np.mean((first - second) ** 2)) / 2.0), rel=1e-5)
    assert cut.pictures == whole.pictures
    assert len(cycles.rendered) == 2


def test_every_frame_has_a_picture_of_its_own(cycles, subject):
    reference = provide(replace(subject, frames=(1, 2)), 128, VERSION, show)
    assert cycles.rendered == [(1, "0"), (1, "1"), (2, "0"), (2, "1")]
    assert len(set(reference.pictures)) == 2
    np.testing.assert_allclose(
        combined(reference.pictures[1]), (noisy(2, 0) + noisy(2, 1)) / 2.0, rtol=4 * np.finfo(np.float32).eps
    )


def test_nothing_is_rendered_twice(cycles, subject):
    first = provide(subject, 128, VERSION, show)
    assert provide(subject, 128, VERSION, show) == first
    assert len(cycles.rendered) == 2


def test_more_samples_take_over_the_parts_of_fewer(cycles, subject):
    provide(subject, 128, VERSION, show)
    cycles.rendered.clear()
    provide(subject, 256, VERSION, show)
    assert cycles.rendered == [(1, "2"), (1, "3")]


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ToolError("Blender ended without a picture")])
def test_an_interrupted_reference_renders_only_what_is_missing(cycles, subject, error):
    cycles.broken, cycles.error = (1, "2"), error
    with pytest.raises(type(error)):
        provide(subject, 256, VERSION, show)
    assert parts_of(places.cache_directory()) == ["part_0000.exr", "part_0001.exr"]
    cycles.broken = None
    reference = provide(subject, 256, VERSION, show)
    assert cycles.rendered == [(1, seed) for seed in "0123"]
    assert reference.samples == 256


def test_a_part_that_could_not_be_written_whole_is_not_there(cycles, subject, monkeypatch):
    replace_file = Path.replace

    def full_disk(self, target):
        if "references" in target.parts:
            raise OSError(28, "No space left on device", str(target))
        return replace_file(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", full_disk)
        with pytest.raises(ToolError, match="box has no reference: .*No space left"):
            provide(subject, 128, VERSION, show)
    folder = Parts(subject, 1, 64, VERSION).folder
    assert list(folder.iterdir()) == []
    provide(subject, 128, VERSION, show)
    assert parts_of(places.cache_directory()) == ["part_0000.exr", "part_0001.exr"]


def test_the_cache_knows_a_file_by_its_content_alone(cycles, subject, tmp_path):
    parts = Parts(subject, 1, 64, VERSION)
    moved = tmp_path / "moved.blend"
    moved.write_bytes(subject.blend.read_bytes())
    same = replace(subject, blend=moved, name="other", crop=(8, 8), frames=(1, 2))
    assert replace(parts, subject=same).folder == parts.folder
    moved.write_bytes(b"another scene")
    assert replace(parts, subject=same).folder != parts.folder


@pytest.mark.parametrize("change", [{"frame": 2}, {"samples": 32}, {"version": "4.5.15 LTS"}])
def test_the_cache_tells_apart_what_renders_differently(cycles, subject, change):
    parts = Parts(subject, 1, 64, VERSION)
    assert replace(parts, **change).folder != parts.folder


def test_the_cache_tells_resolutions_and_settings_apart(cycles, subject, monkeypatch):
    parts = Parts(subject, 1, 64, VERSION)
    before = parts.folder
    assert replace(parts, subject=replace(subject, resolution=(48, 64))).folder != before
    monkeypatch.setitem(references.REFERENCE_SETTINGS, "sample_clamp_indirect", "10")
    assert parts.folder != before


def test_a_reference_beside_the_file_is_taken_and_checked_by_two_pictures(cycles, subject):
    given = subject.blend.with_name("reference.exr")
    write_picture(given, noisy(1, 99))
    reference = provide(subject, 256, VERSION, show)
    assert (reference.pictures, reference.samples) == ((given,), None)
    assert [settings["samples"] for _, settings in cycles.settings] == ["32", "32"]
    # The product of two independent differences, each of variance 2 σ²: σ² ± √5 σ² / √9216, so σ ± 1.2 % (one sigma).
    assert reference.noise_rmse == pytest.approx(NOISE, rel=0.06)
    provide(subject, 256, VERSION, show)
    assert len(cycles.rendered) == 2


def test_a_reference_beside_the_file_that_shows_something_else_is_refused(cycles, subject):
    write_picture(subject.blend.with_name("reference.exr"), noisy(1, 99) + np.float32(10.0 * NOISE))
    with pytest.raises(ToolError, match="reference.exr beside box.blend does not show this file"):
        provide(subject, 256, VERSION, show)


def test_a_reference_beside_the_file_is_taken_without_cycles_too(cycles, subject):
    given = subject.blend.with_name("reference.exr")
    write_picture(given, noisy(1, 99))
    cycles.broken, cycles.error = (1, "0"), blender.NoEngineError("This Blender has no engine CYCLES.")
    reference = provide(subject, 256, VERSION, show)
    assert reference.pictures == (given,)
    assert not reference.is_noise_known


def test_a_perfect_reference_beside_the_file_has_no_noise_worth_mentioning(cycles, subject):
    write_picture(subject.blend.with_name("reference.exr"), np.full((SIZE[1], SIZE[0], 3), TRUTH, np.float32))
    reference = provide(subject, 256, VERSION, show)
    # Here the mean of 9216 products of two noises is 0 ± σ² / 96: below 4 sigma, its root is below σ / 4.
    assert reference.noise_rmse < NOISE / 4.0
    first, second = noisy(1, 0), noisy(1, 1)
    both = float(np.abs(references.display(first) - references.display(second)).mean()) / 2.0
    assert reference.noise_flip < 0.75 * both


@pytest.mark.parametrize("change", [{"resolution": (32, 24)}, {"frames": (2,)}, {"frames": (1, 2)}])
def test_a_reference_beside_the_file_that_shows_something_else_is_not_taken(cycles, subject, change):
    given = subject.blend.with_name("reference.exr")
    write_picture(given, noisy(1, 99))
    reference = provide(replace(subject, **change), 128, VERSION, show)
    assert given not in reference.pictures
    assert reference.samples == 128


def test_a_broken_reference_beside_the_file_is_named(cycles, subject):
    subject.blend.with_name("reference.exr").write_bytes(b"no picture")
    with pytest.raises(ToolError, match=r"box has no reference: .*reference\.exr"):
        provide(subject, 128, VERSION, show)


def test_without_cycles_there_is_a_sentence_until_the_parts_are_in_the_cache(cycles, subject):
    missing = blender.NoEngineError("This Blender (5.2.3 LTS) has no engine CYCLES.")
    cycles.broken, cycles.error = (1, "0"), missing
    with pytest.raises(ToolError, match=r"box has no reference: This Blender \(5.2.3 LTS\) has no engine CYCLES."):
        provide(subject, 128, VERSION, show)
    cycles.broken = None
    provide(subject, 128, VERSION, show)
    cycles.broken = (1, "0")
    assert provide(subject, 128, VERSION, show).samples == 128


def test_progress_counts_the_parts(cycles, subject):
    said = []
    provide(subject, 128, VERSION, show)
    provide(subject, 256, VERSION, said.append)
    assert said == [f"reference, frame 1, part {part} of 4 · Sample 1/1" for part in (3, 4)]
