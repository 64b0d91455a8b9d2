# SPDX-License-Identifier: GPL-3.0-or-later
import ctypes
import threading
from concurrent.futures import CancelledError
from dataclasses import replace

import moderngl
import numpy as np
import pytest

from addon.render import DeviceError, GLThread, Renderer, RenderError, ShaderError, device, gl_thread, programs
from addon.scene import Channel, RenderSettings
from blender_tests import builders

SCENE = builders.scene(builders.quad("q"), lights=(builders.light(),))


def begin(settings):
    def job(device):
        renderer = Renderer(device)
        try:
            renderer.begin(SCENE, builders.camera(), settings)
        finally:
            renderer.release()

    gl_thread().submit(job).result()


def test_resolution_over_the_limit_is_refused_with_the_limit():
    limit = gl_thread().submit(lambda device: device.maximum_size).result()
    with pytest.raises(RenderError, match=f"{limit + 1}×16 is outside .* \\(1 to {limit} pixels"):
        begin(RenderSettings(limit + 1, 16))
    with pytest.raises(RenderError, match="0×16"):
        begin(RenderSettings(0, 16))


def test_targets_that_do_not_fit_are_named():
    """The driver's own answer to a texture it cannot hold, with eight layers of its widest picture."""
    limit = gl_thread().submit(lambda device: device.maximum_size).result()
    with pytest.raises(RenderError, match=r"Out of graphics memory for target gbuffer\.\w+: \d+ MiB .* Lower"):
        begin(RenderSettings(limit, limit // 4, layers=8, deep_output=True))
    begin(RenderSettings(16, 16))  # and the thread goes on


def test_a_broken_shader_names_our_file_and_line(monkeypatch, tmp_path):
    root = programs.shader_root()
    for path in root.rglob("*"):
        if path.is_file():
            copy = tmp_path / path.relative_to(root)
            copy.parent.mkdir(exist_ok=True)
            copy.write_text(path.read_text())
    broken = tmp_path / "common" / "octahedral.glsl"
    broken.write_text(broken.read_text() + "\nnonsense;\n")
    line = broken.read_text().splitlines().index("nonsense;") + 1
    monkeypatch.setattr(programs, "shader_root", lambda: tmp_path)

    def job(device):
        spec = next(iter(spec for kind in _passes() for spec in kind.variants() if "WRITE_NORMAL" in spec.defines))
        programs.ProgramLibrary(device.context).get(spec)

    with pytest.raises(ShaderError, match=rf"shaders/common/octahedral\.glsl:{line}"):
        gl_thread().submit(job).result()


def _passes():
    from addon.render.passes import PASSES

    return PASSES


@pytest.mark.parametrize("failure", ["no driver", "too old"])
def test_no_opengl_says_what_to_install(monkeypatch, failure):
    class OldContext:
        version_code = 330

        def release(self):
            pass

    def create_context(**_):
        if failure == "too old":
            return OldContext()
        raise Exception("libEGL.so not found")

    monkeypatch.setattr(moderngl, "create_context", create_context)
    thread = GLThread()
    with pytest.raises(DeviceError, match=r"OpenGL 4\.1 or newer.*apt-get install") as caught:
        thread.submit(lambda device: None).result()
    assert ("libEGL.so not found" if failure == "no driver" else "OpenGL 3.3") in str(caught.value)
    thread.stop()


def test_stopping_cancels_queued_jobs_and_ends_the_thread():
    thread = GLThread()
    started, go_on = threading.Event(), threading.Event()

    def slow(_):
        started.set()
        go_on.wait(10)
        return "finished"

    running = thread.submit(slow)
    queued = thread.submit(lambda _: "never")
    assert started.wait(10)
    stopper = threading.Thread(target=thread.stop)
    stopper.start()
    while thread.alive:
        pass
    go_on.set()
    stopper.join(10)
    assert running.result() == "finished"
    with pytest.raises(CancelledError):
        queued.result(0)
    with pytest.raises(CancelledError):
        thread.submit(lambda _: "late").result(0)


def test_an_exception_in_a_job_does_not_end_the_thread():
    def fail(_):
        raise KeyError("lost")

    with pytest.raises(KeyError, match="lost"):
        gl_thread().submit(fail).result()
    assert gl_thread().submit(lambda _: 7).result() == 7


def test_one_thread_serves_all_and_starts_again_after_a_stop():
    first = gl_thread()
    assert gl_thread() is first
    device.stop_gl_thread()
    assert not first.alive
    second = gl_thread()
    assert second is not first
    assert second.submit(lambda opened: opened.name).result()


def live_gpu_objects(context):
    """How many names are textures, buffers, framebuffers, vertex arrays, samplers or queries to OpenGL itself."""
    load = context.mglo._context.load
    kinds = ("Texture", "Buffer", "Framebuffer", "VertexArray", "Sampler", "Query", "Program")
    asks = [ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(load(f"glIs{kind}")) for kind in kinds]
    return sum(ask(name) for ask in asks for name in range(1, 5000))


def test_releasing_a_renderer_frees_its_gpu_objects():
    def job(opened):
        counts = []
        for _ in range(3):
            renderer = Renderer(opened)
            for z in (2.0, 3.0):
                renderer.begin(SCENE, builders.camera(z=z), RenderSettings(16, 16, layers=3, deep_output=True))
                renderer.render_sample()
            held = live_gpu_objects(opened.context)
            renderer.release()
            counts.append((held, live_gpu_objects(opened.context)))
        return counts

    (held, first), *_, (_, last) = gl_thread().submit(job).result()
    assert held > first == last


def depth_of(renderer, scene, camera, settings):
    renderer.begin(scene, camera, settings)
    renderer.render_sample()
    return renderer.read(Channel.DEPTH)


def test_a_refused_begin_leaves_a_renderer_that_works(monkeypatch):
    """After too large a picture, and after a shader that did not compile, the next one is drawn."""
    settings = RenderSettings(16, 16, channels=frozenset({Channel.DEPTH}))
    other = builders.scene(replace(builders.quad("q", z=1.0), version=2), lights=(builders.light(),))

    def job(opened):
        renderer = Renderer(opened)
        with pytest.raises(RenderError):
            renderer.begin(SCENE, builders.camera(), RenderSettings(opened.maximum_size + 1, 16))
        with pytest.raises(RuntimeError, match="begin"):
            renderer.render_sample()
        depths = [depth_of(renderer, SCENE, builders.camera(), settings)[8, 8, 0]]
        with pytest.raises(RenderError):
            renderer.begin(other, builders.camera(), RenderSettings(opened.maximum_size + 1, 16))
        depths.append(depth_of(renderer, SCENE, builders.camera(), settings)[8, 8, 0])
        with monkeypatch.context() as broken:
            broken.setattr(opened.programs, "get", fail)
            renderer.begin(other, builders.camera(), settings)
            with pytest.raises(ShaderError):
                renderer.render_sample()
        depths.append(depth_of(renderer, other, builders.camera(), settings)[8, 8, 0])
        renderer.release()
        return depths

    def fail(_spec):
        raise ShaderError("broken")

    assert gl_thread().submit(job).result() == pytest.approx([3.0, 3.0, 2.0])


@pytest.mark.parametrize("orthographic", [False, True])
def test_without_a_zero_to_one_clip_space_depth_is_as_precise(orthographic):
    """Planes half a metre apart at 3 km: where the driver lacks clip control, the fragment writes its depth."""
    half = 4000.0
    scene = builders.scene(
        builders.quad("near", z=0.5, half=half),
        builders.quad("far", half=half),
        builders.quad("mid", z=0.25, half=half),
    )
    camera = builders.camera(z=3000.0, clip_end=1e4, orthographic=orthographic)
    settings = RenderSettings(32, 32, layers=3, minimum_separation=0.0, deep_output=True)

    def job(opened):
        images = []
        for clip_control in (True, False):
            opened.zero_to_one_depth = clip_control
            opened.raw.set_clip_space(zero_to_one=clip_control)
            renderer = Renderer(opened)
            renderer.begin(scene, camera, settings)
            renderer.render_sample()
            images.append([renderer.read_layer(k).depth for k in range(3)])
            renderer.release()
        opened.zero_to_one_depth = True
        opened.raw.set_clip_space(zero_to_one=True)
        return images

    with_control, without = gl_thread().submit(job).result()
    np.testing.assert_allclose([image[16, 16] for image in with_control], (2999.5, 2999.75, 3000.0), rtol=1e-7)
    np.testing.assert_array_equal(with_control, without)
