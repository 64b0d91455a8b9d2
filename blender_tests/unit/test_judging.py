# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures in files against the reference's: what is read, what is judged, what is written."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from addon.output.exr import write_channels
from addon.report.metrics import display
from addon.report.pictures import combined
from tooling.report.judging import judge, reference_flicker
from tooling.report.pictures import centre, enlarged, write_png, write_sheet
from tooling.report.results import Reference, Subject

SIZE = (48, 32)


def picture(seed=0, size=SIZE):
    return np.random.default_rng(seed).random((size[1], size[0], 3)).astype(np.float32)


def write_exr(path: Path, planes: dict[str, np.ndarray]) -> Path:
    write_channels(path, {name: plane[::-1].astype(np.float32) for name, plane in planes.items()})
    return path


def write_picture(path: Path, pixels: np.ndarray, prefix="") -> Path:
    return write_exr(path, {f"{prefix}{letter}": pixels[..., index] for index, letter in enumerate("RGB")})


def write_layer(path: Path, depth=3.0, motion=(0.0, 0.0)) -> Path:
    flat = np.ones(SIZE[::-1])
    planes = {"layer0.Depth.Z": depth * flat, "layer0.Motion.X": motion[0] * flat, "layer0.Motion.Y": motion[1] * flat}
    return write_exr(path, planes)


def case(folder: Path, *pixels: np.ndarray, crop=None) -> tuple[Reference, Subject]:
    """A reference of these pictures, one per frame, in plain files."""
    paths = tuple(write_picture(folder / f"truth{frame}.exr", each) for frame, each in enumerate(pixels))
    frames = tuple(range(1, len(pixels) + 1))
    return Reference("made up", None, 0.0, 0.0, paths), Subject("Made up", folder / "a.blend", frames, SIZE, crop)


@pytest.mark.parametrize("prefix", ["", "ViewLayer.Combined.", "My layer.Combined."])
def test_colours_are_found_with_and_without_a_view_layer(tmp_path, prefix):
    path = write_picture(tmp_path / "a.exr", picture(), prefix)
    np.testing.assert_array_equal(combined(path), picture())


def test_a_file_without_colours_or_that_is_broken_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"a\.exr has no colour channels; it has Depth\.Z"):
        combined(write_exr(tmp_path / "a.exr", {"Depth.Z": np.ones((2, 2))}))
    broken = tmp_path / "broken.exr"
    broken.write_bytes(b"no picture")
    for path in (broken, tmp_path / "absent.exr"):
        with pytest.raises(OSError, match=path.name):
            combined(path)


def test_a_rectangle_about_the_centre():
    rows, columns = np.indices((6, 10))
    cut = centre(np.stack([rows, columns], axis=-1), (4, 2))
    assert cut[0, 0].tolist() == [2, 3]
    assert cut[-1, -1].tolist() == [3, 6]
    assert centre(rows, None) is rows
    for size in ((11, 2), (4, 7), (0, 1)):
        with pytest.raises(ValueError, match="no rectangle of"):
            centre(rows, size)


def test_a_smaller_picture_is_enlarged_bilinearly():
    """A ramp stays one but at its ends, where there is nothing to interpolate."""
    ramp = np.tile(np.arange(8, dtype=np.float32)[None, :, None], (4, 1, 3))
    large = enlarged(ramp, (16, 8))
    assert large.shape == (8, 16, 3)
    np.testing.assert_allclose(large[3, 1:-1, 0], (np.arange(1, 15) + 0.5) / 2.0 - 0.5, rtol=1e-6)
    assert enlarged(ramp, (8, 4)) is ramp
    with pytest.raises(ValueError, match="8×4, larger than 7×4"):
        enlarged(ramp, (7, 4))


def test_a_picture_that_is_the_reference_has_no_error(tmp_path):
    reference, subject = case(tmp_path, picture())
    found = judge(
        [write_picture(tmp_path / "a.exr", picture(), "V.Combined.")], reference, subject, None, tmp_path, "a"
    )
    assert (found.errors.rmse, found.flip, found.flicker) == (0.0, 0.0, None)
    assert (found.picture, found.heat) == (tmp_path / "a.png", tmp_path / "a_flip.png")
    stored = np.asarray(Image.open(found.picture))
    np.testing.assert_array_equal(stored, np.rint(255.0 * display(picture())).astype(np.uint8))
    heat = np.asarray(Image.open(found.heat))
    assert heat.shape == stored.shape
    assert np.ptp(heat.reshape(-1, 3), axis=0).max() == 0, "no error is one colour"


