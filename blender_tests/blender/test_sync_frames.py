# SPDX-License-Identifier: GPL-3.0-or-later
"""Other frames than the one Blender renders, mirrored inside a render engine's `render()` through its `frame_set`."""

from collections.abc import Iterator

import bpy
import numpy as np
import pytest
from sync_scenes import instance_on_grid, link, make_object, modify_with_nodes

from addon.scene import Scene
from addon.scene.correspondence import Correspondence
from addon.sync import Mirror


class FrameWalker(bpy.types.RenderEngine):
    """Mirrors the frames `offsets` away from the one to render, in that order, and renders nothing."""

    bl_idname = "TEST_FRAME_WALKER"
    bl_label = "Frame Walker"
    offsets: tuple[int, ...] = ()
    scenes: tuple[Scene, ...] = ()
    frame_after: int | None = None

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        mirror, frame = Mirror(), depsgraph.scene.frame_current
        mirrored = []
        for offset in FrameWalker.offsets:
            self.frame_set(frame + offset, 0.0)
            mirrored.append(mirror.sync(depsgraph).scene)
        FrameWalker.scenes, FrameWalker.frame_after = tuple(mirrored), depsgraph.scene.frame_current


@pytest.fixture(name="walker", autouse=True, scope="module")
def walker_fixture() -> Iterator[None]:
    """The engine, registered."""
    bpy.utils.register_class(FrameWalker)
    yield
    bpy.utils.unregister_class(FrameWalker)


def walk(frame: int, *offsets: int) -> tuple[Scene, ...]:
    """Render `frame` of the current scene; the scene at each of the offsets."""
    scene = bpy.context.scene
    scene.render.engine = FrameWalker.bl_idname
    scene.render.resolution_x, scene.render.resolution_y = 8, 8
    scene.frame_set(frame)
    FrameWalker.offsets, FrameWalker.scenes, FrameWalker.frame_after = offsets, (), None
    assert bpy.ops.render.render() == {"FINISHED"}
    assert FrameWalker.frame_after == frame + (offsets[-1] if offsets else 0)
    return FrameWalker.scenes


