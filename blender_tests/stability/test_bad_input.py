# SPDX-License-Identifier: GPL-3.0-or-later
"""Bad input, end to end: the picture still comes, it is finite, and a warning names what was wrong."""

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from troubled_scenes import BAD, GOOD, add, assert_good_picture, assert_named, read_exr, render


def not_a_number() -> None:
    """One vertex is NaN."""
    add(BAD, [(0, 0, 1), (1, 0, 1), (0, float("nan"), 2)], [(0, 1, 2)])


def infinite() -> None:
    """One vertex is at infinity, another face is fine."""
    add(BAD, [(0, 0, 1), (1, 0, 1), (float("inf"), 0, 2), (0, 0, 2)], [(0, 1, 2), (0, 1, 3)])


def without_area() -> None:
    """A face whose corners coincide and one whose corners are in line."""
    add(BAD, [(0, 0, 1), (0, 0, 1), (0, 0, 1), (1, 0, 1), (2, 0, 1)], [(0, 1, 2), (0, 3, 4)])


def without_scale() -> None:
    """An object scaled to nothing."""
    add(BAD, [(0, 0, 1), (1, 0, 1), (0, 0, 2)], [(0, 1, 2)]).scale = (0.0, 0.0, 0.0)


def not_a_number_placed() -> None:
    """An object whose place is NaN."""
    add(BAD, [(0, 0, 1), (1, 0, 1), (0, 0, 2)], [(0, 1, 2)]).location = (float("nan"), 0.0, 0.0)


@pytest.mark.parametrize("trouble", [not_a_number, infinite, without_area, without_scale, not_a_number_placed])
def test_troubled_object_is_named_and_the_rest_is_rendered(
    scene: bpy.types.Scene, tmp_path: Path, trouble: Callable[[], None]
) -> None:
    trouble()
    channels, warnings = render(scene, tmp_path)
    assert_good_picture(channels)
    assert_named(warnings)


def flattened() -> None:
    """An object scaled flat, which has no inverse transform."""
    add(BAD, [(0, 0, 1), (1, 0, 1), (0, 1, 2)], [(0, 1, 2)]).scale = (1.0, 1.0, 0.0)


def mirrored_and_sheared() -> None:
    """A negative scale below a rotated, unevenly scaled parent."""
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    parent.matrix_world = Matrix.Rotation(0.7, 4, "X") @ Matrix.Diagonal((1.0, 3.0, 0.2, 1.0))
    child = add(BAD, [(0, 0, 1), (1, 0, 1), (0, 1, 2)], [(0, 1, 2)])
    child.parent, child.scale = parent, (-1.0, 2.0, 0.5)


def enormous() -> None:
    """Coordinates near float32's end, behind the plane's far clip."""
    add(BAD, [(0, 1e30, 0), (1e30, 1e30, 0), (0, 1e30, 1e30)], [(0, 1, 2)])


def empty_mesh() -> None:
    """A mesh without any vertex, and one without faces."""
    add(BAD, [], [])
    add("Points", [(0, 0, 0), (1, 1, 1)], [])


def without_material() -> None:
    """A material slot without a material."""
    add(BAD, [(0, 0, 1), (1, 0, 1), (0, 1, 2)], [(0, 1, 2)]).data.materials.append(None)


@pytest.mark.parametrize("unusual", [flattened, mirrored_and_sheared, enormous, empty_mesh, without_material])
def test_unusual_objects_render(scene: bpy.types.Scene, tmp_path: Path, unusual: Callable[[], None]) -> None:
    unusual()
    assert_good_picture(render(scene, tmp_path)[0])


@pytest.mark.parametrize("size", [(1, 1), (1, 17), (33, 1), (31, 23)])
@pytest.mark.parametrize("layers", [1, 8])
@pytest.mark.parametrize("separation", [0.0, 1e6])
def test_odd_sizes_and_extreme_layers(
    scene: bpy.types.Scene, tmp_path: Path, size: tuple[int, int], layers: int, separation: float
) -> None:
    # Blender's least resolution is 4, but a percentage of it may be less.
    scene.render.resolution_x, scene.render.resolution_y = (4 * side for side in size)
    scene.render.resolution_percentage = 25
    settings = scene.deep_gbuffer
    settings.layers, settings.minimum_separation = layers, separation
    settings.save_layers, settings.layers_path = True, str(tmp_path / "layers.exr")
    channels, _ = render(scene, tmp_path)
    for name, pixels in channels.items():
        assert pixels.shape == size[::-1], name
        assert np.isfinite(pixels).all(), name
    (layer_file,) = (path for path in tmp_path.glob("*.exr") if path.name != "out.exr")
    written = read_exr(layer_file)
    assert len(written) > 4 * layers
    for name, pixels in written.items():
        assert pixels.shape == size[::-1], name
        assert not np.isnan(pixels).any(), name


def test_no_lights(scene: bpy.types.Scene, tmp_path: Path) -> None:
    scene.collection.objects.unlink(bpy.data.objects["Sun"])
    channels, _ = render(scene, tmp_path)
    depth = next(pixels for name, pixels in channels.items() if name.endswith("Depth.Z"))
    assert (depth[-4:] < 1e9).all()
    assert all(np.isfinite(pixels).all() for pixels in channels.values())


def test_no_objects(scene: bpy.types.Scene, tmp_path: Path) -> None:
    scene.collection.objects.unlink(bpy.data.objects[GOOD])
    channels, _ = render(scene, tmp_path)
    depth = next(pixels for name, pixels in channels.items() if name.endswith("Depth.Z"))
    assert (depth == np.float32(1e10)).all(), "Cycles' value for nothing there"
    assert all(np.isfinite(pixels).all() for pixels in channels.values())


def test_no_camera_is_an_error_that_says_so(scene: bpy.types.Scene) -> None:
    scene.camera = None
    with pytest.raises(RuntimeError, match=r"(?i)camera"):
        bpy.ops.render.render(scene=scene.name)


@pytest.mark.parametrize(
    ("name", "value"), [("energy", float("inf")), ("energy", float("nan")), ("energy", -5.0), ("angle", 3.14)]
)
def test_strange_lights(scene: bpy.types.Scene, tmp_path: Path, name: str, value: float) -> None:
    strange = bpy.data.lights.new(BAD, "SUN")
    setattr(strange, name, value)
    scene.collection.objects.link(bpy.data.objects.new(BAD, strange))
    channels, _ = render(scene, tmp_path)
    assert all(np.isfinite(pixels).all() for pixels in channels.values())


def test_light_without_size_in_the_surface(scene: bpy.types.Scene, tmp_path: Path) -> None:
    """The distance to the light is 0 at one point of the plane and tiny around it."""
    light = bpy.data.lights.new("Point", "POINT")
    light.shadow_soft_size = 0.0
    scene.collection.objects.link(bpy.data.objects.new("Point", light))
    assert_good_picture(render(scene, tmp_path)[0])


def test_missing_image_is_named(scene: bpy.types.Scene, tmp_path: Path) -> None:
    image = bpy.data.images.new("Lost picture", 4, 4)
    image.source, image.filepath = "FILE", str(tmp_path / "lost.png")
    material = bpy.data.materials.new("Textured")
    material.use_nodes = True
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = next(item for item in tree.nodes if item.type == "BSDF_PRINCIPLED")
    tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    bpy.data.objects[GOOD].data.materials.append(material)
    channels, warnings = render(scene, tmp_path)
    assert_good_picture(channels)
    assert any("Lost picture" in text or "lost.png" in text for text in warnings), warnings
