# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import replace

import numpy as np
import pytest

from addon.scene import BaseColorSource, Channel, Extension, Image, ImageTexture, Interpolation, SlotRange
from blender_tests import builders

# A normal of 16 bits per octahedral component: half a step is 1/65535 of the code, at most √3 times that as an angle.
NORMAL_STEP = 2 * np.sqrt(3) / 65535
# Storing a float16 may truncate: one unit in its last place is 2⁻¹⁰.


def test_channels_hold_what_the_scene_says(render):
    material = builders.material(
        base_color=(0.9, 0.25, 0.01), metallic=1.0, roughness=0.6, specular=0.04, emission=(3.0, 70000.0, 0.0)
    )
    scene = builders.scene(
        builders.quad("q", half=0.5), materials=(material,), batches=[builders.batch("q", object_index=7)]
    )
    layer = render(scene, builders.camera(), deep_output=True).layers[0]
    # The window is 6 m wide at the quad's depth of 3 m, so 1 m is 32/6 pixels.
    covered = np.isfinite(layer.depth)
    assert covered[14:18, 14:18].all()
    assert covered.sum() == pytest.approx((32 / 6) ** 2, abs=12)
    assert not layer.normal[~covered].any()
    np.testing.assert_allclose(layer.depth[covered], 3.0, rtol=1e-6)
    np.testing.assert_allclose(layer.normal[covered], [(0, 0, 1)] * covered.sum(), atol=NORMAL_STEP)
    np.testing.assert_allclose(layer.albedo[covered], [(0.9, 0.25, 0.01)] * covered.sum(), rtol=2**-10)
    np.testing.assert_allclose(layer.metallic[covered], 1.0)
    np.testing.assert_allclose(layer.roughness[covered], 0.6, atol=0.5 / 255)
    # Three components share an exponent: the error is relative to the largest.
    np.testing.assert_allclose(layer.emission[covered], [(3.0, 70000.0, 0.0)] * covered.sum(), atol=70000 * 2**-11)
    np.testing.assert_array_equal(layer.object_index[covered], 7)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("turned", [False, True])
def test_normals_face_the_viewer_on_either_side_of_mirrored_and_scaled_instances(render, mirrored, turned):
    matrix = np.diag([-2.0 if mirrored else 2.0, 3.0, 0.5, 1.0])
    if turned:
        matrix = np.diag([-1.0, 1.0, -1.0, 1.0]) @ matrix
    slanted = np.float64([0.6, 0.0, 0.8])
    scene = builders.scene(
        builders.quad("q", normals=np.tile(slanted, (4, 1))), batches=[builders.batch("q", [matrix])]
    )
    layer = render(scene, builders.camera(), deep_output=True).layers[0]
    expected = np.linalg.inv(matrix[:3, :3]).T @ slanted
    expected /= np.linalg.norm(expected) * (-1 if turned else 1)
    np.testing.assert_allclose(layer.normal[16, 16], expected, atol=NORMAL_STEP)


@pytest.mark.parametrize("smooth", [True, False])
def test_a_mirrored_camera_shows_the_mirror_image(render, smooth):
    slanted = np.tile(np.float64([0.6, 0.0, 0.8] if smooth else [0.0, 0.0, 0.0]), (4, 1))
    light = builders.light(casts_shadow=False)  # a preview's soft shadows are turned at random in every pixel
    scene = builders.scene(builders.quad("q", center=(0.7, 0.3), normals=slanted), lights=(light,))
    camera = builders.camera()
    left, right, bottom, top = camera.window
    mirrored = replace(camera, window=(right, left, bottom, top))
    plain, flipped = (render(scene, view, deep_output=True, channels=tuple(Channel)) for view in (camera, mirrored))
    assert np.isfinite(plain.layers[0].depth).any()
    for channel, image in plain.channels.items():
        np.testing.assert_allclose(flipped.channels[channel], image[:, ::-1], atol=1e-5, err_msg=channel)


def test_a_missing_normal_becomes_the_triangles_own(render):
    scene = builders.scene(builders.quad("q", normals=np.zeros((4, 3))))
    layer = render(scene, builders.camera(), deep_output=True).layers[0]
    np.testing.assert_allclose(layer.normal[16, 16], (0, 0, 1), atol=NORMAL_STEP)


