# SPDX-License-Identifier: GPL-3.0-or-later
import ctypes
import math

import moderngl
import numpy as np
import pytest

from addon.render import RenderError, gl_thread
from addon.render.layout import DEPTH_BYTES, TargetSpec
from addon.render.raw_gl import vertex_layer_extension
from addon.render.targets import TexturePool

SIZE = (5, 3)
LAYERS = 3
DEPTH = TargetSpec("depths", 1, "f4", LAYERS, math.inf)
COLOR = TargetSpec("colors", 4, "f1", LAYERS, 1.0)
INDEX = TargetSpec("indices", 1, "u2", LAYERS, 7.0)
FILM = TargetSpec("film", 4, "f4", guarded=False)


@pytest.fixture
def with_pool():
    """with_pool(job): the result of job(pool, device), run on the GL thread with a pool that is released after."""

    def with_pool(job):
        def run(device):
            pool = TexturePool(device)
            try:
                return job(pool, device)
            finally:
                pool.release()
                assert device.context.error == "GL_NO_ERROR"

        return gl_thread().submit(run).result()

    return with_pool


def texels(pool, name):
    texture = pool.texture(name)
    width, height, layers = texture.size
    kind = {"f4": np.float32, "f1": np.uint8, "u2": np.uint16}[texture.dtype]
    return np.frombuffer(pool.read(name), kind).reshape(layers, height, width, texture.components)


def hardware_depth(pool, device):
    """Every layer of the depth array, (layers, H, W) float32."""
    load = device.context.mglo._context.load
    bind = ctypes.CFUNCTYPE(None, ctypes.c_uint, ctypes.c_uint)(load("glBindTexture"))
    get = ctypes.CFUNCTYPE(None, ctypes.c_uint, ctypes.c_int, ctypes.c_uint, ctypes.c_uint, ctypes.c_void_p)(
        load("glGetTexImage")
    )
    width, height = pool.size
    values = np.full((LAYERS, height, width), np.nan, np.float32)
    device.context.finish()
    bind(0x8C1A, pool._depth)  # TEXTURE_2D_ARRAY
    get(0x8C1A, 0, 0x1902, 0x1406, values.ctypes.data)  # DEPTH_COMPONENT, FLOAT
    return values


LAYERED_VERTEX = """
#version 410
{extension}
{layer}
void main() {{
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, 0.25 * float(gl_InstanceID + 1), 1.0);
    {write}
}}
"""
LAYERED_GEOMETRY = """
#version 410
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;
flat in int v_instance[];
flat out int g_instance;
void main() {
    for (int i = 0; i < 3; ++i) {
        gl_Position = gl_in[i].gl_Position;
        gl_Layer = g_instance = v_instance[0];
        EmitVertex();
    }
}
"""
LAYERED_FRAGMENT = """
#version 410
flat in int {instance};
layout(location = 0) out float out_depth;
layout(location = 1) out uint out_index;
void main() {{
    out_depth = float({instance}) + 0.5;
    out_index = uint({instance}) + 40u;
}}
"""


def draw_layers(pool, device, *, from_vertex_shader):
    """One instance per layer, at reversed depth 1/4, 2/4, 3/4."""
    pool.prepare(SIZE, (DEPTH, INDEX), guard_band=2, depth_layers=LAYERS)
    extension = vertex_layer_extension(device.context)
    if from_vertex_shader:
        vertex = LAYERED_VERTEX.format(
            extension=f"#extension {extension} : require",
            layer="flat out int v_instance;",
            write="gl_Layer = v_instance = gl_InstanceID;",
        )
        stages = {"vertex_shader": vertex, "fragment_shader": LAYERED_FRAGMENT.format(instance="v_instance")}
    else:
        vertex = LAYERED_VERTEX.format(
            extension="", layer="flat out int v_instance;", write="v_instance = gl_InstanceID;"
        )
        stages = {
            "vertex_shader": vertex,
            "geometry_shader": LAYERED_GEOMETRY,
            "fragment_shader": LAYERED_FRAGMENT.format(instance="g_instance"),
        }
    program = device.context.program(**stages)
    vertex_array = device.context.vertex_array(program, [])
    pool.layered_framebuffer(("depths", "indices")).use()
    pool.clear(("depths", "indices"), depth=True)
    device.context.enable_only(moderngl.DEPTH_TEST)
    device.context.depth_func = ">"
    vertex_array.render(moderngl.TRIANGLES, vertices=3, instances=LAYERS)
    vertex_array.release()
    program.release()
    return texels(pool, "depths"), texels(pool, "indices"), hardware_depth(pool, device)


