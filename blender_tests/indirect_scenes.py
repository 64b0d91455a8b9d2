# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes whose indirect light is known or bounded, and how their pictures are taken and read."""

from dataclasses import replace

import numpy as np

from addon.scene import Camera, Channel, EmissionSampling, IndirectMethod, IndirectSettings
from addon.scene.versions import new_version
from blender_tests import builders

GRID = IndirectSettings(IndirectMethod.MARCH_GRID)
"""The method that the project is about, with the numbers that it has by default."""

UNFILTERED = replace(GRID, divisor=1, spatial_filter=False, temporal_filter=False)
"""The same without what makes light of several pixels one."""

SIZE = 48
"""Pixels a side."""


def looking(position, target, half_width=1.0, roll=0.0, clip_end=1000.0):
    """A camera at a place (3,), which looks at another and is rolled (rad) about its axis; `half_width` at depth 1."""
    position, target = np.asarray(position, np.float64), np.asarray(target, np.float64)
    z = (position - target) / np.linalg.norm(position - target)
    x = np.cross((0.0, 0.0, 1.0) if abs(z[2]) < 0.9 else (0.0, 1.0, 0.0), z)
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    cosine, sine = np.cos(roll), np.sin(roll)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=1)
    matrix[:3, 3] = position
    window = (-half_width, half_width, -half_width, half_width)
    return Camera(matrix, window, 1e-3 * np.linalg.norm(position - target), clip_end)


def rectangle(key, center, half_x, half_y):
    """A rectangle that faces along half_x × half_y, each (3,)."""
    center, x, y = (np.asarray(item, np.float64) for item in (center, half_x, half_y))
    corners = [center - x - y, center + x - y, center + x + y, center - x + y]
    return builders.mesh(key, corners, [(0, 1, 2), (0, 2, 3)])