def checker(srgb, dtype=np.uint8):
    """2×2 texels: row 0 (bottom) black, grey; row 1 white half transparent, white opaque."""
    values = np.array([[[0, 0, 0, 255], [188, 188, 188, 255]], [[255, 255, 255, 100], [255, 255, 255, 255]]])
    pixels = values.astype(np.uint8) if dtype == np.uint8 else (values / 255 * 4).astype(np.float32)
    return Image("i", "checker", 1, pixels, srgb)


def textured(**arguments):
    texture = ImageTexture("i", interpolation=Interpolation.CLOSEST, extension=arguments.pop("extension", "REPEAT"))
    return builders.material(base_color=(1, 1, 1), source=BaseColorSource.TEXTURE, texture=texture, **arguments)


@pytest.mark.parametrize(
    ("image", "grey"),
    [
        (checker(srgb=True), ((188 / 255 + 0.055) / 1.055) ** 2.4),  # IEC 61966-2-1
        (checker(srgb=False), 188 / 255),
        (checker(srgb=False, dtype=np.float32), 4 * 188 / 255),
    ],
)
def test_textures_are_read_in_their_colour_space_bottom_row_first(render, image, grey):
    scene = builders.scene(builders.quad("q", half=3.0), materials=(textured(),), images=(image,))
    albedo = render(scene, builders.camera(), deep_output=True).layers[0].albedo
    np.testing.assert_allclose(albedo[8, 8], 0.0)
    np.testing.assert_allclose(albedo[8, 24], grey, rtol=5e-3)
    np.testing.assert_allclose(albedo[24, 24], 4.0 if image.pixels.dtype == np.float32 else 1.0)


BLACK, GREY, WHITE = 0.0, 188 / 255, 1.0


@pytest.mark.parametrize(
    ("extension", "left", "below"),
    [
        # Texels of the bottom row left of the image, from far to near; of the right column below it, likewise.
        (Extension.REPEAT, (BLACK, GREY), (GREY, WHITE)),
        (Extension.MIRROR, (GREY, BLACK), (WHITE, GREY)),
        (Extension.EXTEND, (BLACK, BLACK), (GREY, GREY)),
        (Extension.CLIP, None, None),
    ],
)
def test_extension_outside_the_image(render, extension, left, below):
    """UVs run from −1 to 2 over the picture: the image is its middle third, a texel is 5 pixels wide."""
    quad = builders.quad("q", half=3.0, uvs=[(-1, -1), (2, -1), (2, 2), (-1, 2)])
    scene = builders.scene(
        quad, materials=(textured(extension=extension, texture_alpha=True),), images=(checker(srgb=False),)
    )
    layer = render(scene, builders.camera(), width=30, height=30, deep_output=True).layers[0]
    assert layer.albedo[17, 17, 0] == pytest.approx(WHITE)
    if extension is Extension.CLIP:
        assert np.isinf(layer.depth[[12, 12, 2, 7], [2, 7, 17, 17]]).all()  # transparent outside
        return
    np.testing.assert_allclose(layer.albedo[12, [2, 7], 0], left, atol=1e-3)
    np.testing.assert_allclose(layer.albedo[[2, 7], 17, 0], below, atol=1e-3)


def test_transparent_texels_leave_what_is_behind_in_every_layer(render):
    front = builders.quad("front", z=1.0, half=3.0)
    back = builders.quad("back", z=-1.0, half=6.0)
    leaf = replace(textured(texture_alpha=True), key="leaf")
    scene = builders.scene(
        front,
        back,
        materials=(leaf, builders.DIFFUSE),
        images=(checker(srgb=False),),
        batches=[builders.batch("front", materials=("leaf",)), builders.batch("back")],
    )
    first, second = render(scene, builders.camera(), deep_output=True, minimum_separation=0.1).layers
    assert first.depth[24, 8] == pytest.approx(4.0)  # through the half transparent texel
    assert np.isinf(second.depth[24, 8])
    assert first.depth[24, 24] == pytest.approx(2.0)
    assert second.depth[24, 24] == pytest.approx(4.0)


def test_materials_below_the_alpha_threshold_are_not_drawn(render):
    scene = builders.scene(builders.quad("q"), materials=(builders.material(alpha=0.4),))
    assert render(scene, builders.camera()).statistics.draws == 0
    assert render(scene, builders.camera(), alpha_threshold=0.3).statistics.draws == 1


