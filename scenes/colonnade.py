# SPDX-License-Identifier: GPL-3.0-or-later
"""A sunlit colonnade: well over a million triangles drawn from a small file, through every kind of instance.

Columns, urns and shrubs are collection instances of subdivided meshes; the shrubs' leaves and the petals on the floor
are geometry-nodes instances, the former nested in the collections.
"""

import math

import bpy
from _builder import Profile, box, camera, instance, lathe, material, mesh_object, new_scene, save, subdivide, sun

SPACING = 2.8
BAYS = 11
AISLE = 3.2
COLUMN_HEIGHT = 5.2
FLUTES = 20

BASE_PROFILE: Profile = [
    *((0.50, 0.16), (0.53, 0.19), (0.54, 0.25), (0.52, 0.30), (0.47, 0.33), (0.44, 0.36)),
    *((0.44, 0.41), (0.47, 0.44), (0.48, 0.48), (0.46, 0.52), (0.42, 0.54)),
]
CAPITAL_PROFILE: Profile = [
    *((0.36, 4.60), (0.39, 4.62), (0.40, 4.66), (0.37, 4.70), (0.36, 4.78), (0.42, 4.86)),
    *((0.50, 4.93), (0.54, 4.97), (0.55, 5.02)),
]
URN_PROFILE: Profile = [
    *((0.26, 0.00), (0.27, 0.05), (0.20, 0.10), (0.10, 0.18), (0.09, 0.24), (0.16, 0.30), (0.34, 0.46)),
    *((0.42, 0.66), (0.43, 0.80), (0.39, 0.90), (0.40, 0.95), (0.47, 0.99), (0.47, 1.03), (0.40, 1.03)),
    *((0.36, 0.98), (0.34, 0.90)),
]


def fluted_shaft(stone: bpy.types.Material, collection: bpy.types.Collection) -> None:
    """A shaft with rounded flutes and a slight swell."""
    around, rings = FLUTES * 4, 9
    vertices = []
    for ring in range(rings):
        share = ring / (rings - 1)
        radius = 0.42 - 0.07 * share**1.7
        depth = 0.035 if 0 < ring < rings - 1 else 0.0
        for step in range(around):
            angle = math.tau * step / around
            groove = 0.5 - 0.5 * math.cos(math.tau * FLUTES * step / around)
            distance = radius - depth * groove
            vertices.append((distance * math.cos(angle), distance * math.sin(angle), 0.54 + 4.06 * share))
    faces = [
        (ring * around + step, ring * around + turn, (ring + 1) * around + turn, (ring + 1) * around + step)
        for ring in range(rings - 1)
        for step, turn in ((step, (step + 1) % around) for step in range(around))
    ]
    shaft = mesh_object("Shaft", vertices, faces, [stone], smooth_below=60.0, collection=collection)
    subdivide(shaft, 2)


def column(stone: bpy.types.Material, trim: bpy.types.Material) -> bpy.types.Collection:
    """A column 5.2 m high, standing on the origin."""
    parts = bpy.data.collections.new("Column")
    box("Plinth", (-0.58, -0.58, 0.0), (0.58, 0.58, 0.16), trim, bevel=0.015, collection=parts)
    lathe("Base", BASE_PROFILE, trim, subdivisions=2, collection=parts)
    fluted_shaft(stone, parts)
    lathe("Capital", CAPITAL_PROFILE, trim, subdivisions=2, collection=parts)
    box("Abacus", (-0.60, -0.60, 5.02), (0.60, 0.60, COLUMN_HEIGHT), trim, bevel=0.015, collection=parts)
    return parts


def leaf(name: str, color: bpy.types.Material) -> bpy.types.Object:
    """A folded leaf, 9 cm long, pointing along +y; linked to no collection, so only its instances are seen."""
    vertices = [(0, 0, 0), (-0.022, 0.035, 0.012), (0, 0.04, 0), (0.022, 0.035, 0.012), (0, 0.09, 0.006)]
    faces = [(0, 2, 1), (0, 3, 2), (1, 2, 4), (2, 3, 4)]
    hidden = bpy.data.collections.new("Scattered")
    return mesh_object(name, vertices, faces, [color], smooth_below=180.0, collection=hidden)


