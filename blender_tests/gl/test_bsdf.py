# SPDX-License-Identifier: GPL-3.0-or-later
"""`shaders/common/bsdf.glsl`: what a surface reflects in total, by quadrature of its BRDF, against its albedos."""

import numpy as np
import pytest
from glsl_functions import evaluate

INCLUDES = ("common/bsdf.glsl",)
DEFINES = ("SPECULAR", "DIFFUSE_ROUGHNESS")
MAKE = """
Surface surface() { return make_surface(color.rgb, color.a, material.x, material.y, material.z, view.z); }
"""
VIEW_COSINES = (0.1, 0.4, 0.8, 1.0)


def hemisphere(n_theta=96, n_phi=256):
    """Directions (N, 3) and solid angles (N,): Gauss–Legendre in θ, so cosines need no special care at the horizon."""
    nodes, weights = np.polynomial.legendre.leggauss(n_theta)
    theta = 0.25 * np.pi * (nodes + 1.0)
    phi = 2.0 * np.pi * (np.arange(n_phi) + 0.5) / n_phi
    t, p = np.meshgrid(theta, phi, indexing="ij")
    solid_angle = np.repeat(0.25 * np.pi * weights * np.sin(theta), n_phi) * 2.0 * np.pi / n_phi
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1).reshape(-1, 3), solid_angle


def inputs(view_cosine, directions, color=(1, 1, 1), f0=0.0, metallic=0.0, roughness=0.5, diffuse_roughness=0.0):
    """Inputs of a surface whose normal is +Z."""
    view = (np.sqrt(1.0 - view_cosine**2), 0.0, view_cosine)
    rows = {"view": view, "color": (*color, f0), "material": (metallic, roughness, diffuse_roughness)}
    return {name: np.tile(row, (len(directions), 1)) for name, row in rows.items()} | {"direction": directions}


def reflected(function, view_cosine, **surface):
    """(3,) share of unit light from everywhere that `function`, a BRDF times n·l, reflects."""
    directions, solid_angle = hemisphere()
    body = f"{MAKE}vec4 evaluate() {{ return vec4({function}(surface(), vec3(0, 0, 1), view.xyz, direction.xyz), 0); }}"
    values = evaluate(INCLUDES, body, inputs(view_cosine, directions, **surface), defines=DEFINES)
    return solid_angle @ values[:, :3].astype(np.float64)


def stated(expression, view_cosine, **surface):
    """(3,) what the shader says of a surface."""
    body = f"{MAKE}vec4 evaluate() {{ return vec4({expression}, 0); }}"
    return evaluate(INCLUDES, body, inputs(view_cosine, np.zeros((1, 3)), **surface), defines=DEFINES)[0, :3]


@pytest.mark.parametrize("view_cosine", VIEW_COSINES)
@pytest.mark.parametrize("diffuse_roughness", [0.0, 0.4, 1.0])
def test_a_white_rough_diffuse_surface_reflects_everything(view_cosine, diffuse_roughness):
    """EON's closed forms hold for Fujii's model exactly; the quadrature's error is below 1e-4."""
    surface = {"diffuse_roughness": diffuse_roughness}
    np.testing.assert_allclose(reflected("diffuse_brdf_cosine", view_cosine, **surface), 1.0, atol=1e-3)
    said = stated("diffuse_directional_albedo(surface(), view.z)", view_cosine, **surface)
    np.testing.assert_allclose(said, 1.0, atol=1e-5)


@pytest.mark.parametrize("view_cosine", VIEW_COSINES)
def test_a_coloured_rough_diffuse_surface_reflects_its_directional_albedo(view_cosine):
    surface = {"diffuse_roughness": 0.8, "color": (0.9, 0.5, 0.1)}
    np.testing.assert_allclose(
        reflected("diffuse_brdf_cosine", view_cosine, **surface),
        stated("diffuse_directional_albedo(surface(), view.z)", view_cosine, **surface),
        atol=1e-3,
    )


