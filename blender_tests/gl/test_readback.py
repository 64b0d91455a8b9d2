# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers as images, of targets that the tests write."""

import numpy as np
import pytest

from addon.render import gl_thread
from addon.render.layout import CHANNELS, EXIT_CHANNELS
from addon.render.readback import positions, read_layers, read_target
from addon.render.targets import TexturePool
from blender_tests import builders

WIDTH, HEIGHT, LAYERS, GUARD_BAND = 5, 3, 3, 2
SPECS = {channel.target(LAYERS).name: channel.target(LAYERS) for channel in CHANNELS + EXIT_CHANNELS}
KINDS = {"f4": np.float32, "f2": np.float16, "f1": np.uint8, "nu2": np.uint16, "u2": np.uint16}


def random_texels(generator, spec):
    """(layers, H, W, components) of a target with its guard band: values that differ everywhere."""
    shape = (LAYERS, HEIGHT + 2 * GUARD_BAND, WIDTH + 2 * GUARD_BAND, spec.components)
    kind = KINDS[spec.dtype]
    if np.issubdtype(kind, np.integer):
        return generator.integers(1, np.iinfo(kind).max, shape).astype(kind)
    return generator.uniform(1.0, 7.0, shape).astype(kind)


@pytest.fixture(scope="module")
def written():
    """What every target holds; of each depth one texel in the picture's corner is empty."""
    generator = np.random.default_rng(11)
    texels = {name: random_texels(generator, spec) for name, spec in SPECS.items()}
    for name in ("gbuffer.view_depth", "exit.view_depth"):
        texels[name][:, GUARD_BAND, GUARD_BAND] = np.inf
    texels["gbuffer.emission"][..., 3] = generator.integers(-20, 20, texels["gbuffer.emission"].shape[:3])
    return texels


def with_targets(written, job):
    """job(pool) with a pool whose targets hold these texels."""

    def run(device):
        pool = TexturePool(device)
        try:
            pool.prepare((WIDTH, HEIGHT), tuple(SPECS[name] for name in written), guard_band=GUARD_BAND)
            for name, values in written.items():
                pool.texture(name).write(values.tobytes(), alignment=1)
            return job(pool)
        finally:
            pool.release()

    return gl_thread().submit(run).result()


def picture(texels, layer=slice(None)):
    """The part without the guard band."""
    return texels[layer, GUARD_BAND:-GUARD_BAND, GUARD_BAND:-GUARD_BAND]


def test_a_target_is_read_without_its_guard_band(written):
    read = with_targets(written, lambda pool: {name: read_target(pool, name) for name in SPECS})
    for name, spec in SPECS.items():
        scale = np.iinfo(KINDS[spec.dtype]).max if spec.dtype in ("f1", "nu2") else 1
        np.testing.assert_array_equal(read[name], picture(written[name]).astype(np.float32) / np.float32(scale))


def test_layers_have_motion_and_exit_surfaces_and_no_more_than_asked_for(written):
    layers = with_targets(written, lambda pool: read_layers(pool, frozenset(SPECS), LAYERS - 1))
    assert len(layers) == LAYERS - 1
    for index, layer in enumerate(layers):
        covered = np.isfinite(layer.depth)
        assert not covered[0, 0]
        assert covered.sum() == WIDTH * HEIGHT - 1
        np.testing.assert_array_equal(layer.depth, picture(written["gbuffer.view_depth"], index)[..., 0])
        np.testing.assert_array_equal(layer.exit_depth, picture(written["exit.view_depth"], index)[..., 0])
        emission = picture(written["gbuffer.emission"], index).astype(np.float32)
        expected = {
            "motion": picture(written["gbuffer.motion"], index).astype(np.float32),
            "exit_albedo": picture(written["exit.base_color"], index)[..., :3] / np.float32(255),
            "emission": emission[..., :3] * np.exp2(emission[..., 3:]),
        }
        for name, values in expected.items():
            np.testing.assert_array_equal(getattr(layer, name), values * covered[..., None])
        for normal in (layer.normal, layer.exit_normal):
            np.testing.assert_allclose(np.linalg.norm(normal, axis=-1), covered, atol=1e-6)


def test_what_is_not_there_is_none(written):
    depths = {"gbuffer.view_depth": written["gbuffer.view_depth"]}
    (layer,) = with_targets(depths, lambda pool: read_layers(pool, frozenset(depths), 1))
    assert layer.motion is layer.exit_depth is layer.exit_normal is layer.exit_albedo is None
    assert not layer.emission.any()


@pytest.mark.parametrize("orthographic", [False, True])
def test_positions_are_where_the_depth_is_seen(orthographic):
    """A camera at z = 3 m whose window is 2 m wide (perspective: at depth 1), and 4 by 2 pixels."""
    depth = np.float32([[1.0, 2.0, 4.0, np.inf], [8.0, 1.0, 0.5, 3.0]])
    seen = positions(depth, builders.camera(orthographic=orthographic))
    x, y = np.meshgrid([-0.75, -0.25, 0.25, 0.75], [-0.5, 0.5])
    scale = 1.0 if orthographic else depth
    expected = np.stack([x * scale, y * scale, 3.0 - depth], axis=-1)
    expected[0, 3] = 0.0
    np.testing.assert_allclose(seen, expected, rtol=1e-6)
