# SPDX-License-Identifier: GPL-3.0-or-later
"""The depth_tiles pass alone, on view depths that the tests write."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.render import PlannedPass, gl_thread
from addon.render.layout import CHANNELS, DEPTH_TILES_TARGET, TILE_SIZE, depth_tiles_target
from addon.render.passes.depth_tiles import DepthTilesPass
from addon.render.readback import read_target
from addon.render.targets import TexturePool
from addon.scene import LightKind
from blender_tests import builders

VIEW_DEPTH = next(channel for channel in CHANNELS if channel.name == "view_depth")


def reduce_on_gpu(depth, guard_band=0, *, extra_layers=0):
    """What the pass writes, (layers, tiles up, tiles across, 2), of view depths (layers, H, W), guard band included."""
    layers, height, width = depth.shape

    def job(device):
        pool, render_pass = TexturePool(device), DepthTilesPass(device)
        targets = (VIEW_DEPTH.target(layers + extra_layers), depth_tiles_target(layers))
        planned = PlannedPass("depth_tiles", (targets[0].name,), targets[1:])
        frame = SimpleNamespace(pool=pool, camera=builders.camera(), plan=SimpleNamespace(layers=layers))
        try:
            pool.prepare((width - 2 * guard_band, height - 2 * guard_band), targets, guard_band=guard_band)
            unread = np.zeros((extra_layers, height, width), np.float32)
            pool.texture(targets[0].name).write(np.concatenate([depth, unread]).tobytes(), alignment=1)
            render_pass.prepare(frame, planned)
            render_pass.run(frame, planned)
            values = read_target(pool, DEPTH_TILES_TARGET)
            assert device.context.error == "GL_NO_ERROR"
            return values
        finally:
            render_pass.release()
            pool.release()

    return gl_thread().submit(job).result()


def reduce_in_numpy(depth):
    """The same by slices."""
    layers, height, width = depth.shape
    corners = [(y, x) for y in range(0, height, TILE_SIZE) for x in range(0, width, TILE_SIZE)]
    tiles = [depth[:, y : y + TILE_SIZE, x : x + TILE_SIZE].reshape(layers, -1) for y, x in corners]
    nearest = np.stack([tile.min(axis=1) for tile in tiles], axis=1)
    farthest = np.stack([np.where(np.isinf(tile), -np.inf, tile).max(axis=1) for tile in tiles], axis=1)
    shape = (layers, -(-height // TILE_SIZE), -(-width // TILE_SIZE), 2)
    return np.stack([nearest, farthest], axis=-1).reshape(shape).astype(np.float32)


def random_depth(generator, shape, covered):
    """Depths over 12 orders of magnitude; `covered` is the share of pixels that show anything."""
    depth = 10.0 ** generator.uniform(-4.0, 8.0, shape)
    return np.where(generator.random(shape) < covered, depth, np.inf).astype(np.float32)


@settings(max_examples=25, deadline=None)
@given(
    st.integers(1, 3),
    st.integers(1, 3 * TILE_SIZE + 1),
    st.integers(1, 3 * TILE_SIZE + 1),
    st.sampled_from([0.0, 0.004, 0.5, 1.0]),
    st.integers(0, 2**32 - 1),
)
def test_ranges_are_those_of_the_pixels(layers, height, width, covered, seed):
    depth = random_depth(np.random.default_rng(seed), (layers, height, width), covered)
    assert np.array_equal(reduce_on_gpu(depth), reduce_in_numpy(depth))


def test_tiles_begin_in_the_corner_of_the_guard_band():
    depth = random_depth(np.random.default_rng(3), (1, 40, 57), 0.9)
    assert np.array_equal(reduce_on_gpu(depth, guard_band=5), reduce_in_numpy(depth))


def test_layers_that_only_the_next_picture_reads_are_not_reduced():
    depth = random_depth(np.random.default_rng(4), (2, 20, 20), 0.5)
    assert np.array_equal(reduce_on_gpu(depth, extra_layers=1), reduce_in_numpy(depth))


def test_an_empty_tile_has_an_empty_range():
    depth = np.full((1, TILE_SIZE, 2 * TILE_SIZE), np.inf, np.float32)
    depth[0, 7, TILE_SIZE + 3] = 2.5
    assert reduce_on_gpu(depth).tolist() == [[[[np.inf, -np.inf], [2.5, 2.5]]]]


@pytest.mark.parametrize("kind", [LightKind.POINT, LightKind.SUN])
def test_a_picture_with_a_light_makes_tiles_of_every_layer(render, kind):
    scene = builders.scene(builders.quad("q"), lights=(builders.light(kind),))
    view = render(scene, builders.camera(), width=40, height=20, layers=2, deep_output=True)
    assert "depth_tiles" in [name for name, _ in view.statistics.passes]
    assert view.statistics.bytes[DEPTH_TILES_TARGET] == 8 * 3 * 2 * 2