def sphere(key, radius=1.0, center=(0.0, 0.0, 0.0), segments=64, *, inwards=False):
    """A smooth sphere of `segments` by half as many quads, as large as the round one in the mean of its radii."""
    azimuth = 2.0 * np.pi * np.arange(segments) / segments
    polar = np.pi * np.arange(segments // 2 + 1) / (segments // 2)
    around, down = np.meshgrid(azimuth, polar)
    normals = np.stack([np.sin(down) * np.cos(around), np.sin(down) * np.sin(around), np.cos(down)], axis=-1)
    ring, column = np.meshgrid(np.arange(segments // 2), np.arange(segments), indexing="ij")
    after = (column + 1) % segments
    upper, lower = ring * segments, (ring + 1) * segments
    first = np.stack([upper + column, lower + column, lower + after], axis=-1)[:-1]  # without area at the lower pole
    second = np.stack([upper + column, lower + after, upper + after], axis=-1)[1:]  # and at the upper one
    triangles = np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])
    normals = normals.reshape(-1, 3)
    inscribed = np.cos(np.pi / segments)  # from the middle of a chord to its ends
    positions = normals * (radius * 2.0 / (1.0 + inscribed)) + np.asarray(center)
    if inwards:
        triangles, normals = triangles[:, ::-1], -normals
    return builders.mesh(key, positions, triangles, normals=normals)


def glowing(key="glow", emission=1.0, albedo=0.0, sampling=EmissionSampling.NONE):
    """A diffuse material that shines, and of which `direct` does not know unless it is told to sample it."""
    emission = tuple(np.broadcast_to(emission, 3).tolist())
    return builders.material(key, base_color=(albedo,) * 3, emission=emission, emission_sampling=sampling)


def of(*parts, lights=(), world=(0.0, 0.0, 0.0)):
    """A scene of (mesh, material) pairs, of which the first has object index 1; each material comes once."""
    return beside(builders.scene(materials=(), lights=lights, world=world), *parts)


def beside(scene, *parts, matrices=None):
    """The scene with more (mesh, material) pairs in it, each at all `matrices`. Everything new has a new version."""
    meshes = {mesh.key: replace(mesh, version=new_version()) for mesh, _ in parts}
    materials = {material.key: replace(material, version=new_version()) for _, material in parts}
    batches = list(scene.batches)
    for mesh, material in parts:
        batch = builders.batch(mesh.key, matrices, (material.key,), object_index=len(batches) + 1)
        batches.append(replace(batch, version=new_version()))
    return replace(
        scene,
        meshes={**scene.meshes, **meshes},
        materials={**scene.materials, **materials},
        batches=tuple(batches),
    )


def cornell(lamp=None, *, albedo=0.5, emission=5.0, sampling=EmissionSampling.NONE, height=0.6):
    """A room of 2 m that is open towards −Y, with a block and, without a `lamp`, a panel below its ceiling that shines.

    `height` (m) of the panel over the room's middle; the ceiling's is 1.
    """
    white = builders.material(base_color=(albedo,) * 3)
    red = builders.material("red", base_color=(albedo, 0.1 * albedo, 0.1 * albedo))
    green = builders.material("green", base_color=(0.1 * albedo, albedo, 0.1 * albedo))
    parts = [
        (rectangle("floor", (0, 0, -1), (1, 0, 0), (0, 1, 0)), white),
        (rectangle("ceiling", (0, 0, 1), (1, 0, 0), (0, -1, 0)), white),
        (rectangle("back", (0, 1, 0), (1, 0, 0), (0, 0, -1)), white),
        (rectangle("left", (-1, 0, 0), (0, 1, 0), (0, 0, 1)), red),
        (rectangle("right", (1, 0, 0), (0, -1, 0), (0, 0, 1)), green),
        (block("block", (0.3, 0.3, -0.6), 0.4), white),
    ]
    if lamp is None:
        panel = rectangle("panel", (0, 0, height), (0.4, 0, 0), (0, -0.4, 0))
        parts.append((panel, glowing(emission=emission, sampling=sampling)))
    return of(*parts, lights=() if lamp is None else (lamp,))


CORNELL_CAMERA = looking((0.0, -3.6, 0.0), (0.0, 0.0, 0.0), half_width=0.38)


def block(key, center, half):
    """A closed cube at a place (3,)."""
    mesh = builders.box(key, half=half)
    return replace(mesh, positions=(mesh.positions + np.asarray(center, np.float32)).astype(np.float32))


def wall(key, thickness, half=1.0):
    """A square wall across the X axis at the origin, m; without thickness a sheet."""
    if not thickness:
        return rectangle(key, (0, 0, 0), (0, half, 0), (0, 0, half))
    mesh = builders.box(key, half=1.0)
    return replace(mesh, positions=mesh.positions * np.float32([0.5 * thickness, half, half]))


def placed(scene, matrix):
    """A scene whose meshes and lights are moved by a rigid or evenly scaling matrix (4, 4); lights keep their power."""
    batches = tuple(replace(batch, matrices=matrix @ batch.matrices, version=new_version()) for batch in scene.batches)
    lights = tuple(replace(light, world_from_light=_rigid(matrix @ light.world_from_light)) for light in scene.lights)
    return replace(scene, batches=batches, lights=lights)


def _rigid(matrix):
    """The matrix (4, 4) without its scale."""
    matrix = matrix.copy()
    matrix[:3, :3] /= np.cbrt(np.linalg.det(matrix[:3, :3]))
    return matrix


def seen_from(camera, matrix):
    """A camera that is moved along; what scales the scene scales its clipping."""
    factor = np.cbrt(np.linalg.det(matrix[:3, :3]))
    return replace(
        camera,
        world_from_camera=_rigid(matrix @ camera.world_from_camera),
        clip_start=camera.clip_start * factor,
        clip_end=camera.clip_end * factor,
    )


def radiance(session, scene, camera, indirect=GRID, *, samples=8, size=SIZE, sequence=None, **settings):
    """What a view shows (size, size, 3) float64."""
    view = session.show(
        scene, camera, sequence, width=size, height=size, samples=samples, indirect=indirect, **settings
    )
    return view.channels[Channel.COMBINED][..., :3].astype(np.float64)


def seen(session, scene, camera, indirect=UNFILTERED, *, samples=8, size=SIZE, **settings):
    """(radiance (size, size, 3) that the indirect method finds, world positions (size, size, 3), object indices)."""
    channels = {Channel.POSITION, Channel.OBJECT_INDEX, Channel.DIFFUSE_INDIRECT}
    view = session.show(
        scene, camera, width=size, height=size, samples=samples, indirect=indirect, channels=channels, **settings
    )
    found = view.channels
    return (
        found[Channel.DIFFUSE_INDIRECT][..., :3].astype(np.float64),
        found[Channel.POSITION].astype(np.float64)[..., :3],
        found[Channel.OBJECT_INDEX][..., 0],
    )


def relative_difference(one, other):
    """Σ|a − b| / Σ b: by how much of its light a picture differs from another."""
    return float(np.abs(one - other).sum() / np.abs(other).sum())
