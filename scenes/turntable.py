# SPDX-License-Identifier: GPL-3.0-or-later
"""Twenty-four frames in which everything moves: the camera, rigid objects, shape keys and a skinned mesh.

A clockwork toy on a round table: two counter-rotating rings of beads and blocks, a rubber drop that squashes and
stretches as it hops, and a striped stalk that sways on three bones.
"""

import math

import bpy
from _builder import Color, area_light, box, camera, lathe, link, material, mesh_object, new_scene, save, subdivide, sun

FRAMES = 24
CENTER_HEIGHT = 0.55


def at_every_frame(item: bpy.types.ID, path: str, values: list[float], index: int = -1) -> None:
    """Key a property at frames 1 … 24."""
    for frame, value in enumerate(values, start=1):
        if index < 0:
            setattr(item, path, value)
        else:
            getattr(item, path)[index] = value
        item.keyframe_insert(path, index=index, frame=frame)


def phases() -> list[float]:
    """One turn over the frames, in radians; frame 25 would be frame 1 again."""
    return [math.tau * step / FRAMES for step in range(FRAMES)]


def pivot(name: str, turns: float) -> bpy.types.Object:
    """An empty at the centre that turns about z by `turns` over the animation."""
    result = bpy.data.objects.new(name, None)
    link(result)
    at_every_frame(result, "rotation_euler", [turns * phase for phase in phases()], index=2)
    return result


def sphere_profile(radius: float, rings: int) -> list[tuple[float, float]]:
    """Profile points of a sphere about the origin, without its poles."""
    angles = [math.pi * ring / rings for ring in range(1, rings)]
    return [(radius * math.sin(angle), -radius * math.cos(angle)) for angle in angles]


def ring_of_beads(colors: list[bpy.types.Material], parent: bpy.types.Object) -> None:
    """Twelve spheres on a circle, each of them a linked copy of one of three meshes."""
    originals = [
        lathe(f"Bead {index}", sphere_profile(0.17, 12), color, segments=24, subdivisions=1)
        for index, color in enumerate(colors)
    ]
    for step in range(12):
        original = originals[step % len(originals)]
        bead = original if step < len(originals) else original.copy()
        if bead is not original:
            link(bead)
        angle = math.tau * step / 12
        bead.location = (1.55 * math.cos(angle), 1.55 * math.sin(angle), CENTER_HEIGHT + 0.17)
        bead.parent = parent


def ring_of_blocks(colors: list[bpy.types.Material], parent: bpy.types.Object) -> None:
    """Eight bevelled blocks on a wider circle that tumble while they travel."""
    for step in range(8):
        item = box(f"Block {step}", (-0.2, -0.2, -0.2), (0.2, 0.2, 0.2), colors[step % len(colors)], bevel=0.04)
        angle = math.tau * step / 8
        item.location = (2.45 * math.cos(angle), 2.45 * math.sin(angle), CENTER_HEIGHT + 0.36)
        item.parent = parent
        at_every_frame(item, "rotation_euler", [phase + angle for phase in phases()], index=0)
        at_every_frame(item, "rotation_euler", [0.5 * math.sin(phase + angle) for phase in phases()], index=1)


def hopping_drop(color: bpy.types.Material) -> None:
    """A rubber ball with shape keys for squash and stretch, hopping twice around the stalk."""
    drop = lathe("Drop", [(radius, height + 0.32) for radius, height in sphere_profile(0.32, 16)], color, segments=32)
    drop.shape_key_add(name="Basis", from_mix=False)
    for name, tall, wide in (("Squash", 0.55, 1.35), ("Stretch", 1.4, 0.84)):
        key = drop.shape_key_add(name=name, from_mix=False)
        for point in key.data:
            point.co = (point.co.x * wide, point.co.y * wide, point.co.z * tall)
    subdivide(drop, 1)
    keys = drop.data.shape_keys.key_blocks
    heights = [abs(math.sin(phase)) for phase in phases()]
    at_every_frame(keys["Squash"], "value", [max(0.0, 1.0 - 3.0 * height) for height in heights])
    at_every_frame(keys["Stretch"], "value", [max(0.0, math.sin(math.pi * height)) * 0.7 for height in heights])
    at_every_frame(drop, "location", [0.85 * math.cos(phase + 0.6) for phase in phases()], index=0)
    at_every_frame(drop, "location", [0.85 * math.sin(phase + 0.6) for phase in phases()], index=1)
    at_every_frame(drop, "location", [CENTER_HEIGHT + 0.9 * height for height in heights], index=2)


def skeleton(height: float) -> bpy.types.Object:
    """An armature of three bones, one above the other, that sway with a lag."""
    armature = bpy.data.objects.new("Stalk bones", bpy.data.armatures.new("Stalk bones"))
    link(armature)
    armature.location = (0.0, 0.0, CENTER_HEIGHT)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    parent = None
    for index in range(3):
        bone = armature.data.edit_bones.new(f"Bone {index}")
        bone.head = (0.0, 0.0, height * index / 3)
        bone.tail = (0.0, 0.0, height * (index + 1) / 3)
        bone.parent, bone.use_connect = parent, parent is not None
        parent = bone
    bpy.ops.object.mode_set(mode="OBJECT")
    for index in range(3):
        bone = armature.pose.bones[f"Bone {index}"]
        bone.rotation_mode = "XYZ"
        at_every_frame(bone, "rotation_euler", [0.42 * math.sin(phase - 0.8 * index) for phase in phases()], index=0)
        at_every_frame(bone, "rotation_euler", [0.28 * math.cos(phase - 0.8 * index) for phase in phases()], index=2)
    return armature


