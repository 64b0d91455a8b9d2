# SPDX-License-Identifier: GPL-3.0-or-later
"""Viewports without a window: the drawing code on a stub context inside an off-screen buffer, and the session."""

import threading
from types import SimpleNamespace

import bpy
import gpu
import mathutils
import numpy as np
import pytest

from addon.engine import messages, viewport
from addon.engine.regions import Rectangle, viewport_rectangle
from addon.engine.viewport_session import ViewportSession
from addon.render import DeviceError, Renderer, gl_thread, stop_gl_thread
from addon.scene import Camera, DebugView, RenderSettings
from blender_tests import builders
from blender_tests.blender.engine_fixtures import (  # noqa: F401 - fixtures
    BASE_COLOR,
    camera_at,
    idle,
    plane_scene_fixture,
    registered_fixture,
    session_fixture,
)

WIDTH, HEIGHT = 48, 32
SCENE = builders.scene(builders.quad("q"), lights=(builders.light(),))
SETTINGS = RenderSettings(24, 16, samples=4)


def test_a_session_refines_until_the_samples_are_there(session):
    session.show(SCENE, camera_at(0.0), SETTINGS)
    idle(session)
    assert session.error is None
    assert session.picture.samples == 4
    assert session.picture.complete
    assert session.picture.pixels.shape == (16, 24, 4)


def test_showing_the_same_view_again_does_not_start_over(session):
    session.show(SCENE, camera_at(0.0), SETTINGS)
    idle(session)
    picture, revision = session.picture, session.revision
    session.show(SCENE, camera_at(0.0), SETTINGS)
    assert not session.busy
    assert (session.picture, session.revision) == (picture, revision)


@pytest.mark.parametrize(
    "changed",
    [
        (SCENE, camera_at(0.5), SETTINGS),
        (SCENE, camera_at(0.0), RenderSettings(20, 10, samples=4)),
        (SCENE, camera_at(0.0), RenderSettings(24, 16, samples=4, debug_view=DebugView.NORMAL)),
        (builders.scene(builders.quad("q")), camera_at(0.0), SETTINGS),
    ],
)
def test_anything_that_changes_the_picture_starts_over_and_keeps_the_old_one_until_then(session, changed):
    session.show(SCENE, camera_at(0.0), SETTINGS)
    idle(session)
    before = session.picture
    gate = threading.Event()
    gl_thread().submit(lambda _device: gate.wait(60))
    session.show(*changed)
    assert session.picture is before
    gate.set()
    idle(session)
    assert session.picture.view.settings == changed[2]
    assert not np.array_equal(session.picture.pixels, before.pixels)


def test_many_camera_moves_queue_one_job_and_show_the_last(session):
    gate = threading.Event()
    gl_thread().submit(lambda _device: gate.wait(60))
    for step in range(50):
        session.show(SCENE, camera_at(step / 50), SETTINGS)
    assert gl_thread()._jobs.qsize() <= 2
    gate.set()
    idle(session)
    assert session.picture.view.camera.position[0] == 49 / 50


def test_a_closed_session_stops_and_frees_its_renderer(monkeypatch):
    released = []
    original = Renderer.release
    monkeypatch.setattr(Renderer, "release", lambda self: (released.append(self), original(self)))
    session = ViewportSession()
    session.show(SCENE, camera_at(0.0), RenderSettings(24, 16, samples=100_000))
    session.close()
    gl_thread().submit(lambda _device: None).result(timeout=60)
    gl_thread().submit(lambda _device: None).result(timeout=60)
    assert gl_thread()._jobs.empty()
    assert session._renderer is None


def test_a_closed_session_takes_no_more_views():
    session = ViewportSession()
    session.close()
    session.show(SCENE, camera_at(0.0), SETTINGS)
    assert not session.busy


