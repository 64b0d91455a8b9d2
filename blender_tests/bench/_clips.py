# SPDX-License-Identifier: GPL-3.0-or-later
"""Short sequences of frames to measure on: the hall in five kinds of motion, and real scenes if they are here.

Lights are left away: only the deep G-buffer is measured.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from addon.scene import Camera, Image, InstanceBatch, Material, Mesh, Moment, Scene, World, snapshot
from blender_tests.bench._hall import camera, hall, with_carousel, with_waves
from blender_tests.bench._runs import SHARED, snapshots

T = TypeVar("T", Mesh, InstanceBatch, Material, Image)

FRAMES = 5
"""Two for history, and three to measure."""
SLOW, FAST = 2.0, 40.0
"""Pixels a frame, on average."""
UNSTEADY = (1.0, 0.8, 1.2, 0.9, 1.1)
"""Speed of a pan from frame to frame, relative to that: no hand moves evenly, which extrapolation would profit from."""
LARGE_DETAIL = math.sqrt(10.0)
HALL_DEPTH = 9.0
"""View depth (m) of the hall's middle row of columns, where pans are counted in pixels."""
SPONZA, ROBOT = SHARED / "sponza" / "sponza.blend", SHARED / "robot_expressive" / "robot_dance.blend"
SPONZA_DEPTH = 8.0
SPONZA_SPEED = -10.0
"""Pixels a frame, to the left: to the right a column is in the way."""
DANCE_STARTS = 20


@dataclass(frozen=True)
class Clip:
    """Consecutive frames, and what moves in them. The last is only there to be looked ahead to."""

    name: str
    motion: str
    moments: tuple[Moment, ...]


def hall_clips(width: int, height: int) -> list[Clip]:
    """The hall at rest, in two pans, with a turning group and with waving cloth."""
    scene, view = hall(), camera(width, height)
    at_rest = Moment(scene, view)
    turned = [Moment(with_carousel(scene, math.radians(4.0 * frame)), view) for frame in range(FRAMES + 1)]
    waving = [Moment(with_waves(scene, 0.5 * frame), view) for frame in range(FRAMES + 1)]
    return [
        Clip("hall, static", "nothing moves", (at_rest,) * (FRAMES + 1)),
        _pan("hall, slow pan", at_rest, SLOW, HALL_DEPTH, width),
        _pan("hall, fast pan", at_rest, FAST, HALL_DEPTH, width),
        Clip("hall, rotating", "24 rings turn by 4° a frame around one axis", tuple(turned)),
        Clip("hall, deforming", "a wave of 0.25 m runs through three cloths, 0.5 rad a frame", tuple(waving)),
    ]


def real_clips(width: int, height: int, scratch: Path) -> tuple[list[Clip], list[str]]:
    """Sequences of the shared scenes, made in the folder `scratch`, and the names of the scenes that are not here."""
    sources: dict[Path, Callable[[], Clip]] = {
        SPONZA: lambda: _sponza(width, height, scratch),
        ROBOT: lambda: _robot(width, height, scratch),
    }
    clips = [make() for path, make in sources.items() if path.is_file()]
    return clips, [path.stem for path in sources if not path.is_file()]


def large_clip(width: int, height: int) -> Clip:
    """A slow pan through a hall of about 2,000,000 triangles."""
    start = Moment(hall(LARGE_DETAIL), camera(width, height))
    return _pan("large hall, slow pan", start, SLOW, HALL_DEPTH, width)


def panned(view: Camera, distance: float) -> Camera:
    """The camera moved to its right by `distance` metres."""
    pose = view.world_from_camera.copy()
    pose[:3, 3] += distance * view.rotation[:, 0]
    return replace(view, world_from_camera=pose)


def pan_step(view: Camera, pixels: float, depth: float, width: int) -> float:
    """Metres to the right by which a perspective camera moves what is `depth` metres away by `pixels` to the left."""
    return pixels * depth * (view.window[1] - view.window[0]) / width


def shared(scene: Scene, previous: Scene) -> Scene:
    """`scene` with everything that is equal in `previous` replaced by the very same object, as syncs share it."""
    batches = {batch.key: batch for batch in previous.batches}
    return replace(
        scene,
        meshes={key: _kept(item, previous.meshes.get(key)) for key, item in scene.meshes.items()},
        materials={key: _kept(item, previous.materials.get(key)) for key, item in scene.materials.items()},
        images={key: _kept(item, previous.images.get(key)) for key, item in scene.images.items()},
        batches=tuple(_kept(item, batches.get(item.key)) for item in scene.batches),
    )


def _sponza(width: int, height: int, scratch: Path) -> Clip:
    (scene,) = _scenes(snapshots(SPONZA, [1], (width, height), scratch))
    return _pan("Sponza, pan", _moment(scene), SPONZA_SPEED, SPONZA_DEPTH, width)


def _robot(width: int, height: int, scratch: Path) -> Clip:
    frames = [DANCE_STARTS + frame for frame in range(FRAMES + 1)]
    scenes = _scenes(snapshots(ROBOT, frames, (width, height), scratch))
    return Clip("robot, dancing", "an armature, 30 frames a second", tuple(map(_moment, scenes)))


def _pan(name: str, start: Moment, pixels: float, depth: float, width: int) -> Clip:
    step = pan_step(start.camera, pixels, depth, width)
    travelled = step * np.cumsum((0.0, *np.resize(UNSTEADY, FRAMES)))
    moments = [Moment(start.scene, panned(start.camera, float(distance))) for distance in travelled]
    return Clip(
        name, f"the camera moves sideways unsteadily, {abs(pixels):g} px a frame at {depth:g} m", tuple(moments)
    )


def _scenes(paths: Sequence[Path]) -> list[Scene]:
    """The scenes of consecutive snapshots, without lights; what does not change is the same object in all."""
    scenes: list[Scene] = []
    for path in paths:
        scene = replace(snapshot.load(path).scene, lights=(), world=World())
        scenes.append(shared(scene, scenes[-1]) if scenes else scene)
    return scenes


def _moment(scene: Scene) -> Moment:
    assert scene.camera is not None, "the shared scenes have cameras"
    return Moment(scene, scene.camera)


def _kept(item: T, before: T | None) -> T:
    return before if before is not None and _equal(item, before) else item


def _equal(first: object, second: object) -> bool:
    """Whether two values are equal but for their version numbers."""
    if isinstance(first, np.ndarray) or isinstance(second, np.ndarray):
        return np.array_equal(first, second)  # pyright: ignore[reportArgumentType]
    if is_dataclass(first) and not isinstance(first, type) and type(first) is type(second):
        names = [field.name for field in fields(first) if field.name != "version"]
        return all(_equal(getattr(first, name), getattr(second, name)) for name in names)
    return first == second
