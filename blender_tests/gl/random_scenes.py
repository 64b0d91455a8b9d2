# SPDX-License-Identifier: GPL-3.0-or-later
"""Random scenes, the cameras that see them, and how they move from frame to frame."""

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np
from hypothesis import strategies as st

from addon.scene import (
    BaseColorSource,
    Camera,
    EmissionSampling,
    ImageTexture,
    InstanceBatch,
    Interpolation,
    LightKind,
    Mesh,
    Moment,
    Scene,
)
from addon.scene.versions import new_version
from blender_tests import builders

ASPECT = 2 / 3
"""Height over width of the pictures that `random_camera` is for."""


LIGHTS = (
    builders.light(position=(1.0, 2.0, 3.0), casts_shadow=False),
    builders.light(LightKind.SUN, emission=(1.0, 1.0, 1.0), casts_shadow=False),
)
"""Without shadows, whose maps are fitted to what all layers show: a pixel's light depends on what is there alone."""


@dataclass(frozen=True)
class Case:
    """A random scene, seen by a random camera."""

    seed: int
    layers: int
    separation: float
    orthographic: bool


CASES = st.builds(
    Case,
    seed=st.integers(0, 2**32 - 1),
    layers=st.integers(1, 4),
    separation=st.sampled_from([0.0, 0.05, 0.5, 1e4]),
    orthographic=st.booleans(),
)


@dataclass(frozen=True)
class Motion:
    """What moves in one frame: the camera (m) and its direction (rad), boxes and leaves (m) and the direction of every
    second one of them (rad), vertices of the soup (m)."""

    camera: float = 0.0
    turn: float = 0.0
    boxes: float = 0.0
    spin: float = 0.0
    vertices: float = 0.0

    def __mul__(self, factor: float) -> "Motion":
        return Motion(*(getattr(self, field.name) * factor for field in fields(self)))


def rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    """(3, 3) rotation about an axis by an angle in rad (Rodrigues)."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def random_rotation(generator: np.random.Generator) -> np.ndarray:
    """A uniformly random rotation (3, 3)."""
    q, r = np.linalg.qr(generator.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.linalg.det(q)


def random_scene(generator: np.random.Generator) -> Scene:
    """Sixty loose triangles and eight boxes about the origin, within 4 m, each with a pass index of its own."""
    matrices = np.tile(np.eye(4), (8, 1, 1))
    for matrix in matrices:
        matrix[:3, :3] = random_rotation(generator) * generator.uniform(0.2, 0.8, 3)
        matrix[:3, 3] = generator.uniform(-2.0, 2.0, 3)
    meshes, batches = [builders.box("box")], [numbered("box", matrices, 1000)]
    for index in range(6):
        corners = generator.uniform(-2.0, 2.0, (10, 1, 3)) + generator.uniform(-1.0, 1.0, (10, 3, 3))
        meshes.append(builders.mesh(f"soup {index}", corners, np.arange(30), normals=np.zeros((30, 3))))
        batches.append(numbered(meshes[-1].key, np.eye(4)[None], index + 1))
    return fresh(builders.scene(*meshes, batches=batches))


def numbered(mesh: str, matrices: np.ndarray, first_index: int, material: str = "white") -> InstanceBatch:
    """Instances of a mesh with consecutive pass indices."""
    indices = np.arange(first_index, first_index + len(matrices), dtype=np.int32)
    return replace(builders.batch(mesh, matrices, (material,)), object_index=indices, ids=indices.astype(np.int64))


def fresh(scene: Scene) -> Scene:
    """The scene with versions that no other scene of this process has."""
    return replace(
        scene,
        meshes={key: replace(item, version=new_version()) for key, item in scene.meshes.items()},
        materials={key: replace(item, version=new_version()) for key, item in scene.materials.items()},
        images={key: replace(item, version=new_version()) for key, item in scene.images.items()},
        batches=tuple(replace(item, version=new_version()) for item in scene.batches),
    )


def furnished(scene: Scene, generator: np.random.Generator) -> Scene:
    """The scene with leaves of an alpha-tested texture between its things, a sun, a lamp and a glowing mesh."""
    matrices = np.tile(np.eye(4), (8, 1, 1))
    for matrix in matrices:
        matrix[:3, :3] = random_rotation(generator) * generator.uniform(0.5, 1.5)
        matrix[:3, 3] = generator.uniform(-2.0, 2.0, 3)
    texture = ImageTexture("pierced", interpolation=Interpolation.CLOSEST)
    leaf = builders.material("leaf", source=BaseColorSource.TEXTURE, texture=texture, texture_alpha=True)
    glow = builders.material(
        "glow", emission_sampling=EmissionSampling.NONE, emission=(0.25, 2.0, 0.5), roughness=0.25, specular=0.04
    )
    batches = [replace(item, materials=("glow",)) if item.mesh == "soup 0" else item for item in scene.batches]
    return fresh(
        replace(
            scene,
            meshes={**scene.meshes, "leaf": builders.quad("leaf")},
            materials={**scene.materials, "leaf": leaf, "glow": glow},
            images={"pierced": builders.pierced(generator)},
            batches=(*batches, numbered("leaf", matrices, 2000, "leaf")),
            lights=LIGHTS,
        )
    )


def random_camera(generator: np.random.Generator, orthographic: bool) -> Camera:
    """Somewhere at 3–9 m, looking at about the origin: sometimes from between the things."""
    backward = generator.normal(size=3)
    backward /= np.linalg.norm(backward)
    right = np.cross(generator.normal(size=3), backward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(backward, right), backward], axis=1)
    matrix[:3, 3] = backward * generator.uniform(3.0, 9.0) + generator.uniform(-0.5, 0.5, 3)
    half = generator.uniform(2.0, 4.0) if orthographic else generator.uniform(0.3, 0.8)
    shift_x, shift_y = generator.uniform(-0.2, 0.2, 2) * half
    window = (shift_x - half, shift_x + half, shift_y - half * ASPECT, shift_y + half * ASPECT)
    return Camera(matrix, window, clip_start=0.5, clip_end=12.0, orthographic=orthographic)


def built(case: Case) -> tuple[Scene, Camera]:
    """The scene and camera of a case."""
    generator = np.random.default_rng(case.seed)
    return random_scene(generator), random_camera(generator, case.orthographic)


@lru_cache(maxsize=8)
def furnished_moment(seed: int, orthographic: bool) -> Moment:
    """A furnished scene and its camera, on a binary grid (2⁻¹⁰ m), so that a few equal binary steps are exact."""
    generator = np.random.default_rng(seed)
    scene = furnished(random_scene(generator), generator)
    return on_binary_grid(Moment(scene, random_camera(generator, orthographic)), 10)


def frames(still: Moment, motion: Motion, times: Iterable[float], seed: int = 1) -> list[Moment]:
    """What a moment looks like at some times (frames): all moves steadily; what does not move stays the same object.

    Directions are random with components in {−1, −½, ½, 1}, so that steps of a binary size are exact.
    """
    generator = np.random.default_rng(seed)

    def directions(count: int) -> np.ndarray:
        return generator.choice([-1.0, -0.5, 0.5, 1.0], (count, 3))

    camera_direction, box_directions = directions(1)[0], directions(64)
    vertex_directions = {key: directions(len(mesh.positions)) for key, mesh in still.scene.meshes.items()}
    return [
        Moment(
            _scene_at(still.scene, motion * time, box_directions, vertex_directions),
            _camera_at(still.camera, motion * time, camera_direction),
        )
        for time in times
    ]


def _camera_at(camera: Camera, moved: Motion, direction: np.ndarray) -> Camera:
    matrix = camera.world_from_camera.copy()
    if moved.turn:
        matrix[:3, :3] = rotation(direction, moved.turn) @ matrix[:3, :3]
    matrix[:3, 3] += moved.camera * direction
    return replace(camera, world_from_camera=matrix)


def _scene_at(scene: Scene, moved: Motion, box_directions: np.ndarray, vertices: dict[str, np.ndarray]) -> Scene:
    batches = scene.batches
    if moved.boxes or moved.spin:
        batches = tuple(_boxes_at(item, moved, box_directions) if item.count > 1 else item for item in batches)
    meshes = scene.meshes
    if moved.vertices:
        meshes = {
            key: _deformed(item, moved.vertices * vertices[key]) if "soup" in key else item
            for key, item in meshes.items()
        }
    return replace(scene, batches=batches, meshes=meshes)


def _boxes_at(batch: InstanceBatch, moved: Motion, directions: np.ndarray) -> InstanceBatch:
    matrices = batch.matrices.copy()
    for index, matrix in enumerate(matrices):
        matrix[:3, 3] += moved.boxes * directions[index]
        if moved.spin and index % 2:
            matrix[:3, :3] = rotation(directions[-1 - index], moved.spin) @ matrix[:3, :3]
    return replace(batch, matrices=matrices, version=new_version())


def _deformed(mesh: Mesh, offsets: np.ndarray) -> Mesh:
    return replace(mesh, positions=(mesh.positions + offsets).astype(np.float32), version=new_version())


def reordered(scene: Scene, generator: np.random.Generator) -> Scene:
    """The same scene handed over in another order: batches, meshes, materials, instances and triangles."""
    meshes = {}
    for key in generator.permutation(list(scene.meshes)):
        item = scene.meshes[str(key)]
        meshes[item.key] = replace(item, triangles=generator.permutation(item.triangles), version=new_version())
    batches = []
    for position in generator.permutation(len(scene.batches)):
        item = scene.batches[position]
        order = generator.permutation(item.count)
        batches.append(
            replace(
                item,
                key=f"{generator.integers(10**6)} {item.key}",
                matrices=item.matrices[order],
                object_index=item.object_index[order],
                ids=item.ids[order],
                version=new_version(),
            )
        )
    return replace(scene, meshes=meshes, batches=tuple(batches))


def transformed(moment: Moment, matrix: np.ndarray) -> Moment:
    """Everything, the camera included, somewhere else."""
    batches = tuple(
        replace(item, matrices=matrix @ item.matrices, version=new_version()) for item in moment.scene.batches
    )
    camera = replace(moment.camera, world_from_camera=matrix @ moment.camera.world_from_camera)
    return Moment(replace(moment.scene, batches=batches), camera)


def scaled(moment: Moment, factor: float) -> Moment:
    """The same view of everything larger by a factor; lights are left as they are."""
    scale = np.diag([factor, factor, factor, 1.0])
    batches = tuple(
        replace(item, matrices=scale @ item.matrices, version=new_version()) for item in moment.scene.batches
    )
    camera = moment.camera
    matrix = camera.world_from_camera.copy()
    matrix[:3, 3] *= factor
    window = tuple(edge * factor for edge in camera.window) if camera.orthographic else camera.window
    camera = Camera(matrix, window, camera.clip_start * factor, camera.clip_end * factor, camera.orthographic)
    return Moment(replace(moment.scene, batches=batches), camera)


def on_binary_grid(moment: Moment, bits: int) -> Moment:
    """Translations and vertices rounded to 2⁻ᵇⁱᵗˢ m."""
    grid = 2.0**bits

    def rounded(matrices: np.ndarray) -> np.ndarray:
        matrices = matrices.copy()
        matrices[..., :3, 3] = np.round(matrices[..., :3, 3] * grid) / grid
        return matrices

    batches = tuple(
        replace(item, matrices=rounded(item.matrices), version=new_version()) for item in moment.scene.batches
    )
    meshes = {
        key: replace(
            item, positions=np.round(item.positions * np.float32(grid)) / np.float32(grid), version=new_version()
        )
        for key, item in moment.scene.meshes.items()
    }
    camera = replace(moment.camera, world_from_camera=rounded(moment.camera.world_from_camera))
    return Moment(replace(moment.scene, batches=batches, meshes=meshes), camera)
