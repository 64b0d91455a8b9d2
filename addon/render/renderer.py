# SPDX-License-Identifier: GPL-3.0-or-later
"""One view of a scene: uploads what changed, plans, and renders samples into a film."""

import time

import numpy as np

from ..scene import Camera, Channel, Layering, Moment, RenderSettings, Scene, Sequence
from ..scene.arrays import Float32Array
from ..scene.correspondence import Correspondence
from .device import Device
from .draws import DrawLists
from .environment import EnvironmentTextures
from .film import Film
from .geometry import GeometryStore
from .images import ImageStore
from .indirect_plan import linking_warnings, reflectance_warnings
from .layering import Trial, calibration_view, resolved
from .lighting import Lighting
from .memory import Memory
from .oracle_state import OracleState
from .passes import PASSES, Frame, Pass
from .plan import FIRST_SAMPLE_CHANNELS, Plan, plan
from .readback import EMPTY_DEPTH, LayerImages, positions, read_layers, read_target
from .sampling import film_sample
from .statistics import PassTimers, RenderStatistics
from .surroundings import oracle_depends_on, surroundings
from .targets import TexturePool


class Renderer:
    """Renders one view. Every method, the constructor included, runs on the GL thread."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._pool = TexturePool(device)
        self._geometry = GeometryStore(device)
        self._draws = DrawLists(device)
        self._correspondences: list[tuple[Scene, Correspondence]] = []
        self._images = ImageStore(device)
        self._oracle = OracleState()
        self._memory = Memory()
        self._lighting = Lighting(device)
        self._environment = EnvironmentTextures(device)
        self._film = Film(device)
        self._timers = PassTimers(device)
        self._passes: dict[str, Pass] = {}
        self._frame: Frame | None = None
        self._camera: Camera | None = None
        self._first_sample: dict[Channel, Float32Array] = {}
        self._layers: tuple[LayerImages, ...] = ()
        self._pictures = 0
        self._upload_seconds = 0.0
        self._warnings: tuple[str, ...] = ()

    def begin(self, scene: Scene, camera: Camera, settings: RenderSettings, sequence: Sequence | None = None) -> Plan:
        """Upload what changed since the last call, plan, allocate, and start an empty film.

        `sequence`: the frames around this one; without it nothing is known of others.

        Raises RenderError where the device cannot hold the targets.
        """
        self._frame = None
        oracle, self._oracle = self._oracle, OracleState()  # where anything fails, nothing is known any more
        sequence = sequence or Sequence()
        planned = plan(scene, settings, camera, continuous=sequence.continuous, memory=self._memory)
        self._pool.prepare(
            (settings.width, settings.height),
            planned.targets,
            guard_band=planned.guard_band,
            depth_layers=planned.drawn_layers,
        )
        frames = surroundings(Moment(scene, camera), sequence, planned, settings)
        self._upload(scene, frames.history.scene if frames.history else scene, settings.alpha_threshold)
        self._lighting.begin(scene, settings, planned.lights, frames.view.position)
        oracle.begin(oracle_depends_on(settings, planned), continuous=sequence.continuous)
        self._film.samples = 0
        self._first_sample, self._layers = {}, ()
        self._camera = camera
        self._frame = Frame(
            device=self._device,
            pool=self._pool,
            geometry=self._geometry,
            draws=self._draws,
            images=self._images,
            film=self._film,
            oracle=oracle,
            lighting=self._lighting,
            environment=self._environment,
            correspondence=self._correspondence,
            scene=scene,
            settings=settings,
            plan=planned,
            layering=self._layering(settings, planned),
            view=frames.view,
            camera=frames.view,
            sample=film_sample(0, settings.filter_radius, settings.seed),
            previous=frames.previous,
            history=frames.history,
            ahead=frames.ahead,
            continuous=sequence.continuous,
            picture=self._pictures if sequence.continuous else 0,
        )
        self._pictures += sequence.continuous
        self._prepare_passes(self._frame)
        self._oracle = oracle
        return planned

    def render_sample(self) -> int:
        """Render one more sample into the film; returns how many it holds.

        Raises ShaderError where a shader is broken, RenderError where the driver lacks what the settings ask for.
        """
        frame = self._require_frame()
        frame.begin_sample(film_sample(self._film.samples, frame.settings.filter_radius, frame.settings.seed))
        for planned in frame.plan.passes:
            with self._timers.measure(planned.name):
                self._passes[planned.name].run(frame, planned)
        if frame.sample.index == 0:
            assert self._camera is not None
            self._keep_first_sample(frame, self._camera)
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
        frame = self._require_frame()
        draws = self._draws.of(frame.scene)
        sizes = self._pool.bytes()
        if self._pool.guard_band:
            sizes["of these, guard band"] = self._pool.guard_band_bytes()
        shadows = frame.shadows
        if shadows is not None:
            sizes["shadow maps"] = shadows.bytes
        if frame.grid is not None:
            finest = frame.grid.levels[0]
            sizes[f"radiance grid ({len(frame.grid.levels)} levels, finest cells {finest.cell:.3g} m)"] = (
                frame.grid.bytes
            )
        sizes["geometry"] = self._geometry.bytes()
        sizes["images"] = self._images.bytes()
        if frame.scene.world.environment is not None:
            sizes["world"] = self._environment.bytes()
        return RenderStatistics(
            upload_s=self._upload_seconds,
            passes=self._timers.milliseconds(),
            left_out=tuple((left.name, left.reason) for left in frame.plan.left_out),
            triangles=draws.triangles,
            draws=len(draws.seen),
            instances=sum(batch.count for batch in frame.scene.batches if batch.seen_by_camera),
            bytes=sizes,
            warnings=self._warnings
            + reflectance_warnings(frame.scene, frame.plan.indirect)
            + linking_warnings(frame.scene, frame.plan.indirect),
            device=self._device.name,
            shadow_maps_drawn=shadows.drawn if shadows else 0,
            shadow_maps_kept=shadows.kept if shadows else 0,
        )

    def release(self) -> None:
        """Free everything the view holds on the GPU."""
        for render_pass in self._passes.values():
            render_pass.release()
        self._passes.clear()
        self._draws.release()
        self._images.release()
        self._geometry.release()
        self._pool.release()
        self._lighting.release()
        self._environment.release()
        self._oracle = OracleState()
        self._correspondences.clear()
        self._memory = Memory()
        self._timers.forget()
        self._frame = None

    def _upload(self, scene: Scene, history: Scene, alpha_threshold: float) -> None:
        """Bring what is drawn to the GPU: the scene, and the one that its oracle is drawn from."""
        start = time.perf_counter()
        scenes = [scene] if history is scene else [scene, history]
        self._geometry.update(scenes)
        self._warnings = tuple(self._images.update({**history.images, **scene.images}))
        self._draws.prepare(scenes, alpha_threshold)
        self._upload_seconds = time.perf_counter() - start

    def _correspondence(self, other: Scene) -> Correspondence:
        """What of the view's scenes is what of another; those of the last few scenes are kept."""
        for scene, correspondence in self._correspondences:
            if scene is other:
                return correspondence
        self._correspondences = [(other, Correspondence(other)), *self._correspondences[:2]]
        return self._correspondences[0][1]

    def _layering(self, settings: RenderSettings, planned: Plan) -> Layering:
        """How one pass reaches several layers; Two-Pass needs nothing of the kind and measures nothing."""
        if settings.layering is Layering.FASTEST and not planned.one_pass:
            return Layering.VERTEX_SHADER
        return resolved(settings, self._device, self._try_layering)

    def _try_layering(self, settings: RenderSettings) -> Trial:
        """Render the calibration view in a renderer of its own."""
        renderer = Renderer(self._device)
        try:
            renderer.begin(*calibration_view(), settings)
            times: list[float] = []
            for _ in range(settings.samples):
                renderer.render_sample()
                times.append(dict(renderer.statistics().passes)["gbuffer"])
            layers = [renderer.read_layer(layer) for layer in range(settings.layers)]
            bits = b"".join(image.tobytes() for item in layers for image in (item.depth, item.normal))
            return Trial(min(times[1:]), bits)
        finally:
            renderer.release()

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

    def _keep_first_sample(self, frame: Frame, camera: Camera) -> None:
        """Read what is not a mean over samples; `camera` is the picture's, without guard band."""
        wanted = frame.settings.channels & FIRST_SAMPLE_CHANNELS
        if wanted:
            depth = read_target(self._pool, "gbuffer.view_depth")[0, ..., 0]
            covered = np.isfinite(depth)
            if Channel.DEPTH in wanted:
                self._first_sample[Channel.DEPTH] = np.where(covered, depth, EMPTY_DEPTH)[..., None]
            if Channel.POSITION in wanted:
                self._first_sample[Channel.POSITION] = positions(depth, camera)
            if Channel.OBJECT_INDEX in wanted:
                self._first_sample[Channel.OBJECT_INDEX] = read_target(self._pool, "gbuffer.object_index")[0]
        if frame.settings.deep_output:
            self._layers = read_layers(
                self._pool, frozenset(target.name for target in frame.plan.targets), frame.plan.layers
            )

    def _require_frame(self) -> Frame:
        if self._frame is None:
            raise RuntimeError("begin() has not been called, or failed")
        return self._frame
