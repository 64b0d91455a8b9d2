# SPDX-License-Identifier: GPL-3.0-or-later
"""The composite pass alone, on G-buffers that the tests write."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.render import PlannedPass, gl_thread
from addon.render.film import Film
from addon.render.layout import CHANNELS, EXIT_CHANNELS
from addon.render.passes import CompositePass
from addon.render.plan import film_target
from addon.render.targets import TexturePool
from addon.scene import Channel, DebugView, RenderSettings
from blender_tests import builders

WIDTH, HEIGHT = 6, 4
TARGETS = {channel.target(1).name: channel.target(1) for channel in CHANNELS + EXIT_CHANNELS}


@pytest.fixture
def compose():
    """compose(view, targets, guard_band): the picture (H, W, 4) of a debug view of one layer of these texels.

    `targets` maps names to (H, W, components) arrays in the texture's own type, guard band included.
    """

    def compose(view, targets, *, guard_band=0):
        def job(device):
            pool, film = TexturePool(device), Film(device)
            composite = CompositePass(device)
            specs = tuple(TARGETS[name] for name in targets)
            planned = PlannedPass(
                "composite", tuple(targets), (film_target(Channel.COMBINED),), frozenset({f"DEBUG_{view.value}"})
            )
            try:
                pool.prepare((WIDTH, HEIGHT), (*specs, *planned.writes), guard_band=guard_band)
                for name, values in targets.items():
                    pool.texture(name).write(np.ascontiguousarray(values).tobytes(), alignment=1)
                frame = SimpleNamespace(
                    device=device,
                    pool=pool,
                    film=film,
                    scene=builders.scene(builders.quad("q"), world=(9.0, 9.0, 9.0)),
                    settings=RenderSettings(WIDTH, HEIGHT, debug_view=view),
                    plan=SimpleNamespace(layers=1),
                    sample=SimpleNamespace(index=0),
                    camera=builders.camera(),
                )
                composite.run(frame, planned)
                film.samples = 1
                return film.mean(pool, Channel.COMBINED)
            finally:
                composite.release()
                pool.release()

        return gl_thread().submit(job).result()

    return compose


def everywhere(value, dtype, guard_band=0):
    """A target of one value."""
    return np.full((HEIGHT + 2 * guard_band, WIDTH + 2 * guard_band, len(value)), value, dtype)


def test_the_picture_is_what_the_guard_band_surrounds(compose):
    """Depths that all differ: the picture shows those of its own pixels, and the guard band's nowhere."""
    guard_band = 3
    shape = (HEIGHT + 2 * guard_band, WIDTH + 2 * guard_band, 1)
    depth = (1.0 + np.arange(np.prod(shape)).reshape(shape)).astype(np.float32)
    shown = compose(DebugView.DEPTH, {"gbuffer.view_depth": depth}, guard_band=guard_band)
    inside = depth[guard_band:-guard_band, guard_band:-guard_band, 0]
    assert shown.shape == (HEIGHT, WIDTH, 4)
    np.testing.assert_allclose(shown[..., 0], inside / (1 + inside), rtol=1e-6)


def test_motion_is_grey_at_rest_red_to_the_right_and_green_up(compose):
    motion = everywhere((0.0, 0.0), np.float16)
    motion[0, 1] = (8.0, 0.0)
    motion[0, 2] = (0.0, -8.0)
    motion[0, 3] = (3000.0, 4000.0)
    targets = {"gbuffer.view_depth": everywhere((2.0,), np.float32), "gbuffer.motion": motion}
    shown = compose(DebugView.MOTION, targets)[..., :3]
    np.testing.assert_array_equal(shown[1:], 0.5)
    np.testing.assert_allclose(shown[0, 1], (0.75, 0.5, 0.5))
    np.testing.assert_allclose(shown[0, 2], (0.5, 0.25, 0.5))
    # Half as saturated at 8 pixels, and with the direction kept at any speed: 5000/5008 of (0.6, 0.8).
    np.testing.assert_allclose(shown[0, 3], (0.5 + 0.3 * 5000 / 5008, 0.5 + 0.4 * 5000 / 5008, 0.5), rtol=1e-6)


@pytest.mark.parametrize("view", [DebugView.EXIT_DEPTH, DebugView.EXIT_NORMAL, DebugView.EXIT_ALBEDO])
def test_exit_surfaces_are_shown_where_there_are_any(compose, view):
    """A white pixel of depth stands for a solid without an end; it has neither normal nor albedo."""
    exit_depth = everywhere((4.0,), np.float32)
    exit_depth[0, 0] = np.inf
    targets = {
        "gbuffer.view_depth": everywhere((2.0,), np.float32),
        "exit.view_depth": exit_depth,
        "exit.normal": everywhere((255, 128), np.uint8),  # +x, to 8 bits
        "exit.base_color": everywhere((51, 102, 204, 255), np.uint8),
    }
    with_exit, without = {
        DebugView.EXIT_DEPTH: ((0.8, 0.8, 0.8), 1.0),
        DebugView.EXIT_NORMAL: ((1.0, 0.5, 0.5), 0.0),
        DebugView.EXIT_ALBEDO: ((0.2, 0.4, 0.8), 0.0),
    }[view]
    shown = compose(view, targets)
    np.testing.assert_allclose(shown[1:, :, :3].reshape(-1, 3), [with_exit] * (HEIGHT - 1) * WIDTH, atol=1 / 255)
    np.testing.assert_array_equal(shown[0, 0, :3], without)
    np.testing.assert_array_equal(shown[..., 3], 1.0)


def test_nothing_is_shown_where_the_layer_is_empty(compose):
    depth = everywhere((np.inf,), np.float32)
    shown = compose(
        DebugView.MOTION, {"gbuffer.view_depth": depth, "gbuffer.motion": everywhere((5.0, 5.0), np.float16)}
    )
    assert not shown.any()
