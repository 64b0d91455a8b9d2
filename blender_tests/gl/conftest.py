# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendering on the GL thread, for tests."""

import pytest

from addon.render import Renderer, gl_thread, stop_gl_thread
from addon.scene import Channel, Layering, RenderSettings, Sequence


class View:
    """What a test reads of one rendered view."""

    def __init__(self, channels, layers, statistics, plan):
        self.channels = channels
        self.layers = layers
        self.statistics = statistics
        self.plan = plan


class Session:
    """A renderer that lives from picture to picture, as a viewport's does."""

    def __init__(self):
        self._renderer = gl_thread().submit(Renderer).result()

    def show(
        self,
        scene,
        camera,
        sequence=None,
        *,
        width=32,
        height=32,
        samples=1,
        filter_radius=0.0,
        channels=(),
        layering=Layering.GEOMETRY_SHADER,
        **settings,
    ):
        """Render one view to its last sample; layered in the way that every driver has, not in the faster one."""
        settings = RenderSettings(
            width,
            height,
            samples=samples,
            filter_radius=filter_radius,
            channels=frozenset(channels),
            layering=layering,
            **settings,
        )

        def job(_device):
            renderer = self._renderer
            plan = renderer.begin(scene, camera, settings, sequence)
            for _ in range(samples):
                renderer.render_sample()
            images = {channel: renderer.read(channel) for channel in {*settings.channels, Channel.COMBINED}}
            layers = [renderer.read_layer(k) for k in range(plan.layers)] if settings.deep_output else []
            return View(images, layers, renderer.statistics(), plan)

        return gl_thread().submit(job).result()

    def play(self, moments, **settings):
        """The views of successive moments, each of which knows its neighbours; the first knows of nothing before."""
        moments = list(moments)
        around = [None, None, *moments, None]
        return [
            self.show(
                moment.scene,
                moment.camera,
                Sequence(previous=around[at + 1], earlier=around[at], following=around[at + 3], continuous=True),
                **settings,
            )
            for at, moment in enumerate(moments)
        ]

    def release(self):
        """Free the renderer."""
        gl_thread().submit(lambda _device: self._renderer.release()).result()


@pytest.fixture(scope="session", autouse=True)
def _stop_the_thread():
    yield
    stop_gl_thread()


@pytest.fixture(scope="session")
def subpixel_bits():
    """Bits of the grid that the driver snaps vertices to on the screen."""
    return gl_thread().submit(lambda device: device.context.info["GL_SUBPIXEL_BITS"]).result()


@pytest.fixture(scope="session")
def layerings():
    """The ways to reach several layers that the driver has."""
    extension = gl_thread().submit(lambda device: device.vertex_layer_extension).result()
    return [way for way in Layering if way is not Layering.FASTEST and (way is Layering.GEOMETRY_SHADER or extension)]


@pytest.fixture
def session():
    """A session of its own for the test."""
    session = Session()
    yield session
    session.release()


@pytest.fixture(scope="module")
def shared_session():
    """One session for all cases of a module, so that what an earlier one left behind would be noticed."""
    session = Session()
    yield session
    session.release()


@pytest.fixture(scope="session")
def render():
    """render(scene, camera, sequence=None, **settings) -> View, through a fresh Renderer."""

    def render(scene, camera, sequence=None, **settings):
        session = Session()
        try:
            return session.show(scene, camera, sequence, **settings)
        finally:
            session.release()

    return render
