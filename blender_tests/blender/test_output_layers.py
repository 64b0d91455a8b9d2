# SPDX-License-Identifier: GPL-3.0-or-later
"""Layer files: what is written is what is read back, and what cannot be written is said."""

import json
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from addon import output
from addon.engine.layer_output import file_name
from addon.render import LayerImages
from blender_tests.blender.engine_fixtures import (  # noqa: F401 - fixtures
    add_plane,
    moving_scene_fixture,
    plane_scene_fixture,
    registered_fixture,
    render,
)

FINITE = st.floats(-1e6, 1e6, width=32)
DEPTHS = st.one_of(st.just(np.inf), st.floats(0.125, 1e6, width=32))
PLAIN_CHANNELS, MOTION_CHANNELS, EXIT_CHANNELS = 16, 3, 7


@st.composite
def layer_stacks(draw):
    """1–3 layers of one small size, with empty pixels; all with motion or none, all with exit surfaces or none."""
    height, width = draw(st.integers(1, 4)), draw(st.integers(1, 5))
    motion, exits = draw(st.booleans()), draw(st.booleans())

    def image(*channels, elements=FINITE):
        return draw(hnp.arrays(np.float32, (height, width, *channels), elements=elements))

    return [
        LayerImages(
            depth=image(elements=DEPTHS),
            radiance=image(3),
            normal=image(3),
            albedo=image(3),
            metallic=image(),
            roughness=image(),
            emission=image(3),
            object_index=image(),
            motion=image(2) if motion else None,
            exit_depth=image(elements=DEPTHS) if exits else None,
            exit_normal=image(3) if exits else None,
            exit_albedo=image(3) if exits else None,
        )
        for _ in range(draw(st.integers(1, 3)))
    ]


def planes(path: Path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: np.array(channel.pixels) for name, channel in file.channels().items()}


def written_depth(depth):
    """View depth as a file holds it: row 0 at the top, 1e10 where there is nothing."""
    return np.where(np.isfinite(depth), depth, np.float32(1e10))[::-1]


@settings(max_examples=25, deadline=None)
@given(layer_stacks())
def test_every_channel_of_every_layer_comes_back(tmp_path_factory, layers):
    path = tmp_path_factory.mktemp("layers") / "new folder" / "x.exr"
    output.write_layers(path, layers)
    read = planes(path)
    moves, exits = layers[0].motion is not None, layers[0].exit_depth is not None
    assert len(read) == (PLAIN_CHANNELS + moves * MOTION_CHANNELS + exits * EXIT_CHANNELS) * len(layers)
    for index, layer in enumerate(layers):
        np.testing.assert_array_equal(read[f"layer{index}.Depth.Z"], written_depth(layer.depth))
        np.testing.assert_array_equal(read[f"layer{index}.Radiance.G"], layer.radiance[::-1, :, 1])
        np.testing.assert_array_equal(read[f"layer{index}.Normal.Z"], layer.normal[::-1, :, 2])
        np.testing.assert_array_equal(read[f"layer{index}.Roughness.V"], layer.roughness[::-1])
        if moves:
            np.testing.assert_array_equal(read[f"layer{index}.Motion.X"], layer.motion[::-1, :, 0])
            np.testing.assert_array_equal(read[f"layer{index}.Motion.Y"], layer.motion[::-1, :, 1])
            assert not read[f"layer{index}.Motion.Z"].any()
        if exits:
            np.testing.assert_array_equal(read[f"layer{index}.ExitDepth.Z"], written_depth(layer.exit_depth))
            np.testing.assert_array_equal(read[f"layer{index}.ExitNormal.Y"], layer.exit_normal[::-1, :, 1])
            np.testing.assert_array_equal(read[f"layer{index}.ExitAlbedo.B"], layer.exit_albedo[::-1, :, 2])
    assert [item.name for item in path.parent.iterdir()] == ["x.exr"]


@settings(max_examples=25, deadline=None)
@given(layer_stacks())
def test_a_deep_pixel_has_one_sample_per_layer_that_is_there(tmp_path_factory, layers):
    path = tmp_path_factory.mktemp("deep") / "x.exr"
    output.write_deep(path, layers)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        assert file.header()["type"] == OpenEXR.deepscanline
        read = {name: channel.pixels for name, channel in file.channels().items()}
    exits = layers[0].exit_depth is not None
    assert set(read) == {*"ZRGBA", *(["ZBack"] if exits else [])}
    height, width = layers[0].depth.shape
    for row in range(height):
        for column in range(width):
            there = [layer for layer in layers if np.isfinite(layer.depth[row, column])]
            expected = {
                "Z": [layer.depth[row, column] for layer in there],
                "R": [layer.radiance[row, column, 0] for layer in there],
                "B": [layer.radiance[row, column, 2] for layer in there],
                "A": [1.0] * len(there),
            }
            if exits:
                backs = [(layer.exit_depth[row, column], layer.depth[row, column]) for layer in there]
                expected["ZBack"] = [back if np.isfinite(back) else front for back, front in backs]
            for name, values in expected.items():
                samples = read[name][height - 1 - row, column]
                np.testing.assert_array_equal([] if samples is None else samples, np.array(values, np.float32))