def stalk(light: bpy.types.Material, dark: bpy.types.Material, bulb: bpy.types.Material) -> None:
    """A tapering striped tube with a bulb on top, skinned to the skeleton with smooth weights."""
    height, rings, around = 2.4, 30, 24
    vertices = []
    for ring in range(rings + 1):
        share = ring / rings
        radius = 0.26 - 0.15 * share
        vertices += [
            (radius * math.cos(angle), radius * math.sin(angle), height * share)
            for angle in (math.tau * step / around for step in range(around))
        ]
    faces, slots = [], []
    for ring in range(rings):
        for step in range(around):
            turn = (step + 1) % around
            low, high = ring * around, (ring + 1) * around
            faces.append((low + step, low + turn, high + turn, high + step))
            slots.append(ring // 3 % 2)
    tube = mesh_object("Stalk", vertices, faces, [light, dark], smooth_below=180.0)
    tube.data.polygons.foreach_set("material_index", slots)
    armature = skeleton(height)
    tip = lathe("Bulb", [(r, z + height + 0.14) for r, z in sphere_profile(0.24, 14)], bulb, segments=28)
    for item in (tube, tip):
        for index in range(3):
            group = item.vertex_groups.new(name=f"Bone {index}")
            center = (index + 0.5) / 3
            for vertex in item.data.vertices:
                share = min(vertex.co.z / height, 1.0)
                reach = share if index == 2 and share > center else abs(share - center)
                weight = 1.0 if index == 2 and share > center else max(0.0, 1.0 - 3.0 * reach)
                weight = 1.0 if index == 0 and share < center else weight
                if weight > 0.0:
                    group.add([vertex.index], weight, "REPLACE")
        item.parent = armature
        item.modifiers.new("Armature", "ARMATURE").object = armature


def table(wood: bpy.types.Material, brass: bpy.types.Material, ground: Color) -> None:
    """The round table with a brass rim, on a floor that ends far outside the picture."""
    profile = [(2.7, 0.0), (2.9, 0.04), (3.0, 0.14), (3.0, 0.40), (2.96, 0.50), (2.85, CENTER_HEIGHT)]
    lathe("Table", profile, wood, segments=96)
    lathe("Rim", [(3.0, 0.22), (3.05, 0.24), (3.06, 0.28), (3.05, 0.32), (3.0, 0.34)], brass, segments=96)
    mesh_object(
        "Floor",
        [(-60.0, -60.0, 0.0), (60.0, -60.0, 0.0), (60.0, 60.0, 0.0), (-60.0, 60.0, 0.0)],
        [(0, 1, 2, 3)],
        [material("Floor", ground, roughness=0.6)],
    )


def main() -> None:
    """Build and save the scene."""
    scene = new_scene((0.80, 0.88, 1.0), 0.45)
    scene.frame_start, scene.frame_end = 1, FRAMES
    scene.render.fps = FRAMES
    coral = material("Coral", (0.80, 0.17, 0.11), roughness=0.35)
    teal = material("Teal", (0.03, 0.33, 0.36), roughness=0.30)
    amber = material("Amber", (0.86, 0.46, 0.06), roughness=0.25)
    cream = material("Cream", (0.84, 0.78, 0.66), roughness=0.5)
    steel = material("Steel", (0.62, 0.64, 0.67), roughness=0.22, metallic=1.0)
    brass = material("Brass", (0.82, 0.58, 0.24), roughness=0.25, metallic=1.0)
    walnut = material("Walnut", (0.16, 0.075, 0.038), roughness=0.4)
    lamp = material("Lamp", (1.0, 0.72, 0.34), roughness=0.4, emission=2.5)

    table(walnut, brass, (0.50, 0.56, 0.60))
    ring_of_beads([amber, steel, teal], pivot("Inner ring", -1.0 / 3.0))
    ring_of_blocks([coral, cream], pivot("Outer ring", 1.0 / 4.0))
    hopping_drop(coral)
    stalk(cream, teal, lamp)

    sun((-0.45, 0.55, -0.75), 3.2, (1.0, 0.93, 0.82), 1.0)
    area_light("Fill", (-5.0, -4.0, 5.0), (5.0, 4.0, -4.2), (3.0, 3.0), 350.0, (0.72, 0.84, 1.0))

    arm = bpy.data.objects.new("Camera arm", None)
    link(arm)
    view = camera((0.0, -8.6, 4.3), (0.0, 0.0, 1.05), lens=37.0)
    view.parent = arm
    at_every_frame(arm, "rotation_euler", [0.9 * math.sin(phase) for phase in phases()], index=2)
    at_every_frame(view, "location", [-8.2 - 0.8 * math.cos(phase) for phase in phases()], index=1)
    scene.frame_set(1)
    save(__file__)


if __name__ == "__main__":
    main()
