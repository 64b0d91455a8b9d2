# SPDX-License-Identifier: GPL-3.0-or-later
"""`shaders/common/environment.glsl` and its textures against closed forms and numpy's look-ups."""

import moderngl
import numpy as np
import pytest

from addon.render import gl_thread
from addon.render.environment import (
    BLUR_ALPHAS,
    ENVIRONMENT_DEFINE,
    ENVIRONMENT_SAMPLERS,
    ENVIRONMENT_UNIFORMS,
    EnvironmentTextures,
    environment_blurs,
    environment_uniforms,
)
from addon.render.passes.base import UniformBuffer
from addon.render.programs import ProgramSpec
from addon.render.uniforms import UniformBlock
from addon.scene import EnvironmentMap, World
from addon.scene.equirectangular import look_up, texel_directions, texel_solid_angles

BLOCK = UniformBlock("ProbeUniforms", ENVIRONMENT_UNIFORMS)
PROBE = """
#include "generated/ProbeUniforms.glsl"
#include "common/environment.glsl"
uniform sampler2D directions;
layout(location = 0) out vec4 result;
void main()
{
    vec3 direction = texelFetch(directions, ivec2(gl_FragCoord.xy), 0).xyz;
    result = vec4(%s, 1.0);
}
"""
POLES_AND_SEAM = np.array(
    [(0, 0, 1), (0, 0, -1), (-1, 0, 0), (-1, 1e-9, 0), (-1, -1e-9, 0), (-0.6, 0, 0.8), (1, 0, 0), (0, -1, 0)], float
)


def probe(world, expression, directions):
    """(N, 3) float32: a GLSL expression of `direction`, evaluated for unit directions (N, 3)."""
    return gl_thread().submit(lambda device: _probe(device, world, expression, directions)).result()


def _probe(device, world, expression, directions):
    mapped = world.environment is not None
    spec = ProgramSpec(
        vertex="common/fullscreen.vert",
        fragment="generated/probe.glsl",
        defines=frozenset({ENVIRONMENT_DEFINE} if mapped else ()),
        blocks=(BLOCK,),
        samplers=("directions", *ENVIRONMENT_SAMPLERS),
        generated=(("probe", PROBE % expression),),
    )
    context = device.context
    padded = np.concatenate([directions, np.zeros((len(directions), 1))], axis=1).astype(np.float32)
    inputs = context.texture((len(directions), 1), 4, padded, dtype="f4")
    inputs.filter = (moderngl.NEAREST, moderngl.NEAREST)
    target = context.texture((len(directions), 1), 4, dtype="f4")
    framebuffer = context.framebuffer([target])
    vertices = context.vertex_array(device.programs.get(spec), [])
    uniforms, textures = UniformBuffer(device, BLOCK), EnvironmentTextures(device)
    uniforms.bind(0, **environment_uniforms(world))
    inputs.use(0)
    if mapped:
        textures.bind(world.environment, spec)
    context.enable_only(moderngl.NOTHING)
    framebuffer.use()
    vertices.render(moderngl.TRIANGLES, vertices=3)
    result = np.frombuffer(target.read(), np.float32).reshape(-1, 4)[:, :3].copy()
    device.no_framebuffer.use()
    for item in (vertices, framebuffer, target, inputs, uniforms, textures):
        item.release()
    return result


def environment(pixels, version=1):
    """A map of these pixels."""
    return EnvironmentMap("map", "map", version, np.asarray(pixels, np.float32))


def sphere(count, seed=0):
    """(count, 3) random unit directions, and some at the poles and on the seam."""
    normal = np.random.default_rng(seed).normal(size=(count, 3))
    every = np.concatenate([normal, POLES_AND_SEAM])
    return every / np.linalg.norm(every, axis=1, keepdims=True)


def turn(angle):
    """A rotation about an oblique axis."""
    x, y, z = np.array([1.0, 2.0, -0.5]) / np.linalg.norm([1.0, 2.0, -0.5])
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def gradient(height, width, factors=(1.0, 0.5, 0.2)):
    """(H, W, 3): 1 + z times factors."""
    return 1.0 + texel_directions(height, width)[..., 2:] * np.array(factors)


def test_a_world_of_one_colour():
    world = World((1.0, 2.0, 3.0))
    directions = sphere(8)
    for expression, factor in (
        ("environment_radiance(direction)", 1.0),
        ("environment_irradiance(direction)", np.pi),
        ("environment_specular(direction, 0.3)", 1.0),
    ):
        expected = np.broadcast_to(np.array([1.0, 2.0, 3.0]) * factor, (len(directions), 3))
        np.testing.assert_allclose(probe(world, expression, directions), expected, rtol=1e-6)


@pytest.mark.parametrize("rotation", [None, turn(0.9)])
def test_radiance_is_the_maps_own(rotation):
    """Bilinear look-up as in numpy, across the seam and at the poles; the GPU's weights have 8 bits."""
    pixels = np.random.default_rng(5).random((16, 32, 3)) * 3.0
    world = World((0.5, 1.0, 2.0), environment(pixels), rotation)
    directions = sphere(500)
    turned = directions if rotation is None else directions @ rotation.T
    expected = look_up(pixels, turned) * world.radiance
    # Within half a texel of a pole the value turns with the azimuth, which has no meaning at the pole itself.
    distinct = np.abs(turned[:, 2]) < 1.0 - 1e-6
    shown = probe(world, "environment_radiance(direction)", directions)
    np.testing.assert_allclose(shown[distinct], expected[distinct], atol=2 * 6.0 / 256)
    assert np.isfinite(shown).all()