@pytest.mark.parametrize("write", [output.write_layers, output.write_deep])
def test_a_file_that_cannot_be_written_leaves_the_old_one_and_no_scrap(tmp_path, write, monkeypatch):
    layer = LayerImages(
        **{name: np.ones((2, 2), np.float32) for name in ("depth", "metallic", "roughness", "object_index")},
        **{name: np.ones((2, 2, 3), np.float32) for name in ("radiance", "normal", "albedo", "emission")},
    )
    path = tmp_path / "x.exr"
    path.write_bytes(b"old")

    def fail(_self, _name):
        raise RuntimeError("disk full")

    monkeypatch.setattr(OpenEXR.File, "write", fail)
    with pytest.raises(OSError, match=r"x\.exr: disk full"):
        write(path, [layer])
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("template", "view_layer", "expected"),
    [
        ("//", "", "//shot_0007_layers.exr"),
        ("//deep/", "", "//deep/shot_0007_layers.exr"),
        ("/tmp/a_", "", "/tmp/a_0007_layers.exr"),
        ("/tmp/a_##", "", "/tmp/a_07_layers.exr"),
        ("/tmp/#/a.####.exr", "", "/tmp/#/a.0007_layers.exr"),
        ("/tmp/a", "View/Layer", "/tmp/a0007_View_Layer_layers.exr"),
        ("C:\\out\\a", "", "C:\\out\\a0007_layers.exr"),
    ],
)
def test_file_names_follow_blenders_conventions(template, view_layer, expected):
    assert file_name(template, "shot", 7, view_layer, "layers.exr") == expected


def test_a_render_saves_both_files(plane_scene, tmp_path):
    add_plane("Behind", -20.0, 20.0, -2.0)
    bpy.data.lights["Sun"].use_shadow = False  # what is behind is lit too
    ours = plane_scene.deep_gbuffer
    ours.layers, ours.save_layers, ours.save_deep = 3, True, True
    ours.layers_path = str(tmp_path / "out" / "shot_###")
    render(plane_scene, tmp_path)
    read = planes(tmp_path / "out" / "shot_001_layers.exr")
    row, left, right = 15, 5, 34
    np.testing.assert_allclose(read["layer0.Depth.Z"][row, [left, right]], (5.0, 7.0), rtol=1e-5)
    np.testing.assert_allclose(read["layer1.Depth.Z"][row, [left, right]], (7.0, 1e10), rtol=1e-5)
    assert read["layer0.Albedo.R"][row, left] == pytest.approx(0.6, abs=5e-3)
    assert read["layer1.Radiance.R"][row, left] > 0.1
    with OpenEXR.File(str(tmp_path / "out" / "shot_001_deep.exr"), separate_channels=True) as file:
        depths = file.channels()["Z"].pixels
    np.testing.assert_allclose(depths[row, left], (5.0, 7.0), rtol=1e-5)
    np.testing.assert_allclose(depths[row, right], (7.0,), rtol=1e-5)


@pytest.mark.parametrize("variant", ["TWO_PASS", "REPROJECT", "PREDICT"])
def test_a_scene_snapshot_renders_the_same_picture_without_blender(moving_scene, tmp_path, variant):
    """The job that build.py runs for a .npz, in a process that cannot import bpy; same bits as Blender's result."""
    ours = moving_scene.deep_gbuffer
    ours.save_layers, ours.save_snapshot, ours.layers_path = False, True, f"{tmp_path}/shot_"
    ours.variant, ours.debug_view, ours.debug_layer = variant, "DIRECT", 2
    moving_scene.frame_set(4)
    expected = render(moving_scene, tmp_path)["ViewLayer.Combined"]
    assert expected[..., 0].max() > 0.1
    job = {
        "file": str(tmp_path / "shot_0004_snapshot.npz"),
        "resolution": [moving_scene.render.resolution_x, moving_scene.render.resolution_y],
        "samples": ours.samples,
        "set": [
            ["variant", variant],
            ["debug_view", "DIRECT"],
            ["debug_layer", "1"],
            ["filter_radius", str(moving_scene.render.filter_size)],
        ],
        "time_limit": None,
        "repeat": 1,
        "scratch": str(tmp_path),
    }
    code = "import runpy, sys; sys.modules['bpy'] = None; runpy.run_path(sys.argv[1], run_name='__main__')"
    script = str(Path(__file__).parents[2] / "tooling" / "snapshot_job.py")
    done = subprocess.run(
        [sys.executable, "-c", code, script, "--", json.dumps(job)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    picture = planes(tmp_path / "picture.exr")
    np.testing.assert_array_equal(np.stack([picture[letter] for letter in "RGBA"], axis=-1), expected)


def test_a_folder_that_cannot_be_made_is_a_warning_that_names_it(plane_scene, tmp_path, capfd):
    (tmp_path / "file").write_text("in the way")
    plane_scene.deep_gbuffer.save_layers = True
    plane_scene.deep_gbuffer.layers_path = str(tmp_path / "file" / "shot_")
    assert bpy.ops.render.render() == {"FINISHED"}
    printed = capfd.readouterr().out
    assert "The layers were not written" in printed
    assert str(tmp_path / "file") in printed


def test_a_path_beside_a_blend_that_was_never_saved_is_a_warning(plane_scene, capfd):
    plane_scene.deep_gbuffer.save_deep = True
    assert bpy.ops.render.render() == {"FINISHED"}
    assert "not saved yet" in capfd.readouterr().out


def test_several_view_layers_get_a_file_each(plane_scene, tmp_path):
    plane_scene.view_layers.new("Second")
    plane_scene.deep_gbuffer.save_layers = True
    plane_scene.deep_gbuffer.layers_path = f"{tmp_path}/out/a"
    render(plane_scene, tmp_path)
    assert sorted(item.name for item in (tmp_path / "out").iterdir()) == [
        "a0001_Second_layers.exr",
        "a0001_ViewLayer_layers.exr",
    ]