@pytest.mark.parametrize("from_vertex_shader", [False, True])
def test_a_layered_framebuffer_draws_where_gl_layer_says(with_pool, from_vertex_shader):
    if (
        from_vertex_shader
        and gl_thread().submit(lambda device: vertex_layer_extension(device.context)).result() is None
    ):
        pytest.skip("this driver's vertex shaders cannot write gl_Layer")
    depths, indices, hardware = with_pool(
        lambda pool, device: draw_layers(pool, device, from_vertex_shader=from_vertex_shader)
    )
    assert depths.shape == (LAYERS, SIZE[1] + 4, SIZE[0] + 4, 1)
    for layer in range(LAYERS):
        np.testing.assert_array_equal(depths[layer], layer + 0.5)
        np.testing.assert_array_equal(indices[layer], layer + 40)
        np.testing.assert_array_equal(hardware[layer], np.float32(0.25 * (layer + 1)))


def fill(pool, device, value):
    """Write a value that no clear would into every layer of every target and of the depth."""
    pool.layered_framebuffer(("depths", "colors", "indices")).use()
    device.raw.clear_color(0, value)
    device.raw.clear_color(1, 0.25)
    device.raw.clear_color_uint(2, 3)
    device.raw.clear_depth(0.75)


@pytest.mark.parametrize("through_moderngl", [False, True])
def test_clearing_a_layered_framebuffer_reaches_every_layer(with_pool, through_moderngl):
    def job(pool, device):
        names = ("depths", "colors", "indices")
        for depth_layers in (1, LAYERS):
            pool.prepare(SIZE, (DEPTH, COLOR, INDEX), depth_layers=depth_layers)
        fill(pool, device, 2.0)
        before = hardware_depth(pool, device)
        if through_moderngl:
            pool.layered_framebuffer(names).clear(depth=0.0)
            pool.clear(names)
        else:
            pool.clear(names, depth=True)
        return before, [texels(pool, name) for name in names], hardware_depth(pool, device)

    before, (depths, colors, indices), hardware = with_pool(job)
    np.testing.assert_array_equal(before, 0.75)
    np.testing.assert_array_equal(depths, np.inf)
    np.testing.assert_array_equal(colors, 255)
    np.testing.assert_array_equal(indices, 7)
    np.testing.assert_array_equal(hardware, 0.0)


def test_a_single_layer_is_drawn_with_the_first_depth_layer_alone(with_pool):
    def job(pool, device):
        pool.prepare(SIZE, (DEPTH, COLOR, INDEX), depth_layers=LAYERS)
        fill(pool, device, 2.0)
        pool.framebuffer((("depths", 1),), depth=True).use()
        pool.clear((("depths", 1),), depth=True)
        return texels(pool, "depths"), hardware_depth(pool, device)

    depths, hardware = with_pool(job)
    np.testing.assert_array_equal(depths[[0, 2]], 2.0)
    np.testing.assert_array_equal(depths[1], np.inf)
    np.testing.assert_array_equal(hardware[0], 0.0)
    np.testing.assert_array_equal(hardware[1:], 0.75)


def test_a_copy_has_the_same_bits(with_pool):
    """Infinities, a denormal number and negative zero among them."""
    special = np.array([np.inf, -np.inf, 1e-42, -0.0, 3.4e38, 1 / 3], np.float32)
    generator = np.random.default_rng(5)
    source = np.concatenate([special, generator.uniform(0, 1e7, 39).astype(np.float32)]).reshape(LAYERS, 3, 5)

    def job(pool, _):
        pool.prepare(SIZE, (DEPTH, TargetSpec("oracle", 1, "f4", 2, math.inf)), depth_layers=LAYERS)
        pool.texture("depths").write(source)
        pool.texture("oracle").write(np.full((2, 3, 5), -1.0, np.float32))
        pool.copy("depths", 2, "oracle", 1)
        first = texels(pool, "oracle")
        pool.copy("depths", 0, "oracle", 1)
        return first, texels(pool, "oracle")

    first, second = with_pool(job)
    np.testing.assert_array_equal(first[1, ..., 0].view(np.uint32), source[2].view(np.uint32))
    np.testing.assert_array_equal(second[1, ..., 0].view(np.uint32), source[0].view(np.uint32))
    np.testing.assert_array_equal(first[0], -1.0)