def test_irradiance_of_a_gradient():
    """L = 1 + k z gives E(n) = π (1 + ⅔ k n_z); 161 rows of nodes interpolate it to (π/160)²/8 and half-floats do not
    come in."""
    factors = np.array([1.0, 0.5, 0.2])
    world = World((1.0, 1.0, 1.0), environment(gradient(128, 256)), turn(0.7))
    directions = sphere(200)
    height = (directions @ turn(0.7).T)[:, 2:]
    shown = probe(world, "environment_irradiance(direction)", directions)
    np.testing.assert_allclose(shown, np.pi * (1.0 + 2.0 / 3.0 * factors * height), rtol=1e-3, atol=1e-3)


def lobe_mean(pixels, direction, alpha):
    """(3,) by brute force: radiance weighted by D(h) cos about a direction."""
    height, width = pixels.shape[:2]
    cosine = texel_directions(height, width) @ direction
    half_squared = 0.5 * (1.0 + cosine)
    density = alpha**2 / (half_squared * (alpha**2 - 1.0) + 1.0) ** 2
    weight = density * np.maximum(cosine, 0.0) * texel_solid_angles(height, width)[:, None]
    return np.einsum("hwc,hw->c", pixels, weight) / weight.sum()


@pytest.mark.parametrize("alpha", [*BLUR_ALPHAS[:5], 1.0])
def test_specular_lobes(alpha):
    """At a layer's own α: the lobe's mean of a map of broad blotches. Between layers (α = 1) both are mixed, which is
    right to a few per cent of the contrast."""
    generator = np.random.default_rng(2)
    coarse = generator.random((6, 12, 3)) * (1.0, 10.0, 0.1)
    pixels = look_up(coarse, texel_directions(180, 360))
    directions = sphere(12, seed=1)
    world = World((1.0, 1.0, 1.0), environment(pixels))
    shown = probe(world, f"environment_specular(direction, {alpha:.6f})", directions)
    expected = np.array([lobe_mean(pixels, direction, alpha) for direction in directions])
    exact = alpha in BLUR_ALPHAS
    np.testing.assert_allclose(shown / (1.0, 10.0, 0.1), expected / (1.0, 10.0, 0.1), atol=5e-3 if exact else 2e-2)


def test_specular_is_continuous_and_tends_to_the_mirror():
    pixels = look_up(np.random.default_rng(4).random((8, 16, 3)), texel_directions(128, 256))
    world = World((1.0, 1.0, 1.0), environment(pixels))
    directions = sphere(40)
    mirror = probe(world, "environment_radiance(direction)", directions)
    np.testing.assert_allclose(probe(world, "environment_specular(direction, 0.0)", directions), mirror, atol=1e-6)
    previous = mirror
    for alpha in np.geomspace(0.005, 1.0, 60):
        shown = probe(world, f"environment_specular(direction, {alpha:.6f})", directions)
        assert np.abs(shown - previous).max() < 0.06
        previous = shown


def test_all_light_is_kept():
    """A sun of one texel: the lobes' integrals are its flux, whatever α; irradiance's integral is π of it."""
    pixels = np.zeros((256, 512, 3), np.float32)
    pixels[200, 100] = 1e6
    flux = 1e6 * texel_solid_angles(256, 512)[200]
    blurs = environment_blurs(pixels)[..., 0]
    rows = blurs.shape[1]
    edges = np.clip((np.arange(rows + 1) - 0.5) / (rows - 1), 0.0, 1.0) * np.pi - 0.5 * np.pi
    area = np.diff(np.sin(edges)) * 2.0 * np.pi / (blurs.shape[2] - 1)
    totals = np.einsum("krc,r->k", blurs[:, :, :-1], area)
    # Negative ripples of the harmonics are cut, which adds a little.
    np.testing.assert_allclose(totals / flux, [np.pi] + [1.0] * len(BLUR_ALPHAS), rtol=5e-3)


def test_linear_over_twelve_orders_of_magnitude():
    pixels = gradient(16, 32)
    directions = sphere(20)
    for expression in ("environment_radiance(direction)", "environment_irradiance(direction)"):
        dim, bright = (
            probe(World((factor,) * 3, environment(pixels * 1e-3 / factor)), expression, directions)
            for factor in (1e-6, 1e6)
        )
        np.testing.assert_allclose(dim, bright, rtol=1e-3)


def test_textures_are_kept_while_the_version_is_the_same():
    def job(device):
        textures = EnvironmentTextures(device)
        spec = ProgramSpec("", "", samplers=ENVIRONMENT_SAMPLERS)
        held = []
        for version in (1, 1, 2):
            textures.bind(environment(gradient(4, 8), version), spec)
            held.append(dict(textures._textures))
        sizes = textures.bytes()
        textures.release()
        return held, sizes, textures.bytes()

    (first, second, third), size, released = gl_thread().submit(job).result()
    assert all(first[name] is second[name] is not third[name] for name in ENVIRONMENT_SAMPLERS)
    assert size == 4 * 8 * 12 * 4 // 3 + 7 * 161 * 321 * 12
    assert released == 0
