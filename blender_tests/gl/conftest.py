# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendering on the GL thread, for tests."""

import pytest

from addon.render import Renderer, gl_thread, stop_gl_thread
from addon.scene import Channel, RenderSettings


class View:
    """What a test reads of one rendered view."""

    def __init__(self, channels, layers, statistics, plan):
        self.channels = channels
        self.layers = layers
        self.statistics = statistics
        self.plan = plan


@pytest.fixture(scope="session", autouse=True)
def _stop_the_thread():
    yield
    stop_gl_thread()


@pytest.fixture(scope="session")
def render():
    """render(scene, camera, **settings) -> View, through a fresh Renderer."""

    def render(scene, camera, *, width=32, height=32, samples=1, filter_radius=0.0, channels=(), **settings):
        settings = RenderSettings(
            width, height, samples=samples, filter_radius=filter_radius, channels=frozenset(channels), **settings
        )

        def job(device):
            renderer = Renderer(device)
            try:
                plan = renderer.begin(scene, camera, settings)
                for _ in range(samples):
                    renderer.render_sample()
                images = {channel: renderer.read(channel) for channel in {*settings.channels, Channel.COMBINED}}
                layers = [renderer.read_layer(k) for k in range(plan.layers)] if settings.deep_output else []
                return View(images, layers, renderer.statistics(), plan)
            finally:
                renderer.release()

        return gl_thread().submit(job).result()

    return render
