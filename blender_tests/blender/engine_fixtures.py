# SPDX-License-Identifier: GPL-3.0-or-later
"""The registered add-on, a small scene, and a way to read Blender's render result."""

import math
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
import pytest

import addon
from addon.engine import final
from addon.engine.viewport_session import ViewportSession
from addon.render import gl_thread
from addon.scene import Camera
from blender_tests import builders

PLANE_DISTANCE = 5.0
OBJECT_INDEX = 7
BASE_COLOR = (0.6, 0.3, 0.1)


@pytest.fixture(scope="module", name="registered")
def registered_fixture() -> Iterator[None]:
    """The add-on, registered for all tests of a module."""
    addon.register()
    yield
    addon.unregister()


@pytest.fixture(name="plane_scene")
def plane_scene_fixture(registered: None, tmp_path: Path) -> bpy.types.Scene:
    """A camera looking straight down at a plane that fills the left half of the picture, 5 m away, lit by a sun.

    Its light is not reflected twice.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "DEEP_GBUFFER"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 40, 30, 100
    scene.render.filepath = str(tmp_path / "frame_")
    scene.view_settings.view_transform = "Raw" if bpy.app.version < (5, 0, 0) else "Standard"
    scene.deep_gbuffer.samples = 2
    scene.deep_gbuffer.indirect.method = "NONE"
    scene.world = bpy.data.worlds.new("Dark")
    scene.world.color = (0.0, 0.0, 0.0)
    if scene.world.node_tree is not None:
        scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    camera = add_object("Camera", bpy.data.cameras.new("Camera"), (0.0, 0.0, PLANE_DISTANCE))
    scene.camera = camera
    plane = add_plane("Plane", -20.0, 0.0, 0.0)
    plane.pass_index = OBJECT_INDEX
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy = math.pi
    add_object("Sun", sun, (0.0, 0.0, 9.0))
    return scene


@pytest.fixture(name="session")
def session_fixture() -> Iterator[ViewportSession]:
    """A viewport's session without a viewport."""
    session = ViewportSession()
    yield session
    session.close()
    gl_thread().submit(lambda _device: None).result(timeout=60)


def idle(session: ViewportSession) -> None:
    """Wait until the session has nothing queued: each job queues its successor before the next of ours runs."""
    while session.busy:
        gl_thread().submit(lambda _device: None).result(timeout=60)


def camera_at(x: float) -> Camera:
    """A camera at x, 5 m above the origin's plane, that looks down."""
    return Camera(builders.translation(x=x, z=PLANE_DISTANCE), (-0.5, 0.5, -0.4, 0.4), 0.1, 100.0)


class Intercepted:
    """An engine some of whose methods are a test's own; Blender's types cannot be patched themselves."""

    def __init__(self, engine, methods):
        self._engine, self._methods = engine, methods

    def __getattr__(self, name):
        if name in self._methods:
            return self._methods[name]
        return getattr(self._engine, name)


@pytest.fixture(name="intercept")
def intercept_fixture(monkeypatch):
    """intercept(method=function, ...): final renders call these instead of Blender's."""

    def intercept(**methods):
        original = final.FinalRender.__init__

        def init(self, engine, session):
            original(self, Intercepted(engine, methods), session)

        monkeypatch.setattr(final.FinalRender, "__init__", init)

    return intercept


@pytest.fixture(name="moving_scene")
def moving_scene_fixture(plane_scene: bpy.types.Scene) -> bpy.types.Scene:
    """The plane below a camera that moves right by 1/8 m a frame, with a box in between that moves left by 1/4 m and a
    sail that a shape key lifts by 1/8 m; x and height are 0 at frame 0. 64 x 36 pixels, a file of two layers."""
    plane_scene.render.resolution_x, plane_scene.render.resolution_y = 64, 36
    ours = plane_scene.deep_gbuffer
    ours.save_layers, ours.save_motion, ours.save_exit = True, True, True
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.0, 0.0, 2.0))
    box = bpy.context.object
    box.name = "Box"
    sail = add_plane("Sail", -1.5, -0.5, 1.0)
    sail.shape_key_add(name="Basis")
    lifted = sail.shape_key_add(name="Lifted")
    for point in lifted.data:
        point.co.z += 1.0
    for owner, path, index, step in (
        (plane_scene.camera, "location", 0, 0.125),
        (box, "location", 0, -0.25),
        (lifted, "value", -1, 0.125),
    ):
        animate(owner, path, index, step)
    return plane_scene


def animate(owner: bpy.types.bpy_struct, path: str, index: int, step: float) -> None:
    """Make a property grow by exactly `step` per frame, from 0 at frame 0; `index` of a vector, −1 for a number."""
    owner.driver_add(path, index).driver.expression = f"frame * {step}"


def add_object(name: str, data: bpy.types.ID | None, location: tuple[float, float, float]) -> bpy.types.Object:
    """A new object in the scene's own collection."""
    item = bpy.data.objects.new(name, data)
    item.location = location
    bpy.context.scene.collection.objects.link(item)
    return item


def add_plane(name: str, left: float, right: float, height: float) -> bpy.types.Object:
    """A horizontal rectangle between two x, 40 m deep, diffuse with BASE_COLOR."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(left, -20, 0), (right, -20, 0), (right, 20, 0), (left, 20, 0)], [], [(0, 1, 2, 3)])
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (*BASE_COLOR, 1.0)
    shader.inputs["Specular IOR Level"].default_value = 0.0
    mesh.materials.append(material)
    return add_object(name, mesh, (0.0, 0.0, height))


def render(scene: bpy.types.Scene, folder: Path) -> dict[str, np.ndarray]:
    """F12; every pass of the result as (H, W, C) float32, row 0 at the top, by "LAYER.PASS"."""
    assert bpy.ops.render.render(scene=scene.name) == {"FINISHED"}
    return read_result(scene, folder)


def read_result(scene: bpy.types.Scene, folder: Path) -> dict[str, np.ndarray]:
    """The passes of the render result; see `render`."""
    use_multilayer(scene)
    path = folder / "result.exr"
    bpy.data.images["Render Result"].save_render(str(path), scene=scene)
    return read_multilayer(path)


def use_multilayer(scene: bpy.types.Scene) -> None:
    """Make Blender write 32-bit multi-layer EXR files."""
    image = scene.render.image_settings
    if bpy.app.version >= (5, 0, 0):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format = "OPEN_EXR_MULTILAYER"
    image.color_depth = "32"


def read_multilayer(path: Path) -> dict[str, np.ndarray]:
    """Passes (H, W, C) of a file that Blender wrote, by "LAYER.PASS", with ".VIEW" where it is stereoscopic."""
    order = "RGBAXYZV"
    grouped: dict[str, list[tuple[int, np.ndarray]]] = {}
    with OpenEXR.File(str(path), separate_channels=True) as file:
        for part in file.parts:  # Blender 5 writes one part per pass, 4.5 one for all
            view = part.header.get("view", "")
            for name, channel in part.channels.items():
                group, letter = name.rsplit(".", 1)
                key = f"{group}.{view}" if view else group
                grouped.setdefault(key, []).append((order.index(letter), np.array(channel.pixels)))
    return {
        group: np.stack([pixels for _, pixels in sorted(channels, key=lambda item: item[0])], axis=-1)
        for group, channels in grouped.items()
    }