def test_only_the_crop_is_judged(tmp_path):
    outside = picture()
    outside[:, :8] = 9.0
    path = write_picture(tmp_path / "a.exr", outside)
    whole, cut = (
        judge([path], *case(tmp_path, picture(), crop=crop), None, tmp_path, "a") for crop in (None, (32, 32))
    )
    assert whole.errors.rmse > 1.0
    assert whole.flip > 0.0
    assert (cut.errors.rmse, cut.flip) == (0.0, 0.0)
    assert Image.open(cut.picture).size == (32, 32)


def test_a_smaller_picture_is_judged_at_the_references_size(tmp_path):
    flat = np.full((32, 48, 3), 0.5, np.float32)
    found = judge([write_picture(tmp_path / "a.exr", flat[::2, ::2])], *case(tmp_path, flat), None, tmp_path, "a")
    assert found.errors.rmse == 0.0
    assert Image.open(found.picture).size == SIZE


def test_a_sequence_has_means_and_flicker(tmp_path):
    """The second frame is brighter by 0.1 and has a pixel that is not finite: it counts as black."""
    flat = np.full((32, 48, 3), 0.5, np.float32)
    second = flat + np.float32(0.1)
    second[0, 0, 0] = np.nan
    paths = [write_picture(tmp_path / f"{frame}.exr", pixels) for frame, pixels in enumerate((flat, second))]
    layers = [write_layer(tmp_path / f"layer{frame}.exr") for frame in range(2)]
    found = judge(paths, *case(tmp_path, flat, flat), layers, tmp_path / "new", "a")
    count = flat.size
    assert found.errors.bias[0] == pytest.approx(((count // 3 - 1) * 0.1 - 0.5) / (count // 3) / 2.0, rel=1e-5)
    assert found.errors.invalid == 1
    step = display(second)[1, 1, 0] - display(flat)[1, 1, 0]
    dark = display(flat)[0, 0, 0]
    expected = np.sqrt(((count - 3) * step**2 + 3 * dark**2) / count)
    assert found.flicker == pytest.approx(expected, rel=1e-5)
    assert judge(paths, *case(tmp_path, flat, flat), None, tmp_path, "a").flicker is None


def test_the_reference_flickers_too(tmp_path):
    flat = np.full((32, 48, 3), 0.5, np.float32)
    layers = [write_layer(tmp_path / f"layer{frame}.exr") for frame in range(2)]
    found = reference_flicker(*case(tmp_path, flat, flat * 0.5, crop=(16, 16)), layers)
    assert found == pytest.approx(float(display(flat)[0, 0, 0] - display(flat * 0.5)[0, 0, 0]), rel=1e-5)
    assert not list(tmp_path.glob("*.png"))


def test_nothing_seen_is_not_followed(tmp_path):
    """Layer files hold depth 1e10 where there is nothing."""
    flat = np.full((32, 48, 3), 0.5, np.float32)
    layers = [write_layer(tmp_path / f"layer{frame}.exr", depth=1e10) for frame in range(2)]
    assert reference_flicker(*case(tmp_path, flat, flat * 0.5), layers) is None


def test_a_layer_file_without_motion_is_named(tmp_path):
    flat = picture()
    still = write_exr(tmp_path / "still.exr", {"layer0.Depth.Z": np.ones((32, 48))})
    with pytest.raises(ValueError, match=r"still\.exr has no channel 'layer0\.Motion\.X'"):
        reference_flicker(*case(tmp_path, flat, flat), [still, still])


def test_equal_pictures_and_only_they_have_equal_digests(tmp_path):
    changed = picture()
    changed[31, 0, 2] = np.nextafter(changed[31, 0, 2], np.float32(2.0))
    digests = []
    for number, pixels in enumerate((picture(), picture(), changed)):
        path = write_picture(tmp_path / f"{number}.exr", pixels, "V.Combined." if number else "")
        digests.append(judge([path], *case(tmp_path, picture(), crop=(8, 8)), None, tmp_path, "a").digest)
    assert digests[0] == digests[1] != digests[2]


def test_a_missing_frame_is_refused(tmp_path):
    reference, subject = case(tmp_path, picture(), picture())
    with pytest.raises(ValueError, match="ours: 1 pictures and 2 of the reference for 2 frames"):
        judge([reference.pictures[0]], reference, subject, None, tmp_path, "ours")


def test_a_picture_that_cannot_be_written_leaves_no_scrap(tmp_path, monkeypatch):
    def fail(_self, path, **_options):
        Path(path).write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(Image.Image, "save", fail)
    with pytest.raises(OSError, match="disk full"):
        write_png(tmp_path / "a.png", picture())
    assert not list(tmp_path.iterdir())


def test_a_sheet_has_a_line_above_each_picture(tmp_path):
    path = tmp_path / "sheet.jpg"
    write_sheet(path, [[("one", picture(1)), ("two", picture(2))]])
    assert Image.open(path).size == (96, 32 + 22)
