# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene: everything the renderer reads."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from .arrays import Color
from .camera import Camera
from .geometry import InstanceBatch, Mesh
from .lights import Light
from .materials import Image, Material


@dataclass(frozen=True)
class World:
    """Constant radiance that arrives from every direction, scene-linear RGB, W/(sr·m²)."""

    radiance: Color = (0.0, 0.0, 0.0)


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
