# SPDX-License-Identifier: GPL-3.0-or-later
"""GLSL functions evaluated one by one, so that tests can compare them with numpy."""

import moderngl
import numpy as np

from addon.render import gl_thread
from addon.render.light_table import LIGHTS_PER_ROW, TEXELS_PER_LIGHT, TEXELS_PER_SAMPLE, as_texels, light_rows
from addon.render.programs import ProgramSpec

WIDTH = 256


def evaluate(includes, body, inputs, *, defines=(), lights=()):
    """(N, 4) float32: `vec4 evaluate()` of `body` for N inputs.

    `inputs`: name -> (N, K) array, K ≤ 4; in `body`, NAME is a vec4. `lights`: of the light table, relative to the
    origin. `includes`: shader files that `body` calls.
    """
    return gl_thread().submit(lambda device: _evaluate(device, includes, body, inputs, defines, lights)).result()


def _evaluate(device, includes, body, inputs, defines, lights):
    count = len(next(iter(inputs.values())))
    height = -(-count // WIDTH)
    textures = {name: _texture(device, values, height) for name, values in inputs.items()}
    tables = {"ggx_albedo_table": device.ggx_albedo, "ltc_table": device.ltc}
    if lights:
        rows = as_texels(light_rows(tuple(lights), np.zeros(3)))
        textures["light_table"] = device.context.texture((rows.shape[1], rows.shape[0]), 4, rows, dtype="f4")
        textures["light_table"].filter = (moderngl.NEAREST, moderngl.NEAREST)
    declarations = "".join(
        f"uniform sampler2D input_{name};\n#define {name} texelFetch(input_{name}, ivec2(gl_FragCoord.xy), 0)\n"
        for name in inputs
    )
    source = "\n".join(
        [f'#include "{path}"' for path in includes]
        + [declarations, "layout(location = 0) out vec4 result;", body, "void main() { result = evaluate(); }"]
    )
    samplers = (*(f"input_{name}" for name in inputs), *(["light_table"] if lights else []), *tables)
    shape = {
        f"LIGHTS_PER_ROW {LIGHTS_PER_ROW}",
        f"TEXELS_PER_LIGHT {TEXELS_PER_LIGHT}",
        f"TEXELS_PER_SAMPLE {TEXELS_PER_SAMPLE}",
    }
    program = device.programs.get(
        ProgramSpec(
            vertex="common/fullscreen.vert",
            fragment="generated/function.glsl",
            defines=frozenset(defines) | shape,
            samplers=samplers,
            generated=(("function", source),),
        )
    )
    target = device.context.texture((WIDTH, height), 4, dtype="f4")
    framebuffer, vertices = device.context.framebuffer([target]), device.context.vertex_array(program, [])
    for unit, name in enumerate(samplers):
        (tables.get(name) or textures[name.removeprefix("input_")]).use(unit)
    device.context.enable_only(moderngl.NOTHING)
    framebuffer.use()
    vertices.render(moderngl.TRIANGLES, vertices=3)
    device.context.finish()
    result = np.frombuffer(target.read(), np.float32).reshape(-1, 4)[:count].copy()
    device.no_framebuffer.use()
    for item in (vertices, framebuffer, target, *textures.values()):
        item.release()
    return result


def _texture(device, values, height):
    padded = np.zeros((height * WIDTH, 4), np.float32)
    values = np.asarray(values, np.float32)
    padded[: len(values), : values.shape[1]] = values
    texture = device.context.texture((WIDTH, height), 4, padded, dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture
