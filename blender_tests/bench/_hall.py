# SPDX-License-Identifier: GPL-3.0-or-later
"""A hall made of arrays: rows of columns, plants with alpha-tested leaves, hanging cloth, a carousel.

+X along the hall, +Y away from the camera, +Z up, metres.
"""

import math
from dataclasses import replace

import numpy as np

from addon.scene import (
    BaseColorSource,
    Camera,
    Image,
    ImageTexture,
    InstanceBatch,
    Material,
    Mesh,
    Scene,
    SlotRange,
)
from addon.scene.arrays import Float64Array
from addon.scene.versions import new_version

CAMERA_POSITION = (0.0, -6.0, 1.7)
HALF_WIDTH = 0.6
"""Of the camera's window at view depth 1."""

LEFT, RIGHT, BACK, CEILING = -12.0, 18.0, 9.0, 5.0
COLUMN_ROWS = (0.0, 3.0, 6.0)
COLUMN_SPACING = 2.5
CAROUSEL_CENTER = (0.0, 1.5, 0.0)
CAROUSEL_RADIUS = 1.9
CLOTHS = ((-3.7, 1.2), (3.7, 1.2), (0.0, 4.4))
CLOTH_SIZE = (2.2, 3.4)
WAVE_HEIGHT = 0.25


def camera(width: int, height: int) -> Camera:
    """The hall's camera, which looks along +Y, for a picture of this many pixels."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    pose[:3, 3] = CAMERA_POSITION
    top = HALF_WIDTH * height / width
    return Camera(pose, (-HALF_WIDTH, HALF_WIDTH, -top, top), 0.05, 1000.0)


def hall(detail: float = 1.0) -> Scene:
    """The whole hall; about 200,000 triangles times the square of `detail`."""
    wall, leaf = Material("wall", "wall", new_version()), _leaf_material()
    placed = (
        (_walls(), np.eye(4)[None]),
        (_column(detail), _at([(x, y, 0.0) for y in COLUMN_ROWS for x in _columns_along_x()])),
        (_pot(detail), _at(_plants())),
        (_torus(detail), carousel(0.0)),
    )
    plants = _foliage(detail)
    cloths = [cloth(index, 0.0, detail) for index in range(len(CLOTHS))]
    batches = [_batch(mesh.key, matrices, wall.key) for mesh, matrices in placed]
    batches.append(_batch(plants.key, _at([(x, y, 0.45) for x, y, _ in _plants()]), leaf.key))
    batches += [_batch(mesh.key, np.eye(4)[None], wall.key) for mesh in cloths]
    return Scene(
        meshes={mesh.key: mesh for mesh in (*(mesh for mesh, _ in placed), plants, *cloths)},
        materials={wall.key: wall, leaf.key: leaf},
        images={"leaf": _leaf_image()},
        batches=tuple(sorted(batches, key=lambda batch: batch.key)),
    )


def with_carousel(scene: Scene, angle: float) -> Scene:
    """The hall with the carousel turned by `angle` (rad); everything else is the same object."""
    turned = [
        replace(batch, matrices=carousel(angle), version=new_version()) if batch.mesh == "torus" else batch
        for batch in scene.batches
    ]
    return replace(scene, batches=tuple(turned))


def with_waves(scene: Scene, phase: float, detail: float = 1.0) -> Scene:
    """The hall with its cloth at `phase` (rad) of the wave; everything else is the same object."""
    cloths = [cloth(index, phase, detail) for index in range(len(CLOTHS))]
    return replace(scene, meshes={**scene.meshes, **{mesh.key: mesh for mesh in cloths}})


def carousel(angle: float) -> Float64Array:
    """(24, 4, 4) world-from-object of the carousel's rings, turned by `angle` (rad)."""
    matrices = []
    for level in range(3):
        for arm in range(8):
            turn = angle + (arm + 0.5 * level) * math.tau / 8
            matrix = np.eye(4)
            matrix[:3, :3] = _about_z(turn)
            matrix[:3, 3] = CAROUSEL_CENTER + CAROUSEL_RADIUS * np.array([math.cos(turn), math.sin(turn), 0.0])
            matrix[2, 3] = 0.7 + 1.1 * level
            matrices.append(matrix)
    return np.array(matrices)