def test_the_guard_band_surrounds_guarded_targets_alone_and_says_what_it_costs(with_pool):
    def job(pool, _):
        pool.prepare((10, 6), (DEPTH, FILM), guard_band=4, depth_layers=LAYERS)
        sizes = {name: pool.texture(name).size[:2] for name in ("depths", "film")}
        return sizes, pool.size, pool.picture_size, pool.guard_band, pool.bytes(), pool.guard_band_bytes()

    sizes, size, picture_size, guard_band, used, cost = with_pool(job)
    assert sizes == {"depths": (18, 14), "film": (10, 6)}
    assert (size, picture_size, guard_band) == ((18, 14), (10, 6), 4)
    assert used == {
        "depths": 4 * LAYERS * 18 * 14,
        "film": 16 * 10 * 6,
        "gbuffer.depth": DEPTH_BYTES * LAYERS * 18 * 14,
    }
    assert cost == (4 + DEPTH_BYTES) * LAYERS * (18 * 14 - 10 * 6)


def test_what_did_not_change_is_kept(with_pool):
    def job(pool, _):
        names = []
        for guard_band, depth_layers in ((0, LAYERS), (0, LAYERS), (0, 1), (2, 1)):
            pool.prepare(SIZE, (DEPTH, FILM), guard_band=guard_band, depth_layers=depth_layers)
            names.append((pool.texture("depths"), pool.framebuffer((("depths", 0),), depth=True)))
        return names

    first, again, less_depth, guarded = with_pool(job)
    assert again[0] is first[0]
    assert again[1] is first[1]
    assert less_depth[0] is first[0]
    assert less_depth[1] is not first[1]
    assert guarded[0] is not first[0]


def test_a_texel_of_a_divided_target_is_for_several_pixels(with_pool):
    """A picture of 5×3 pixels with a guard band of 2 covers 9×7: with 4×4 pixels a texel, 3×2 of them."""
    specs = (TargetSpec("tiles", 2, "f4", 3, divisor=4), TargetSpec("few", 4, "u4", 1, guarded=False, divisor=4))

    def job(pool, _):
        pool.prepare(SIZE, specs, guard_band=2, depth_layers=1)
        assert pool.margin("tiles") == pool.margin("few") == 0
        sizes = pool.texture("tiles").size, pool.texture("few").size, len(pool.read("tiles"))
        return sizes, pool.bytes(), pool.guard_band_bytes()

    sizes, sizes_bytes, guard_band_bytes = with_pool(job)
    assert sizes == ((3, 2, 3), (2, 1, 1), 8 * 3 * 3 * 2)
    assert sizes_bytes == {"tiles": 8 * 3 * 3 * 2, "few": 16 * 2, "gbuffer.depth": DEPTH_BYTES * 9 * 7}
    assert guard_band_bytes == 8 * 3 * (3 * 2 - 2 * 1) + DEPTH_BYTES * (9 * 7 - 5 * 3)


def test_a_guard_band_over_the_limit_is_named(with_pool):
    def job(pool, device):
        limit = device.maximum_size
        with pytest.raises(
            RenderError, match=rf"{limit - 4}×16 with a guard band of 3 pixels .* \(1 to {limit} pixels"
        ):
            pool.prepare((limit - 4, 16), (FILM,), guard_band=3)

    with_pool(job)


def test_layers_that_do_not_match_the_depths_are_refused(with_pool):
    def job(pool, _):
        pool.prepare(SIZE, (DEPTH,), depth_layers=LAYERS - 1)
        with pytest.raises(ValueError, match="depths has 3 layers, the depth it is drawn with 2"):
            pool.layered_framebuffer(("depths",))

    with_pool(job)


ATTRIBUTE_VERTEX = """
#version 410
in float in_value;
flat out float v_value;
void main() {
    gl_Position = vec4(2.0 * (float(gl_InstanceID) + 0.5) / 4.0 - 1.0, 0.0, 0.0, 1.0);
    v_value = in_value;
}
"""
ATTRIBUTE_FRAGMENT = """
#version 410
flat in float v_value;
layout(location = 0) out vec4 out_value;
void main() { out_value = vec4(v_value); }
"""


def test_an_attribute_advances_by_its_divisor(with_pool):
    """Four instances, one point each, with an attribute that two instances share."""

    def job(pool, device):
        pool.prepare((4, 1), (FILM,))
        program = device.context.program(vertex_shader=ATTRIBUTE_VERTEX, fragment_shader=ATTRIBUTE_FRAGMENT)
        buffer = device.context.buffer(np.array([10.0, 20.0, 30.0, 40.0], np.float32))
        vertex_array = device.context.vertex_array(program, [(buffer, "1f/i", "in_value")])
        device.raw.set_attribute_divisor(vertex_array, program["in_value"].location, 2)
        pool.framebuffer((("film", 0),)).use()
        device.context.enable_only(moderngl.NOTHING)
        vertex_array.render(moderngl.POINTS, vertices=1, instances=4)
        for item in (vertex_array, buffer, program):
            item.release()
        return texels(pool, "film")[0, 0, :, 0]

    np.testing.assert_array_equal(with_pool(job), [10, 10, 20, 20])
