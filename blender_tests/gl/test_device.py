# SPDX-License-Identifier: GPL-3.0-or-later
import gc
import threading
from concurrent.futures import CancelledError

import moderngl
import pytest

from addon.render import DeviceError, GLThread, Renderer, RenderError, ShaderError, device, gl_thread, programs
from addon.scene import RenderSettings
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


GPU_OBJECTS = (moderngl.Buffer, moderngl.Texture, moderngl.TextureArray, moderngl.Framebuffer, moderngl.VertexArray)


def live_gpu_objects():
    gc.collect()
    return sum(
        isinstance(item, GPU_OBJECTS) and not isinstance(item.mglo, moderngl.InvalidObject) for item in gc.get_objects()
    )


def test_releasing_a_renderer_frees_its_gpu_objects():
    def job(opened):
        counts = []
        for _ in range(2):
            renderer = Renderer(opened)
            renderer.begin(SCENE, builders.camera(), RenderSettings(16, 16, layers=3, deep_output=True))
            renderer.render_sample()
            held = live_gpu_objects()
            renderer.release()
            counts.append((held, live_gpu_objects()))
        return counts

    (held, first), (_, second) = gl_thread().submit(job).result()
    assert held > first == second