def cloth(index: int, phase: float, detail: float = 1.0) -> Mesh:
    """One of the hanging cloths, at `phase` (rad) of the wave that runs down and across it."""
    x, y = CLOTHS[index]
    width, height = CLOTH_SIZE
    count = round(100 * detail)
    down, across = np.meshgrid(np.linspace(0.0, 1.0, count + 1), np.linspace(-0.5, 0.5, count + 1), indexing="ij")
    wave = WAVE_HEIGHT * np.sqrt(down) * np.sin(9.0 * across + 5.0 * down - phase)
    points = np.stack([x + width * across, y + wave, CEILING - 1.0 - height * down], axis=-1)
    return _lattice(f"cloth {index}", points)


def _columns_along_x() -> Float64Array:
    return np.arange(LEFT + 0.5 * COLUMN_SPACING, RIGHT, COLUMN_SPACING)


def _plants() -> list[tuple[float, float, float]]:
    """Where the pots stand: between the columns of the first two rows."""
    middles = _columns_along_x()[:-1] + 0.5 * COLUMN_SPACING
    return [(x + 0.2 * row, y, 0.0) for row, y in enumerate(COLUMN_ROWS[:2]) for x in middles]


def _walls() -> Mesh:
    """Floor, ceiling and back wall, facing inwards."""
    front = -8.0
    floor = [[(LEFT, front, 0), (LEFT, BACK, 0)], [(RIGHT, front, 0), (RIGHT, BACK, 0)]]
    ceiling = [[(RIGHT, front, CEILING), (RIGHT, BACK, CEILING)], [(LEFT, front, CEILING), (LEFT, BACK, CEILING)]]
    back = [[(LEFT, BACK, 0), (LEFT, BACK, CEILING)], [(RIGHT, BACK, 0), (RIGHT, BACK, CEILING)]]
    return _joined("walls", [_lattice("", np.array(points, float)) for points in (floor, ceiling, back)])


def _column(detail: float) -> Mesh:
    """A fluted column on a round base."""
    sides, rings = round(72 * detail), round(14 * detail)
    heights = np.concatenate([[0.0, 0.25, 0.25], np.linspace(0.3, CEILING - 0.3, rings), [CEILING]])
    radii = np.concatenate([[0.42, 0.42, 0.3], np.linspace(0.3, 0.25, rings), [0.42]])
    flutes = np.concatenate([np.zeros(3), np.full(rings, 0.02), [0.0]])
    turn = np.linspace(0.0, math.tau, sides + 1)
    radius = radii[:, None] + flutes[:, None] * np.cos(12 * turn)[None]
    return _lathe("column", radius, heights)


def _pot(detail: float) -> Mesh:
    radii = np.array([0.14, 0.2, 0.22, 0.18])
    return _lathe("pot", np.repeat(radii[:, None], round(24 * detail) + 1, axis=1), np.array([0.0, 0.2, 0.45, 0.45]))


def _torus(detail: float) -> Mesh:
    """A standing ring that faces along its local X."""
    around, along = round(36 * detail) + 1, round(16 * detail) + 1
    large, small = np.meshgrid(np.linspace(0, math.tau, around), np.linspace(0, math.tau, along), indexing="ij")
    radius = 0.35 + 0.12 * np.cos(small)
    return _lattice("torus", np.stack([0.12 * np.sin(small), radius * np.cos(large), radius * np.sin(large)], axis=-1))


