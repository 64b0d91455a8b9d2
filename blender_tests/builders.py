# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes made of arrays, for tests that need no Blender."""

from dataclasses import replace

import numpy as np

from addon.scene import Camera, Image, InstanceBatch, Light, LightKind, Material, Mesh, Scene, SlotRange, World

DIFFUSE = Material("white", "white", 1, base_color=(0.5, 0.5, 0.5), specular=0.0)

_BOX_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
_BOX_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]], np.uint32)
_BOX_TRIANGLES = np.concatenate([_BOX_QUADS[:, [0, 1, 2]], _BOX_QUADS[:, [0, 2, 3]]])


def mesh(key, positions, triangles, normals=None, uvs=None, colors=None, slots=None):
    """A mesh from lists; normals default to the first triangle's."""
    positions = np.asarray(positions, np.float32).reshape(-1, 3)
    triangles = np.asarray(triangles, np.uint32).reshape(-1, 3)
    if normals is None:
        a, b, c = positions[triangles[0]].astype(np.float64)
        normal = np.cross(b - a, c - a)
        normals = np.tile(normal / max(np.linalg.norm(normal), 1e-30), (len(positions), 1))
    return Mesh(
        key,
        key,
        1,
        positions,
        np.asarray(normals, np.float32),
        triangles,
        slots or (SlotRange(0, 0, len(triangles)),),
        None if uvs is None else np.asarray(uvs, np.float32),
        None if colors is None else np.asarray(colors, np.float32),
    )


def quad(key, z=0.0, half=1.0, center=(0.0, 0.0), **arguments):
    """A square in a plane of constant z that faces +Z, with UVs 0…1."""
    x, y = center
    corners = [(x - half, y - half, z), (x + half, y - half, z), (x + half, y + half, z), (x - half, y + half, z)]
    arguments.setdefault("uvs", [(0, 0), (1, 0), (1, 1), (0, 1)])
    return mesh(key, corners, [(0, 1, 2), (0, 2, 3)], **arguments)


def box(key, half=1.0, **arguments):
    """A closed box about the origin whose faces look outwards; without vertex normals."""
    arguments.setdefault("normals", np.zeros((8, 3)))
    return mesh(key, _BOX_CORNERS * np.float32(half), _BOX_TRIANGLES, **arguments)


def translation(x=0.0, y=0.0, z=0.0):
    """A translation matrix."""
    matrix = np.eye(4)
    matrix[:3, 3] = (x, y, z)
    return matrix


def batch(mesh_key, matrices=None, materials=("white",), key=None, object_index=0):
    """Instances of a mesh; one at the origin by default."""
    matrices = np.eye(4)[None] if matrices is None else np.asarray(matrices, np.float64).reshape(-1, 4, 4)
    indices = np.full(len(matrices), object_index, np.int32)
    ids = np.arange(len(matrices), dtype=np.int64)
    return InstanceBatch(key or mesh_key, mesh_key, tuple(materials), 1, matrices, indices, ids)


def scene(*meshes, materials=(DIFFUSE,), lights=(), world=(0.0, 0.0, 0.0), batches=None, images=()):
    """A scene with each mesh placed once, unless batches are given."""
    return Scene(
        meshes={item.key: item for item in meshes},
        materials={item.key: item for item in materials},
        images={item.key: item for item in images},
        batches=tuple(batches if batches is not None else (batch(item.key) for item in meshes)),
        lights=tuple(lights),
        world=World(world),
    )


def camera(z=3.0, half_width=1.0, clip_start=0.1, clip_end=1000.0, orthographic=False):
    """A camera on +Z looking at the origin; `half_width` of the window at depth 1 (orthographic: in m)."""
    window = (-half_width, half_width, -half_width, half_width)
    return Camera(translation(z=z), window, clip_start, clip_end, orthographic)


def light(kind=LightKind.POINT, position=(0.0, 0.0, 2.0), emission=(10.0, 10.0, 10.0), **arguments):
    """A light that shines towards −Z."""
    return Light(f"{kind}{position}", "light", kind, translation(*position), emission, **arguments)


def material(key="white", **arguments):
    """A purely diffuse material with some properties changed."""
    return replace(DIFFUSE, key=key, name=key, **arguments)


def pierced(generator, key="pierced", size=4):
    """An image of opaque and wholly transparent texels of random colours."""
    pixels = generator.integers(0, 256, (size, size, 4)).astype(np.uint8)
    pixels[..., 3] = np.where(generator.random((size, size)) < 0.5, 0, 255)
    return Image(key, key, 1, pixels, srgb=True)
