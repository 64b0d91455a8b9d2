# SPDX-License-Identifier: GPL-3.0-or-later
"""One view of a scene: uploads what changed, plans, and renders samples into a film."""

import time

import numpy as np

from ..scene import Camera, Channel, RenderSettings, Scene
from ..scene.arrays import Float32Array
from .device import Device
from .film import Film
from .geometry import GeometryStore
from .images import ImageStore
from .passes import PASSES, Frame, GBufferPass, Pass
from .plan import FIRST_SAMPLE_CHANNELS, Plan, plan
from .readback import EMPTY_DEPTH, LayerImages, positions, read_layers, read_target
from .sampling import film_sample
from .statistics import PassTimers, RenderStatistics
from .targets import TexturePool


class Renderer:
    """Renders one view. Every method, the constructor included, runs on the GL thread."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._pool = TexturePool(device)
        self._geometry = GeometryStore(device)
        self._images = ImageStore(device)
        self._film = Film(device)
        self._timers = PassTimers(device)
        self._passes: dict[str, Pass] = {}
        self._frame: Frame | None = None
        self._camera: Camera | None = None
        self._first_sample: dict[Channel, Float32Array] = {}
        self._layers: tuple[LayerImages, ...] = ()
        self._upload_seconds = 0.0
        self._warnings: tuple[str, ...] = ()

    def begin(self, scene: Scene, camera: Camera, settings: RenderSettings) -> Plan:
        """Upload what changed since the last call, plan, allocate, and start an empty film.

        Raises RenderError where the device cannot hold the targets, ShaderError where a shader is broken.
        """
        self._frame = None
        start = time.perf_counter()
        self._geometry.update(scene)
        self._warnings = tuple(self._images.update(scene))
        self._upload_seconds = time.perf_counter() - start
        planned = plan(scene, settings)
        self._pool.prepare((settings.width, settings.height), planned.targets)
        self._film.samples = 0
        self._first_sample, self._layers = {}, ()
        self._camera = camera
        sample = film_sample(0, settings.filter_radius, settings.seed)
        self._frame = Frame(
            self._device,
            self._pool,
            self._geometry,
            self._images,
            self._film,
            scene,
            settings,
            planned,
            camera,
            sample,
        )
        self._prepare_passes(self._frame)
        return planned

    def render_sample(self) -> int:
        """Render one more sample into the film; returns how many it holds."""
        frame, camera = self._require_frame()
        frame.sample = film_sample(self._film.samples, frame.settings.filter_radius, frame.settings.seed)
        offset_x, offset_y = frame.sample.pixel_offset
        frame.camera = camera.shifted(offset_x / frame.settings.width, offset_y / frame.settings.height)
        for planned in frame.plan.passes:
            with self._timers.measure(planned.name):
                self._passes[planned.name].run(frame, planned)
        if frame.sample.index == 0:
            self._keep_first_sample(frame)
        self._film.samples += 1
        return self._film.samples

    def read(self, channel: Channel) -> Float32Array:
        """A film image (H, W, C) float32, row 0 at the bottom; see `Channel`.

        Raises KeyError for a channel that the settings did not ask for, RuntimeError before the first sample.
        """
        self._require_frame()
        if self._film.samples == 0:
            raise RuntimeError("no sample has been rendered yet")
        if channel in FIRST_SAMPLE_CHANNELS:
            return self._first_sample[channel]
        return self._film.mean(self._pool, channel)

    def read_layer(self, layer: int) -> LayerImages:
        """One layer of sample 0's deep G-buffer. Raises IndexError where the settings had no `deep_output`."""
        return self._layers[layer]

    def statistics(self) -> RenderStatistics:
        """What the last `begin` and sample did; waits for the GPU."""
        frame, _ = self._require_frame()
        gbuffer = self._passes["gbuffer"]
        assert isinstance(gbuffer, GBufferPass)
        sizes = self._pool.bytes()
        sizes["geometry"] = self._geometry.bytes()
        sizes["images"] = self._images.bytes()
        return RenderStatistics(
            upload_s=self._upload_seconds,
            passes=self._timers.milliseconds(),
            left_out=tuple((left.name, left.reason) for left in frame.plan.left_out),
            triangles=gbuffer.triangles,
            draws=gbuffer.draws,
            instances=sum(batch.count for batch in frame.scene.batches),
            bytes=sizes,
            warnings=self._warnings,
            device=self._device.name,
        )

    def release(self) -> None:
        """Free everything the view holds on the GPU."""
        for render_pass in self._passes.values():
            render_pass.release()
        self._passes.clear()
        self._images.release()
        self._geometry.release()
        self._pool.release()
        self._timers.forget()
        self._frame = None

    def _prepare_passes(self, frame: Frame) -> None:
        wanted = {planned.name for planned in frame.plan.passes}
        for name in [name for name in self._passes if name not in wanted]:
            self._passes.pop(name).release()
        self._timers.forget()
        kinds = {kind.name: kind for kind in PASSES}
        for planned in frame.plan.passes:
            if planned.name not in self._passes:
                self._passes[planned.name] = kinds[planned.name](self._device)
            self._passes[planned.name].prepare(frame, planned)

    def _keep_first_sample(self, frame: Frame) -> None:
        wanted = frame.settings.channels & FIRST_SAMPLE_CHANNELS
        if wanted:
            depth = read_target(self._pool, "gbuffer.view_depth")[0, ..., 0]
            covered = np.isfinite(depth)
            if Channel.DEPTH in wanted:
                self._first_sample[Channel.DEPTH] = np.where(covered, depth, EMPTY_DEPTH)[..., None]
            if Channel.POSITION in wanted:
                self._first_sample[Channel.POSITION] = positions(depth, frame.camera)
            if Channel.OBJECT_INDEX in wanted:
                self._first_sample[Channel.OBJECT_INDEX] = read_target(self._pool, "gbuffer.object_index")[0]
        if frame.settings.deep_output:
            self._layers = read_layers(self._pool, frozenset(target.name for target in frame.plan.targets))

    def _require_frame(self) -> tuple[Frame, Camera]:
        if self._frame is None or self._camera is None:
            raise RuntimeError("begin() has not been called, or failed")
        return self._frame, self._camera