def _foliage(detail: float) -> Mesh:
    """Thin bent leaves around the origin, the same every time."""
    random = np.random.default_rng(1)
    along, across = np.meshgrid(np.linspace(0.0, 1.0, 4), [-0.5, 0.5], indexing="ij")
    leaves = []
    for _ in range(round(130 * detail**2)):
        turn, rise, length = random.uniform(0.0, math.tau), random.uniform(0.3, 1.5), random.uniform(0.4, 1.1)
        out = length * along * math.cos(rise) + 0.1 * along**2
        up = length * along * math.sin(rise) - 0.25 * along**2
        points = np.stack([out, 0.09 * across, up], axis=-1) @ _about_z(turn).T
        leaves.append(_lattice("", points, np.stack([across + 0.5, along], axis=-1)))
    return _joined("foliage", leaves)


def _leaf_material() -> Material:
    return Material(
        "leaf",
        "leaf",
        new_version(),
        source=BaseColorSource.TEXTURE,
        texture=ImageTexture("leaf"),
        texture_alpha=True,
    )


def _leaf_image() -> Image:
    """A pointed leaf with holes between its veins."""
    v, u = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(32) + 0.5) / 32, indexing="ij")
    across = np.abs(2.0 * u - 1.0)
    shape = across < np.sqrt(np.sin(math.pi * v))
    veins = (across < 0.15) | (np.modf(6.0 * v - across)[0] % 1.0 < 0.6)
    pixels = np.full((64, 32, 4), (60, 140, 40, 0), np.uint8)
    pixels[..., 3] = np.where(shape & veins, 255, 0)
    return Image("leaf", "leaf", new_version(), pixels, srgb=True)


def _lathe(key: str, radii: Float64Array, heights: Float64Array) -> Mesh:
    """A surface of revolution about Z: `radii` (rings, sides + 1) at `heights` (rings,)."""
    turn = np.linspace(0.0, math.tau, radii.shape[1])
    tall = np.broadcast_to(heights[:, None], radii.shape)
    return _lattice(key, np.stack([radii * np.cos(turn), radii * np.sin(turn), tall], axis=-1).swapaxes(0, 1))


def _lattice(key: str, points: Float64Array, uvs: Float64Array | None = None) -> Mesh:
    """A mesh over `points` (rows, columns, 3), its front where row × column points; smooth normals."""
    rows, columns, _ = points.shape
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    right, below = corner + columns, corner + 1
    triangles = np.stack([corner, right, right + 1, corner, right + 1, below], axis=-1).reshape(-1, 3)
    positions = points.reshape(-1, 3)
    a, b, c = (positions[triangles[:, index]] for index in range(3))
    normals = np.zeros_like(positions)
    for index in range(3):
        np.add.at(normals, triangles[:, index], np.cross(b - a, c - a))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    return Mesh(
        key,
        key,
        new_version(),
        positions.astype(np.float32),
        normals.astype(np.float32),
        triangles.astype(np.uint32),
        (SlotRange(0, 0, len(triangles)),),
        None if uvs is None else uvs.reshape(-1, 2).astype(np.float32),
    )


def _joined(key: str, parts: list[Mesh]) -> Mesh:
    """All parts as one mesh."""
    starts = np.cumsum([0, *(len(part.positions) for part in parts[:-1])])
    triangles = np.concatenate([part.triangles + np.uint32(at) for part, at in zip(parts, starts, strict=True)])
    uvs = [part.uvs for part in parts if part.uvs is not None]
    return replace(
        parts[0],
        key=key,
        name=key,
        positions=np.concatenate([part.positions for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        triangles=triangles,
        slots=(SlotRange(0, 0, len(triangles)),),
        uvs=np.concatenate(uvs) if uvs else None,
    )


def _batch(mesh: str, matrices: Float64Array, material: str) -> InstanceBatch:
    count = len(matrices)
    numbers = np.arange(count, dtype=np.int64)
    return InstanceBatch(mesh, mesh, (material,), new_version(), matrices, np.zeros(count, np.int32), numbers)


def _at(places: list[tuple[float, float, float]]) -> Float64Array:
    """(N, 4, 4) translations."""
    matrices = np.tile(np.eye(4), (len(places), 1, 1))
    matrices[:, :3, 3] = places
    return matrices


def _about_z(angle: float) -> Float64Array:
    """(3, 3) rotation."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
