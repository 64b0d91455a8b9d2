# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene: everything the renderer reads."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from .arrays import Color, Float32Array, Float64Array
from .camera import Camera
from .geometry import InstanceBatch, Mesh
from .lights import Light
from .materials import Image, Material


@dataclass(frozen=True)
class EnvironmentMap:
    """Radiance by direction.

    `pixels` (H, W, 3) float32 ≥ 0 and finite, scene-linear RGB, equirectangular: texel (row, column) is about the
    direction with elevation ((row + ½)/H − ½)·π above the XY plane and azimuth (½ − (column + ½)/W)·2π from +X
    towards +Y, as Blender's Environment Texture lays it out.
    """

    key: str
    name: str
    version: int
    pixels: Float32Array


@dataclass(frozen=True)
class SunDisc:
    """The disc of a sky's sun as the camera sees it, added to the world's radiance; a `Light` of its own lights.

    `direction`, `zenith`: unit vectors in world space, to the disc's centre and straight up from the horizon.
    `half_angle` (rad): angular radius. Elevations are in rad above the centre's: radiance, scene-linear RGB,
    W/(sr·m²), goes evenly from `lowest` at `lowest_elevation` to `highest` at `half_angle`, times
    1 − limb_darkening · (1 − √(1 − t²)), t being 0 at the centre and 1 at the limb; it is 0 below `horizon`.
    """

    direction: tuple[float, float, float]
    zenith: tuple[float, float, float]
    half_angle: float
    lowest: Color
    highest: Color
    lowest_elevation: float
    horizon: float
    limb_darkening: float


@dataclass(frozen=True)
class World:
    """Radiance that arrives from infinitely far away, scene-linear RGB, W/(sr·m²).

    `radiance`: of every direction, or the factor on `environment`, which is asked for the direction
    `environment_from_world` (3, 3), a rotation, times the one in world space; None for no rotation.
    `sun_disc`: what the background shows of a sun besides.
    `seen_by_camera`, `seen_by_diffuse`, `seen_by_glossy`: who sees it.
    """

    radiance: Color = (0.0, 0.0, 0.0)
    environment: EnvironmentMap | None = None
    environment_from_world: Float64Array | None = None
    sun_disc: SunDisc | None = None
    seen_by_camera: bool = True
    seen_by_diffuse: bool = True
    seen_by_glossy: bool = True

    @property
    def shines(self) -> bool:
        """Whether any surface can receive light from it."""
        return max(self.radiance) > 0.0 and (self.seen_by_diffuse or self.seen_by_glossy)


@dataclass(frozen=True)
class Versions:
    """Counters that `sync` raises when the named part changed; equal counters mean equal data."""

    geometry: int = 0
    transforms: int = 0
    materials: int = 0
    lights: int = 0
    camera: int = 0
    world: int = 0


@dataclass(frozen=True)
class Scene:
    """One evaluated frame. Dictionaries are keyed by each item's `key`.

    `camera` is None where the scene has none; the engine then asks the user for one.
    Every key that a batch, material or texture names exists in its dictionary: `sync` puts a stand-in where
    Blender's data is missing and reports it.
    """

    meshes: Mapping[str, Mesh] = field(default_factory=dict[str, Mesh])
    materials: Mapping[str, Material] = field(default_factory=dict[str, Material])
    images: Mapping[str, Image] = field(default_factory=dict[str, Image])
    batches: tuple[InstanceBatch, ...] = ()
    lights: tuple[Light, ...] = ()
    world: World = World()
    camera: Camera | None = None
    versions: Versions = Versions()