def test_colour_attributes_tint_the_base_colour(render):
    quad = builders.quad("q", colors=[(1.0, 0.5, 0.25, 1.0)] * 4)
    material = builders.material(base_color=(0.5, 0.5, 0.5), source=BaseColorSource.ATTRIBUTE)
    view = render(builders.scene(quad, materials=(material,)), builders.camera(), deep_output=True)
    np.testing.assert_allclose(view.layers[0].albedo[16, 16], (0.5, 0.25, 0.125), rtol=2**-10)


def test_slots_use_their_own_material_and_the_last_one_beyond(render):
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    mesh = builders.mesh("q", corners, [(0, 1, 2), (0, 2, 3)], slots=(SlotRange(0, 0, 1), SlotRange(5, 1, 1)))
    materials = (builders.material("a", base_color=(1, 0, 0)), builders.material("b", base_color=(0, 1, 0)))
    scene = builders.scene(mesh, materials=materials, batches=[builders.batch("q", materials=("a", "b"))])
    albedo = render(scene, builders.camera(half_width=0.33), deep_output=True).layers[0].albedo
    np.testing.assert_allclose(albedo[8, 24], (1, 0, 0))
    np.testing.assert_allclose(albedo[24, 8], (0, 1, 0))


@pytest.mark.parametrize("orthographic", [False, True])
def test_nothing_beyond_the_clip_range_is_drawn(render, orthographic):
    scene = builders.scene(
        builders.quad("near", z=2.5), builders.quad("middle", z=0.0, half=8), builders.quad("far", z=-9, half=90)
    )
    camera = builders.camera(clip_start=1.0, clip_end=10.0, orthographic=orthographic)
    layers = render(scene, camera, deep_output=True, layers=3, minimum_separation=0.0).layers
    assert layers[0].depth[16, 16] == pytest.approx(3.0)
    assert np.isinf(layers[1].depth).all()


def test_geometry_far_from_the_origin_keeps_its_precision(render):
    """A million metres out, a float32 world position is good to 6 cm; camera-relative depth to 1e-6."""
    offset = np.float64([1e6 + 0.3, -2e6 + 0.7, 5e5 + 0.123])
    place = builders.translation(*offset)
    camera = replace(builders.camera(), world_from_camera=place @ builders.camera().world_from_camera)
    scene = builders.scene(builders.quad("q", z=0.125), batches=[builders.batch("q", [place])])
    view = render(scene, camera, deep_output=True, channels=(Channel.POSITION,))
    assert view.layers[0].depth[16, 16] == pytest.approx(2.875, rel=1e-6)
    np.testing.assert_allclose(view.channels[Channel.POSITION][16, 16, 2], offset[2] + 0.125, rtol=1e-7)


def test_depth_pass_has_cycles_value_for_nothing(render):
    view = render(builders.scene(builders.quad("q", half=0.2)), builders.camera(), channels=(Channel.DEPTH,))
    assert view.channels[Channel.DEPTH][0, 0, 0] == np.float32(1e10)
    assert view.channels[Channel.DEPTH][16, 16, 0] == pytest.approx(3.0)


def test_a_moved_camera_and_an_edited_mesh_reach_the_gpu(render):
    """One renderer over several `begin` calls shows each scene, not the one before."""
    from addon.render import Renderer, gl_thread
    from addon.scene import RenderSettings

    settings = RenderSettings(16, 16, filter_radius=0.0, channels=frozenset({Channel.DEPTH}))
    quad = builders.quad("q")
    first = builders.scene(quad)
    edited = replace(first, meshes={"q": replace(quad, version=2, positions=quad.positions + np.float32([0, 0, 0.5]))})
    moved = replace(
        edited, batches=(replace(first.batches[0], version=2, matrices=builders.translation(z=0.25)[None]),)
    )

    def job(device):
        renderer = Renderer(device)
        depths = []
        for scene, z in ((first, 3.0), (first, 5.0), (edited, 5.0), (moved, 5.0), (builders.scene(), 5.0)):
            renderer.begin(scene, builders.camera(z=z), settings)
            renderer.render_sample()
            depths.append(float(renderer.read(Channel.DEPTH)[8, 8, 0]))
        renderer.release()
        return depths

    assert gl_thread().submit(job).result() == pytest.approx([3.0, 5.0, 4.5, 4.25, 1e10])