def test_diffuse_reflection_without_roughness_is_lamberts():
    directions, _ = hemisphere(16, 8)
    body = (
        MAKE
        + "vec4 evaluate() { return vec4(diffuse_brdf_cosine(surface(), vec3(0, 0, 1), view.xyz, direction.xyz), 0); }"
    )
    values = evaluate(INCLUDES, body, inputs(0.3, directions, color=(0.9, 0.5, 0.1)), defines=DEFINES)
    expected = np.float64([0.9, 0.5, 0.1]) / np.pi * directions[:, 2:]
    np.testing.assert_allclose(values[:, :3], expected, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("view_cosine", VIEW_COSINES)
@pytest.mark.parametrize("roughness", [0.45, 0.7, 1.0])
@pytest.mark.parametrize(
    "surface",
    [
        {"metallic": 1.0},
        {"metallic": 1.0, "color": (0.9, 0.4, 0.05)},
        {"f0": 0.04},
        {"f0": 0.2},
        {"f0": 0.04, "metallic": 0.5},
    ],
)
def test_highlights_sum_to_the_specular_albedo(view_cosine, roughness, surface):
    """The table is linear between 32 nodes of a function whose second derivative is below 10: 10/(8·31²) of error."""
    surface = {"roughness": roughness, **surface}
    said = stated("surface().specular_albedo", view_cosine, **surface)
    got = reflected("specular_brdf_cosine", view_cosine, **surface)
    np.testing.assert_allclose(got, said, rtol=5e-3, atol=1e-3)


@pytest.mark.parametrize("view_cosine", VIEW_COSINES)
@pytest.mark.parametrize("roughness", [0.0, 0.2, 0.6, 1.0])
def test_a_white_metal_and_a_white_plastic_reflect_everything(view_cosine, roughness):
    for surface in ({"metallic": 1.0}, {"f0": 0.04}):
        said = stated(
            "surface().specular_albedo + diffuse_directional_albedo(surface(), view.z)",
            view_cosine,
            roughness=roughness,
            **surface,
        )
        np.testing.assert_allclose(said, 1.0, atol=1e-4)


@pytest.mark.parametrize("ior", [1.1, 1.5, 2.4])
def test_a_smooth_dielectric_reflects_what_fresnels_equations_say(ior):
    """The index of refraction is found again from F0, and polarisation by Snell's law in numpy."""
    cosine = np.linspace(1e-3, 1.0, 64)
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / ior**2)
    across = (cosine - ior * inside) / (cosine + ior * inside)
    along = (ior * cosine - inside) / (ior * cosine + inside)
    f0 = ((ior - 1.0) / (ior + 1.0)) ** 2
    body = MAKE + "vec4 evaluate() { return vec4(dielectric_fresnel(direction.x, surface().ior)); }"
    values = evaluate(INCLUDES, body, inputs(1.0, cosine[:, None], f0=f0), defines=DEFINES)
    np.testing.assert_allclose(values[:, 0], 0.5 * (across**2 + along**2), rtol=1e-3, atol=1e-5)


def test_no_surface_or_direction_gives_nan():
    generator = np.random.default_rng(5)
    count = 4096
    edge = np.float64([0.0, 1e-8, 1e-3, 0.5, 1.0])
    directions = generator.normal(size=(count, 3))
    directions[:8] = [0.0, 0.0, 1.0]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    view = np.abs(generator.normal(size=(count, 3))) * [1.0, 1.0, 0.1]
    view[:16] = [0.0, 0.0, 1.0]
    view[16:32] = [1.0, 0.0, 0.0]
    view /= np.linalg.norm(view, axis=1, keepdims=True)
    values = {
        "view": view,
        "color": generator.choice(edge, (count, 4)),
        "material": generator.choice(edge, (count, 3)),
        "direction": directions,
    }
    body = (
        MAKE
        + """
    vec4 evaluate()
    {
        vec3 normal = vec3(0, 0, 1);
        vec3 diffuse = diffuse_brdf_cosine(surface(), normal, view.xyz, direction.xyz);
        vec3 specular = specular_brdf_cosine(surface(), normal, view.xyz, direction.xyz);
        vec3 albedo = surface().specular_albedo + diffuse_directional_albedo(surface(), view.z);
        return vec4(min(min(diffuse, specular), albedo), dot(diffuse + specular + albedo, vec3(1)));
    }"""
    )
    result = evaluate(INCLUDES, body, values, defines=DEFINES)
    assert np.isfinite(result).all()
    assert (result >= 0.0).all()