def add_camera() -> bpy.types.Object:
    camera = link("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.camera = camera
    return camera


def animate(thing: bpy.types.ID, path: str, *keys: tuple[float, object]) -> None:
    """Set and key a property at frames."""
    for frame, value in keys:
        setattr(thing, path, value)
        thing.keyframe_insert(path, frame=frame)


def assert_same_frame(first: Scene, second: Scene) -> None:
    """Two mirrors saw the same: all but versions and identity."""
    assert list(first.meshes) == list(second.meshes)
    assert [batch.key for batch in first.batches] == [batch.key for batch in second.batches]
    for key, mesh in first.meshes.items():
        np.testing.assert_array_equal(mesh.positions, second.meshes[key].positions)
        np.testing.assert_array_equal(mesh.triangles, second.meshes[key].triangles)
    for mine, theirs in zip(first.batches, second.batches, strict=True):
        np.testing.assert_array_equal(mine.matrices, theirs.matrices)
        np.testing.assert_array_equal(mine.ids, theirs.ids)
    np.testing.assert_array_equal(first.camera.world_from_camera, second.camera.world_from_camera)
    assert first.camera.window == second.camera.window


def assert_walks_right(frame: int) -> tuple[Scene, Scene]:
    """The frame and the one before it are what they are when each is rendered alone; returns (before, now)."""
    before, now = walk(frame, -1, 0)
    (alone,), (alone_before,) = walk(frame, 0), walk(frame - 1, 0)
    assert_same_frame(before, alone_before)
    assert_same_frame(now, alone)
    return before, now


def test_objects_cameras_and_shape_keys_follow(empty_scene):
    thing, camera = make_object("Thing"), add_camera()
    make_object("Still")
    animate(thing, "location", (1, (0.0, 0.0, 0.0)), (11, (10.0, 0.0, 0.0)))
    animate(camera, "location", (1, (0.0, 0.0, 5.0)), (11, (0.0, 0.0, 9.0)))
    bent = make_object("Bent")
    bent.shape_key_add(name="Basis")
    key = bent.shape_key_add(name="Tall")
    key.data[3].co.z = 3.0
    animate(key, "value", (1, 0.0), (11, 1.0))
    before, now = assert_walks_right(6)
    correspondence = Correspondence(before)
    moved = {now.meshes[b.mesh].name: correspondence.matrices(b) is not b.matrices for b in now.batches}
    deformed = {mesh.name: correspondence.positions(mesh) is not mesh.positions for mesh in now.meshes.values()}
    assert moved == {"Thing": True, "Still": False, "Bent": False}
    assert deformed == {"Thing": False, "Still": False, "Bent": True}
    assert before.camera.position[2] < now.camera.position[2]
    (place,) = (batch for batch in now.batches if now.meshes[batch.mesh].name == "Thing")
    empty_scene.frame_set(5)
    np.testing.assert_array_equal(correspondence.matrices(place)[0, :3, 3], tuple(thing.matrix_world.translation))


def test_the_frame_comes_back_whatever_was_looked_at_before(empty_scene):
    animate(make_object(), "location", (1, (0.0, 0.0, 0.0)), (11, (10.0, 0.0, 0.0)))
    add_camera()
    first, _, _, last = walk(6, 0, -2, -1, 0)
    assert_same_frame(first, last)
    assert first.meshes.keys() == last.meshes.keys()
    assert all(last.meshes[key] is mesh for key, mesh in first.meshes.items())


def add_growing_grid() -> bpy.types.Object:
    """Instances of a cube on a grid whose side grows by one each frame and that rises."""

    def build(nodes, links):
        return nodes.new("GeometryNodeMeshCube").outputs[0]

    scatter = instance_on_grid(3, build)
    nodes = scatter.modifiers[0].node_group.nodes
    grid = next(node for node in nodes if node.bl_idname == "GeometryNodeMeshGrid")
    for name in ("Vertices X", "Vertices Y"):
        socket = grid.inputs[name]
        for frame in (1, 11):
            socket.default_value = 2 + frame
            socket.keyframe_insert("default_value", frame=frame)
    animate(scatter, "location", (1, (0.0, 0.0, 0.0)), (11, (0.0, 0.0, 10.0)))
    return scatter


def test_geometry_nodes_instances_follow_and_keep_their_ids(empty_scene):
    add_growing_grid()
    add_camera()
    before, now = assert_walks_right(4)
    (was,), (batch,) = before.batches, now.batches
    assert (was.count, batch.count) == (25, 36)
    assert (was.key, was.mesh) == (batch.key, batch.mesh)
    assert len(set(batch.ids.tolist())) == 36
    assert set(was.ids.tolist()) < set(batch.ids.tolist())
    matrices = Correspondence(before).matrices(batch)
    known = np.isin(batch.ids, was.ids)
    assert len(set(matrices[known, 2, 3])) == 1
    assert (matrices[known, 2, 3] < batch.matrices[known, 2, 3]).all()
    np.testing.assert_array_equal(matrices[~known], batch.matrices[~known])


def test_geometry_that_nodes_deform_follows(empty_scene):
    tree = modify_with_nodes(make_object())
    move, time = tree.nodes.new("GeometryNodeSetPosition"), tree.nodes.new("GeometryNodeInputSceneTime")
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(start.outputs[0], move.inputs["Geometry"])
    tree.links.new(time.outputs["Frame"], move.inputs["Offset"])
    tree.links.new(move.outputs[0], end.inputs[0])
    add_camera()
    before, now = assert_walks_right(6)
    (mesh,) = now.meshes.values()
    np.testing.assert_allclose(mesh.positions - Correspondence(before).positions(mesh), 1.0, atol=1e-6)


def test_a_skinned_character_follows(shared_scenes):
    file = shared_scenes / "robot_expressive" / "robot_dance.blend"
    if not file.is_file():
        pytest.skip("the robot is not among the shared scenes")
    bpy.ops.wm.open_mainfile(filepath=str(file))
    before, now = assert_walks_right(20)
    correspondence = Correspondence(before)
    assert {mesh.key for mesh in now.meshes.values()} == before.meshes.keys()
    moved = [batch for batch in now.batches if correspondence.matrices(batch) is not batch.matrices]
    deformed = [mesh for mesh in now.meshes.values() if correspondence.positions(mesh) is not mesh.positions]
    changed = [mesh for key, mesh in now.meshes.items() if mesh is not before.meshes[key]]
    assert moved
    assert deformed == changed  # whatever bends has its counterpart, triangles without area or not
    assert deformed
