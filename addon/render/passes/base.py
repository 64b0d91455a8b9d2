# SPDX-License-Identifier: GPL-3.0-or-later
"""What every pass is and what it may use while it runs."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import moderngl

from ...scene import Camera, Layering, Moment, RenderSettings, Scene
from ...scene.correspondence import Correspondence
from ...scene.drift import pixel_drift
from ..device import Device
from ..draws import DrawLists
from ..environment import EnvironmentTextures
from ..film import Film
from ..geometry import GeometryStore
from ..images import ImageStore
from ..lighting import Lighting
from ..oracle_state import OracleState
from ..plan import Plan, PlannedPass
from ..programs import ProgramSpec
from ..sampling import Sample
from ..targets import TexturePool
from ..uniforms import UniformBlock

if TYPE_CHECKING:
    from ..grid.textures import GridTextures


@dataclass(frozen=True)
class ShadowTextures:
    """The shadow maps of one sample: their pages (None: there is no map), and the table of what each is; how many were
    `drawn` since the view began and how often one was there already; bytes of video memory."""

    atlas: moderngl.TextureArray | None
    table: moderngl.Texture
    drawn: int
    kept: int
    bytes: int


@dataclass
class Frame:
    """One view's state during one sample.

    Cameras include the guard band. `view`: the scene's own; `camera`: the same with the sample's sub-pixel jitter.
    `layering`: how one pass over the geometry reaches several layers. `oracle`: what its textures show.
    `previous`: the frame before. `history`: what a final render draws its oracle from, if not from the frame itself.
    `ahead`: the next picture as far as it is known or predicted, None where that is the next sample.
    `continuous`: as in `Sequence`. `drift`: what `drift_since` found. `shadows`: this sample's maps, if it has any.
    `grid`: the radiance grid, where there is one. `picture`: how many pictures a viewport showed before; 0 elsewhere.
    """

    device: Device
    pool: TexturePool
    geometry: GeometryStore
    draws: DrawLists
    images: ImageStore
    film: Film
    oracle: OracleState
    lighting: Lighting
    environment: EnvironmentTextures
    correspondence: Callable[[Scene], Correspondence]
    scene: Scene
    settings: RenderSettings
    plan: Plan
    layering: Layering
    view: Camera
    camera: Camera
    sample: Sample
    previous: Moment | None
    history: Moment | None
    ahead: Moment | None
    continuous: bool
    drift: float | None = None
    shadows: ShadowTextures | None = None
    grid: "GridTextures | None" = None
    picture: int = 0

    @property
    def moment(self) -> Moment:
        """What this sample shows."""
        return Moment(self.scene, self.camera)

    def jittered(self, camera: Camera, sample: Sample) -> Camera:
        """A camera (guard band included) as a sample sees through it."""
        width, height = self.pool.size
        x, y = sample.pixel_offset
        return camera.shifted(x / width, y / height)

    def drift_since(self, oracle: Moment, moment: Moment) -> float:
        """A bound on the pixels that surfaces moved between two moments; found once, for jitter moves both alike."""
        if oracle.equals(moment):
            return 0.0
        if self.drift is None:
            self.drift = pixel_drift(oracle, moment, *self.pool.size)
        return self.drift

    def begin_sample(self, sample: Sample) -> None:
        """Go on to a sample."""
        self.sample, self.camera = sample, self.jittered(self.view, sample)
        self.lighting.begin_sample(sample.index)


class Pass(Protocol):
    """A pass of the pipeline; one object per view, built when the plan first needs it."""

    name: str

    def __init__(self, device: Device) -> None: ...

    @classmethod
    def variants(cls) -> Iterable[ProgramSpec]:
        """Every program variant that a plan can ask for."""
        ...

    def prepare(self, frame: Frame, planned: PlannedPass) -> None:
        """Upload what is the same for all samples."""
        ...

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Draw one sample."""
        ...

    def release(self) -> None:
        """Free what the pass owns."""
        ...


class UniformBuffer:
    """The GPU copy of one uniform block."""

    def __init__(self, device: Device, block: UniformBlock) -> None:
        self._block = block
        self._buffer = device.context.buffer(reserve=block.dtype.itemsize)

    def bind(self, binding: int, **values: object) -> None:
        """Write the block's fields and bind it."""
        self._buffer.write(self._block.pack(**values))
        self._buffer.bind_to_uniform_block(binding)

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()


def subsets(names: Iterable[str]) -> list[frozenset[str]]:
    """Every subset of the names."""
    result = [frozenset[str]()]
    for name in names:
        result += [subset | {name} for subset in result]
    return result
