# SPDX-License-Identifier: GPL-3.0-or-later
"""What every pass is and what it may use while it runs."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

from ...scene import Camera, RenderSettings, Scene
from ..device import Device
from ..film import Film
from ..geometry import GeometryStore
from ..images import ImageStore
from ..plan import Plan, PlannedPass
from ..programs import ProgramSpec
from ..sampling import Sample
from ..targets import TexturePool
from ..uniforms import UniformBlock


@dataclass
class Frame:
    """One view's state during one sample. `camera` already has the sample's sub-pixel jitter."""

    device: Device
    pool: TexturePool
    geometry: GeometryStore
    images: ImageStore
    film: Film
    scene: Scene
    settings: RenderSettings
    plan: Plan
    camera: Camera
    sample: Sample


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