def test_an_error_is_kept_and_the_next_view_tries_again(session, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(Renderer, "begin", lambda *_: (_ for _ in ()).throw(ValueError("broken")))
        session.show(SCENE, camera_at(0.0), SETTINGS)
        idle(session)
        assert "broken" in session.error
        assert session.picture is None
    session.show(SCENE, camera_at(1.0), SETTINGS)
    idle(session)
    assert session.error is None
    assert session.picture.complete


def test_no_opengl_is_an_error_and_does_not_loop(monkeypatch):
    stop_gl_thread()

    def broken():
        raise DeviceError("no OpenGL here")

    monkeypatch.setattr("addon.render.device._create_context", broken)
    session = ViewportSession()
    session.show(SCENE, camera_at(0.0), SETTINGS)
    with pytest.raises(DeviceError):
        gl_thread().submit(lambda _device: None).result(timeout=60)
    stop_gl_thread()
    assert session.error == "no OpenGL here"
    assert not session.busy


def test_rectangles_of_regions(plane_scene):
    region = SimpleNamespace(width=100, height=50)
    space = SimpleNamespace(use_render_border=False)
    view = Camera(np.eye(4), (-1.0, 1.0, -0.5, 0.5), 0.1, 10.0)
    assert viewport_rectangle(plane_scene, space, region, view, None) == Rectangle(0, 0, 100, 50)
    frame = Camera(np.eye(4), (-0.5, 0.5, -0.25, 0.25), 0.1, 10.0)
    assert viewport_rectangle(plane_scene, space, region, view, frame) == Rectangle(0, 0, 100, 50)
    plane_scene.render.use_border = True
    plane_scene.render.border_min_x, plane_scene.render.border_max_x = 0.0, 0.5
    plane_scene.render.border_min_y, plane_scene.render.border_max_y = 0.0, 1.0
    assert viewport_rectangle(plane_scene, space, region, view, frame) == Rectangle(25, 12, 25, 26)
    outside = Camera(np.eye(4), (3.0, 4.0, -0.25, 0.25), 0.1, 10.0)
    assert viewport_rectangle(plane_scene, space, region, view, outside).empty


class Probe(bpy.types.RenderEngine):
    """Lends a test Blender's GPU module in background mode."""

    bl_idname = "DEEP_GBUFFER_PROBE"
    bl_label = "Probe"
    bl_use_gpu_context = True
    work = None
    failure = None

    def render(self, depsgraph):
        try:
            Probe.work(depsgraph)
        except BaseException as error:
            Probe.failure = error


@pytest.fixture(name="with_gpu")
def with_gpu_fixture(plane_scene):
    """with_gpu(function): call function(depsgraph) where Blender's GPU module works."""

    def run(function):
        Probe.work, Probe.failure = staticmethod(function), None
        plane_scene.render.engine = Probe.bl_idname
        bpy.ops.render.render()
        if Probe.failure is not None:
            raise Probe.failure

    bpy.utils.register_class(Probe)
    yield run
    bpy.utils.unregister_class(Probe)
    viewport.release()


class StubEngine:
    """What the drawing code asks of an engine."""

    def __init__(self):
        self.stats = []

    def get_preview_pixel_size(self, _scene):
        return 1

    def update_stats(self, *texts):
        self.stats.append(texts)


def unshown_viewports():
    """The viewports of all workspaces; in background mode none is shown."""
    return [area for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D"]


def stub_context():
    """A viewport that looks down as the scene's camera does."""
    region = SimpleNamespace(width=WIDTH, height=HEIGHT, as_pointer=lambda: 1)
    window = mathutils.Matrix(((2.0, 0, 0, 0), (0, 3.0, 0, 0), (0, 0, -1.001, -0.2), (0, 0, -1, 0)))
    region_3d = SimpleNamespace(
        view_matrix=mathutils.Matrix.Translation((0, 0, -5)), window_matrix=window, view_perspective="PERSP"
    )
    space = unshown_viewports()[0].spaces.active
    space.clip_start, space.clip_end = 0.1, 100.0
    return SimpleNamespace(region=region, region_data=region_3d, space_data=space)


def draw(engine, context, depsgraph, size=(WIDTH, HEIGHT)):
    """What `viewport.draw` paints, (H, W, 4) float32, row 0 at the bottom."""
    offscreen = gpu.types.GPUOffScreen(*size, format="RGBA32F")
    with offscreen.bind():
        frame = gpu.state.active_framebuffer_get()
        frame.clear(color=(0, 0, 0, 0))
        with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            gpu.matrix.load_matrix(mathutils.Matrix.Identity(4))
            x, y = 2 / size[0], 2 / size[1]
            gpu.matrix.load_projection_matrix(
                mathutils.Matrix(((x, 0, 0, -1), (0, y, 0, -1), (0, 0, 1, 0), (0, 0, 0, 1)))
            )
            viewport.draw(engine, context, depsgraph)
        pixels = frame.read_color(0, 0, *size, 4, 0, "FLOAT")
    offscreen.free()
    return np.array(pixels.to_list(), np.float32).reshape(size[1], size[0], 4)


def test_a_viewport_paints_the_finished_picture(with_gpu):
    def work(depsgraph):
        engine, context = StubEngine(), stub_context()
        viewport.update(context, depsgraph)
        draw(engine, context, depsgraph)
        idle(viewport._viewports[1].session)
        painted = draw(engine, context, depsgraph)
        picture = viewport._viewports[1].session.picture
        np.testing.assert_allclose(painted, picture.pixels, atol=1e-5)
        np.testing.assert_allclose(painted[HEIGHT // 2, 5, :3], BASE_COLOR, rtol=2e-2)
        np.testing.assert_array_equal(painted[HEIGHT // 2, WIDTH - 5], (0, 0, 0, 1))
        assert engine.stats[-1] == ("", "Sample 16/16")

    with_gpu(work)


def test_a_resized_region_is_filled_with_the_old_picture_at_once(with_gpu):
    def work(depsgraph):
        engine, context = StubEngine(), stub_context()
        draw(engine, context, depsgraph)
        idle(viewport._viewports[1].session)
        gate = threading.Event()
        gl_thread().submit(lambda _device: gate.wait(60))
        context.region.width, context.region.height = 2 * WIDTH, 2 * HEIGHT
        painted = draw(engine, context, depsgraph, (2 * WIDTH, 2 * HEIGHT))
        gate.set()
        np.testing.assert_allclose(painted[HEIGHT, 5, :3], BASE_COLOR, rtol=2e-2)
        assert (painted[..., 3] == 1.0).all()

    with_gpu(work)


def test_a_fault_while_reading_the_scene_is_painted_until_it_can_be_read(with_gpu, monkeypatch):
    def work(depsgraph):
        engine, context = StubEngine(), stub_context()
        context.region.width, context.region.height = 400, 100
        with monkeypatch.context() as patch:
            patch.setattr("addon.sync.Mirror.sync", lambda *_: (_ for _ in ()).throw(ValueError("broken")))
            viewport.update(context, depsgraph)
            assert draw(engine, context, depsgraph, (400, 100))[..., 0].max() > 0.5
        viewport.update(context, depsgraph)
        draw(engine, context, depsgraph, (400, 100))
        idle(viewport._viewports[1].session)
        draw(engine, context, depsgraph, (400, 100))
        assert engine.stats == [("", "Sample 16/16")]

    with_gpu(work)


def test_each_viewport_shows_what_its_own_space_lets_through(plane_scene):
    first, second = (area.spaces.active for area in unshown_viewports()[:2])
    second.show_object_viewport_mesh = False
    depsgraph = bpy.context.evaluated_depsgraph_get()
    whole, filtered = viewport.Viewport(), viewport.Viewport()
    for each, space in ((whole, first), (filtered, second), (whole, first)):
        each.sync(depsgraph, space)
    assert (len(whole._scene.batches), len(filtered._scene.batches)) == (1, 0)
    assert whole._scene.meshes.keys() == filtered._scene.meshes.keys()
    assert all(filtered._scene.meshes[key] is mesh for key, mesh in whole._scene.meshes.items())
    second.show_object_viewport_mesh = True
    filtered.sync(depsgraph, second)
    assert filtered._scene is whole._scene


def test_the_status_names_the_first_warning():
    assert messages.status("Sample 1/2", ()) == "Sample 1/2"
    assert messages.status("Sample 1/2", ("No.",)) == "Sample 1/2 | No."
    assert messages.status("Sample 1/2", ("No.", "Nor.", "Nope.")) == "Sample 1/2 | No. (and 2 more warnings)"


def test_an_error_is_painted_as_text(with_gpu, monkeypatch):
    monkeypatch.setattr(Renderer, "begin", lambda *_: (_ for _ in ()).throw(ValueError("broken")))

    def work(depsgraph):
        engine, context = StubEngine(), stub_context()
        context.region.width, context.region.height = 400, 100
        draw(engine, context, depsgraph, (400, 100))
        idle(viewport._viewports[1].session)
        painted = draw(engine, context, depsgraph, (400, 100))
        assert painted[..., 0].max() > 0.5

    with_gpu(work)


def test_stopping_the_gl_thread_while_a_view_refines_ends_and_the_view_can_be_shown_again(session):
    """A future that is done already calls back at once, inside the lock: this would hang with a plain one."""
    endless = RenderSettings(24, 16, samples=1_000_000)
    session.show(SCENE, camera_at(0.0), endless)
    while session.picture is None:
        gl_thread().submit(lambda _device: None).result(timeout=60)
    stopper = threading.Thread(target=stop_gl_thread, daemon=True)
    stopper.start()
    stopper.join(60)
    assert not stopper.is_alive()
    assert not session.busy
    before = session.revision
    session.show(SCENE, camera_at(0.0), endless)
    while session.revision == before:
        gl_thread().submit(lambda _device: None).result(timeout=60)
    assert session.error is None
