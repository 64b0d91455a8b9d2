# SPDX-License-Identifier: GPL-3.0-or-later
"""Radiance as the G-buffer stores it: `shaders/common/shared_exponent.glsl` against its inverses."""

import moderngl
import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from addon.render import gl_thread
from addon.render.programs import GLSL_VERSION, shader_root
from addon.render.readback import decode_shared_exponent

SMALLEST_NORMAL = np.finfo(np.float32).tiny
LARGEST_RADIANCE = np.float32(1e29)  # of shaders/common/finite.glsl
COLORS = 16

FULLSCREEN = GLSL_VERSION + (
    "\nvoid main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }"
)
ENCODE = """
uniform sampler2D colors;
layout(location = 0) out vec4 encoded;
void main() { encoded = encode_shared_exponent(texelFetch(colors, ivec2(gl_FragCoord.xy), 0).rgb); }
"""
DECODE = """
uniform sampler2D colors;
layout(location = 0) out vec4 decoded;
void main() { decoded = vec4(decode_shared_exponent(texelFetch(colors, ivec2(gl_FragCoord.xy), 0)), 1.0); }
"""


@pytest.fixture(scope="module")
def round_trip():
    """round_trip(colors (N, 3) float32): stored (N, 4) as float32, and decoded by GLSL (N, 3) float32."""
    held = {}

    def open_programs(device):
        functions = (shader_root() / "common" / "shared_exponent.glsl").read_text(encoding="utf-8")
        for name, body in (("encode", ENCODE), ("decode", DECODE)):
            fragment = f"{GLSL_VERSION}\n{functions}{body}"
            program = device.context.program(vertex_shader=FULLSCREEN, fragment_shader=fragment)
            held[name] = (program, device.context.vertex_array(program, []))
            held[name + " target"] = device.context.texture((COLORS, 1), 4, dtype="f2" if name == "encode" else "f4")
            held[name + " framebuffer"] = device.context.framebuffer([held[name + " target"]])
        held["colors"] = device.context.texture((COLORS, 1), 3, dtype="f4")
        device.no_framebuffer.use()

    def job(device, colors):
        held["colors"].write(colors)
        device.context.enable_only(moderngl.NOTHING)
        results = []
        for name, source, dtype in (("encode", "colors", np.float16), ("decode", "encode target", np.float32)):
            held[name + " framebuffer"].use()
            held[source].use(0)
            held[name][1].render(moderngl.TRIANGLES, vertices=3)
            device.context.finish()
            results.append(np.frombuffer(held[name + " target"].read(), dtype).reshape(COLORS, 4).astype(np.float32))
        device.no_framebuffer.use()
        return results[0], results[1][:, :3]

    def close(_):
        for item in held.values():
            for part in reversed(item) if isinstance(item, tuple) else (item,):
                part.release()

    gl_thread().submit(open_programs).result()
    yield lambda colors: gl_thread().submit(lambda device: job(device, colors)).result()
    gl_thread().submit(close).result()


magnitudes = st.one_of(
    st.just(0.0),
    st.floats(0.0, float(LARGEST_RADIANCE), width=32),
    st.floats(0.0, 2.0, width=32),
    st.integers(-149, 96).map(lambda exponent: float(np.ldexp(1.0, exponent))),
    st.integers(-126, 96).map(lambda exponent: float(np.nextafter(np.float32(np.ldexp(1.0, exponent)), np.float32(0)))),
)


def assert_right_to_11_digits(round_trip, colors):
    """Each component is right to 11 binary digits of the largest, for GLSL's inverse and numpy's."""
    stored, decoded = round_trip(colors)
    # What is below the smallest normal number a driver may take for zero.
    bound = colors.max(axis=1, keepdims=True).astype(np.float64) * 2.0**-11 + SMALLEST_NORMAL
    assert (np.abs(decoded.astype(np.float64) - colors) <= bound).all()
    assert (stored[:, 3] == np.round(stored[:, 3])).all()
    np.testing.assert_allclose(decode_shared_exponent(stored), decoded, rtol=0, atol=SMALLEST_NORMAL)


@given(arrays(np.float32, (COLORS, 3), elements=magnitudes))
@example(np.full((COLORS, 3), LARGEST_RADIANCE))
@example(np.full((COLORS, 3), np.nextafter(np.float32(0), np.float32(1)), np.float32))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_colors_are_right_to_11_binary_digits_of_the_largest_component(round_trip, colors):
    assert_right_to_11_digits(round_trip, colors)


def test_every_exponent_is_right_to_11_binary_digits(round_trip):
    generator = np.random.default_rng(7)
    for first in range(-149, 96 - COLORS, COLORS):
        exponents = np.arange(first, first + COLORS)[:, None]
        assert_right_to_11_digits(
            round_trip, np.ldexp(generator.uniform(0.0, 2.0, (COLORS, 3)), exponents).astype(np.float32)
        )


def test_black_is_stored_as_what_a_cleared_target_holds(round_trip):
    stored, decoded = round_trip(np.zeros((COLORS, 3), np.float32))
    assert not stored.any()
    assert not decoded.any()


def test_whole_numbers_of_11_digits_over_any_power_of_two_are_exact(round_trip):
    generator = np.random.default_rng(3)
    colors = generator.integers(1024, 2048, (COLORS, 3)) * np.exp2(generator.integers(-100, 80, (COLORS, 1)))
    np.testing.assert_array_equal(round_trip(colors.astype(np.float32))[1], colors.astype(np.float32))