def scatter(target: bpy.types.Object, scattered: bpy.types.Object, density: float, scale: float, seed: int) -> None:
    """Instance an object over a surface, `density` per m², with a geometry-nodes modifier that keeps the surface."""
    group = bpy.data.node_groups.new(f"Scatter on {target.name}", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    kinds = {
        "input": "NodeGroupInput",
        "output": "NodeGroupOutput",
        "points": "GeometryNodeDistributePointsOnFaces",
        "object": "GeometryNodeObjectInfo",
        "turn": "FunctionNodeRandomValue",
        "rotate": "FunctionNodeRotateRotation",
        "size": "FunctionNodeRandomValue",
        "instances": "GeometryNodeInstanceOnPoints",
        "join": "GeometryNodeJoinGeometry",
    }
    nodes = {name: group.nodes.new(kind) for name, kind in kinds.items()}
    nodes["points"].inputs["Density"].default_value = density
    nodes["points"].inputs["Seed"].default_value = seed
    nodes["object"].inputs["Object"].default_value = scattered
    nodes["turn"].data_type = "FLOAT_VECTOR"
    nodes["turn"].inputs[0].default_value = (-0.9, -0.9, 0.0)
    nodes["turn"].inputs[1].default_value = (0.9, 0.9, math.tau)
    nodes["rotate"].rotation_space = "LOCAL"
    nodes["size"].inputs[2].default_value, nodes["size"].inputs[3].default_value = 0.6 * scale, 1.4 * scale
    links = (
        ("input", "Geometry", "points", "Mesh"),
        ("points", "Rotation", "rotate", "Rotation"),
        ("turn", 0, "rotate", "Rotate By"),
        ("points", "Points", "instances", "Points"),
        ("object", "Geometry", "instances", "Instance"),
        ("rotate", "Rotation", "instances", "Rotation"),
        ("size", 1, "instances", "Scale"),
        ("input", "Geometry", "join", "Geometry"),
        ("instances", "Instances", "join", "Geometry"),
        ("join", "Geometry", "output", "Geometry"),
    )
    for source, out, sink, into in links:
        group.links.new(nodes[source].outputs[out], nodes[sink].inputs[into])
    modifier = target.modifiers.new("Scatter", "NODES")
    modifier.node_group = group


def planted_urn(clay: bpy.types.Material, soil: bpy.types.Material, foliage: bpy.types.Object) -> bpy.types.Collection:
    """An urn with a clipped round shrub of 1,400 leaves."""
    parts = bpy.data.collections.new("Planted urn")
    lathe("Urn", URN_PROFILE, clay, segments=40, subdivisions=2, collection=parts)
    radius = 0.46
    ball = [
        (radius * math.sin(math.pi * ring / 12), 1.32 - radius * math.cos(math.pi * ring / 12)) for ring in range(1, 12)
    ]
    crown = lathe("Crown", ball, soil, segments=24, collection=parts)
    scatter(crown, foliage, density=560.0, scale=1.0, seed=3)
    return parts


def floor(light_stone: bpy.types.Material, dark_stone: bpy.types.Material, length: float) -> None:
    """Square tiles laid alternately, one mesh with two material slots."""
    tile = AISLE / 2.0
    columns, rows = range(-4, 4), range(-2, round(length / tile))
    vertices, faces, slots = [], [], []
    for row in rows:
        for step in columns:
            x, y, first = step * tile, row * tile, len(vertices)
            vertices += [(x, y, 0.0), (x + tile, y, 0.0), (x + tile, y + tile, 0.0), (x, y + tile, 0.0)]
            faces.append((first, first + 1, first + 2, first + 3))
            slots.append((row + step) % 2)
    tiles = mesh_object("Floor", vertices, faces, [light_stone, dark_stone])
    tiles.data.polygons.foreach_set("material_index", slots)


def vault(plaster: bpy.types.Material, trim: bpy.types.Material, length: float) -> None:
    """A barrel vault over the aisle with a rib above every column."""
    steps = 32
    arc = [math.pi * step / steps for step in range(steps + 1)]
    spring = COLUMN_HEIGHT + 0.75

    def shell(
        radius: float, start: float, end: float
    ) -> tuple[list[tuple[float, float, float]], list[tuple[int, ...]]]:
        vertices = [
            (radius * math.cos(angle), y, spring + radius * math.sin(angle)) for angle in arc for y in (start, end)
        ]
        faces: list[tuple[int, ...]] = [(2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1) for k in range(steps)]
        return vertices, faces

    mesh_object("Vault", *shell(AISLE - 0.35, -SPACING, length), [plaster], smooth_below=30.0)
    parts = bpy.data.collections.new("Rib")
    inner, inner_faces = shell(AISLE - 0.60, -0.22, 0.22)
    outer, _ = shell(AISLE - 0.30, -0.22, 0.22)
    count = len(inner)
    sides = [
        (2 * k + edge, 2 * k + edge + 2, count + 2 * k + edge + 2, count + 2 * k + edge)[:: 1 if edge else -1]
        for k in range(steps)
        for edge in (0, 1)
    ]
    mesh_object("Rib", inner + outer, inner_faces + sides, [trim], smooth_below=30.0, collection=parts)
    for bay in range(BAYS):
        instance(parts, f"Rib {bay}", (0.0, bay * SPACING, 0.0))


def armillary(bronze: bpy.types.Material, stone: bpy.types.Material, y: float) -> None:
    """A bronze armillary sphere on a pedestal, where the aisle's lines meet."""
    box("Pedestal", (-0.55, y - 0.55, 0.0), (0.55, y + 0.55, 1.1), stone, bevel=0.03)
    box("Pedestal cap", (-0.66, y - 0.66, 1.1), (0.66, y + 0.66, 1.24), stone, bevel=0.03)
    center = 2.2
    for index, (turn, tilt, radius) in enumerate(
        ((0.0, 0.0, 0.86), (0.5, 1.571, 0.82), (2.1, 1.2, 0.78), (0.9, 0.5, 0.74))
    ):
        bpy.ops.mesh.primitive_torus_add(
            major_radius=radius, minor_radius=0.035, major_segments=96, minor_segments=16, location=(0.0, y, center)
        )
        ring = bpy.context.object
        ring.name, ring.rotation_euler = f"Ring {index}", (tilt, 0.0, turn)
        ring.data.shade_smooth()
        ring.data.materials.append(bronze)
    globe = lathe(
        "Globe",
        [(0.3 * math.sin(math.pi * k / 16), -0.3 * math.cos(math.pi * k / 16)) for k in range(1, 16)],
        bronze,
        subdivisions=1,
    )
    globe.location = (0.0, y, center)
    stem = lathe("Stem", [(0.14, 1.24), (0.13, 1.28), (0.05, 1.34), (0.05, 1.42)], bronze, segments=24)
    stem.location = (0.0, y, 0.0)


def main() -> None:
    """Build and save the scene."""
    scene = new_scene((0.36, 0.56, 0.95), 0.4)
    scene.view_settings.exposure = -0.2
    scene.view_settings.look = "AgX - Medium High Contrast"
    limestone = material("Limestone", (0.74, 0.64, 0.50), roughness=0.75)
    marble = material("Marble", (0.82, 0.78, 0.71), roughness=0.35)
    verde = material("Green marble", (0.06, 0.13, 0.10), roughness=0.18)
    travertine = material("Travertine", (0.68, 0.60, 0.49), roughness=0.28)
    plaster = material("Blue plaster", (0.09, 0.19, 0.42), roughness=0.9)
    terracotta = material("Terracotta", (0.56, 0.21, 0.10), roughness=0.6)
    shade = material("Shrub core", (0.015, 0.035, 0.012), roughness=1.0)
    green = material("Leaf", (0.13, 0.27, 0.05), roughness=0.45)
    rose = material("Petal", (0.62, 0.05, 0.08), roughness=0.6)
    bronze = material("Bronze", (0.72, 0.43, 0.18), roughness=0.28, metallic=1.0)
    lawn = material("Lawn", (0.10, 0.19, 0.05), roughness=1.0, specular=0.1)

    length = SPACING * (BAYS + 1)
    columns = column(limestone, marble)
    urns = planted_urn(terracotta, shade, leaf("Leaf", green))
    for bay in range(BAYS):
        for side in (-1.0, 1.0):
            instance(columns, f"Column {bay} {side:+.0f}", (side * AISLE, bay * SPACING, 0.0))
        if bay:
            instance(urns, f"Urn {bay}", (-AISLE, (bay - 0.5) * SPACING, 0.0), turn=0.7 * bay)
    for side, name in ((-1.0, "Left"), (1.0, "Right")):
        low, high = sorted((side * (AISLE - 0.5), side * (AISLE + 0.5)))
        box(
            f"{name} architrave",
            (low, -SPACING, COLUMN_HEIGHT),
            (high, length, COLUMN_HEIGHT + 0.45),
            marble,
            bevel=0.03,
        )
        low, high = sorted((side * (AISLE - 0.62), side * (AISLE + 0.62)))
        box(
            f"{name} cornice",
            (low, -SPACING, COLUMN_HEIGHT + 0.45),
            (high, length, COLUMN_HEIGHT + 0.75),
            marble,
            bevel=0.05,
        )
    wall = -2.0 * AISLE
    box("Back wall", (wall - 0.4, -SPACING, 0.0), (wall, length, COLUMN_HEIGHT + 0.75), limestone)
    box("Ground", (-40.0, -20.0, -0.3), (120.0, 160.0, -0.02), lawn)
    floor(travertine, verde, length)
    vault(plaster, marble, length)
    armillary(bronze, marble, (BAYS - 0.5) * SPACING)

    carpet_y = (-SPACING, length - 2.0)
    vertices = [
        (-0.7, carpet_y[0], 0.006),
        (0.7, carpet_y[0], 0.006),
        (0.7, carpet_y[1], 0.006),
        (-0.7, carpet_y[1], 0.006),
    ]
    runner = mesh_object("Runner", vertices, [(0, 1, 2, 3)], [material("Runner", (0.36, 0.035, 0.04), roughness=0.95)])
    scatter(runner, leaf("Petal", rose), density=18.0, scale=0.8, seed=11)

    sun((-0.62, 0.42, -0.50), 7.0, (1.0, 0.86, 0.66), 0.6)
    camera((1.15, -2.4, 1.62), (-0.35, 14.0, 2.45), lens=24.0)
    save(__file__)


if __name__ == "__main__":
    main()
