# SPDX-License-Identifier: GPL-3.0-or-later
"""`shaders/common/{bsdf,ggx,phong}.glsl`: what a surface reflects in total, by quadrature, against its albedos."""

import numpy as np
import pytest
from glsl_functions import evaluate

from addon.render.ggx_albedo import dielectric_fresnel, ggx_albedo_table

INCLUDES = ("common/bsdf.glsl",)
DEFINES = ("SPECULAR", "DIFFUSE_ROUGHNESS")
PHONG = ("SPECULAR", "PHONG")
MAKE = """
Surface surface() { return make_surface(color.rgb, color.a, material.x, material.y, material.z, view.z); }
"""
BRDF_OF_DIRECTION = """
vec4 evaluate() { return vec4(specular_brdf_cosine(surface(), vec3(0, 0, 1), view.xyz, direction.xyz), 0); }
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


def reflected(function, view_cosine, defines=DEFINES, **surface):
    """(3,) share of unit light from everywhere that `function`, a BRDF times n·l, reflects."""
    directions, solid_angle = hemisphere()
    body = f"{MAKE}vec4 evaluate() {{ return vec4({function}(surface(), vec3(0, 0, 1), view.xyz, direction.xyz), 0); }}"
    values = evaluate(INCLUDES, body, inputs(view_cosine, directions, **surface), defines=defines)
    return solid_angle @ values[:, :3].astype(np.float64)


def stated(expression, view_cosine, defines=DEFINES, **surface):
    """(3,) what the shader says of a surface."""
    body = f"{MAKE}vec4 evaluate() {{ return vec4({expression}, 0); }}"
    return evaluate(INCLUDES, body, inputs(view_cosine, np.zeros((1, 3)), **surface), defines=defines)[0, :3]


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


def test_rough_diffuse_reflection_is_that_of_cycles():
    """EON in numpy, with the square of the colour in its second term as measured in Cycles 4.5 and 5.2."""
    roughness, color, view = 0.7, np.float64([0.9, 0.5, 0.1]), np.float64([0.8, 0.0, 0.6])
    directions, _ = hemisphere(16, 8)
    directions = directions[directions[:, 2] > 0.05]
    first = 1.0 / (1.0 + (0.5 - 2.0 / (3.0 * np.pi)) * roughness)

    def albedo(cosine):
        sine, angle = np.sqrt(1.0 - cosine**2), np.arccos(cosine)
        g = sine * (angle - sine * cosine) + 2.0 / 3.0 * (sine / cosine * (1.0 - sine**3) - sine)
        return first * (1.0 + roughness / np.pi * g)

    cosines = (np.arange(4000) + 0.5) / 4000
    mean = 2.0 * (albedo(cosines) * cosines).mean()
    n_dot_l, n_dot_v = directions[:, 2], view[2]
    s = directions @ view - n_dot_l * n_dot_v
    once = first * (1.0 + roughness * np.where(s > 0.0, s / np.maximum(n_dot_l, n_dot_v), s))
    repeatedly = (1.0 - albedo(n_dot_l)) * (1.0 - albedo(n_dot_v)) / (1.0 - mean)
    factor = color**3 * mean / (1.0 - color * (1.0 - mean))
    expected = (color * once[:, None] + factor * repeatedly[:, None]) * n_dot_l[:, None] / np.pi
    body = (
        MAKE
        + "vec4 evaluate() { return vec4(diffuse_brdf_cosine(surface(), vec3(0, 0, 1), view.xyz, direction.xyz), 0); }"
    )
    values = evaluate(
        INCLUDES, body, inputs(0.6, directions, color=color, diffuse_roughness=roughness), defines=DEFINES
    )
    np.testing.assert_allclose(values[:, :3], expected, rtol=1e-3)


@pytest.mark.parametrize("surface", [{"metallic": 1.0, "color": (0.6, 0.6, 0.6)}, {"f0": 0.04}, {"f0": 0.16}])
def test_light_that_scatters_repeatedly_is_lost_at_every_reflection(surface):
    """For a node of the table. Kulla and Conty's mean of a dielectric's reflectance is right to 2 %, a third of
    which is left at this roughness."""
    single, schlick, dielectric, mean = ggx_albedo_table().astype(np.float64)[
        round(15 * np.sqrt(surface.get("f0", 0.0))), -1, -1
    ]
    cosines = (np.arange(4000) + 0.5) / 4000
    if "metallic" in surface:
        f0 = surface["color"][0]
        reflectance = f0 + (1.0 - f0) * (1.0 - cosines) ** 5
        once = f0 * single + (1.0 - f0) * schlick
    else:
        f0, root = surface["f0"], np.sqrt(surface["f0"])
        reflectance = dielectric_fresnel(cosines, (1.0 + root) / (1.0 - root))
        once = (f0 + (1.0 - f0) * dielectric) * single
    average = 2.0 * (reflectance * cosines).mean()
    # Light that is reflected k more times: F̄ᵏ (1 − Ē)ᵏ⁻¹ Ē, summed.
    orders = np.arange(1, 60)
    repeatedly = (average**orders * (1.0 - mean) ** (orders - 1) * mean).sum()
    expected = once * (1.0 + repeatedly * (1.0 - single) / single)
    said = stated("surface().specular_albedo", 1.0, roughness=1.0, **surface)
    np.testing.assert_allclose(said, expected, rtol=1e-3 if "metallic" in surface else 7e-3)


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


@pytest.mark.parametrize("roughness", [0.4, 0.7, 1.0])
def test_a_phong_highlight_sums_to_its_albedo_for_light_along_the_normal(roughness):
    surface = {"color": (0.9, 0.5, 0.1), "metallic": 0.5, "f0": 0.04, "roughness": roughness, "defines": PHONG}
    said = stated("surface().specular_albedo", 1.0, **surface)
    np.testing.assert_allclose(reflected("specular_brdf_cosine", 1.0, **surface), said, rtol=1e-3)
    f0 = 0.5 * (0.04 + np.float64(surface["color"]))
    np.testing.assert_allclose(stated("surface().specular_f0", 1.0, **surface), f0, rtol=1e-5)
    np.testing.assert_allclose(said, f0, rtol=0.08)  # (n + 8)/(8π) is the usual approximation, up to 1.07 too large


def test_a_phong_highlight_is_as_wide_as_that_of_ggx():
    """Where Blinn-Phong falls to half, GGX has fallen to between a third and two thirds."""
    angle = np.linspace(0.0, 0.5, 400)
    directions = np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=-1)
    body = MAKE + BRDF_OF_DIRECTION
    values = inputs(1.0, directions, metallic=1.0, roughness=0.4)
    phong, ggx = (evaluate(INCLUDES, body, values, defines=defines)[:, 0] for defines in (PHONG, ("SPECULAR",)))
    half = np.abs(phong / phong[0] - 0.5).argmin()
    assert 0 < half < 399
    assert 1 / 3 < ggx[half] / ggx[0] < 2 / 3


@pytest.mark.parametrize("defines", [DEFINES, PHONG])
def test_no_surface_or_direction_gives_nan(defines):
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
    result = evaluate(INCLUDES, body, values, defines=defines)
    assert np.isfinite(result).all()
    assert (result >= 0.0).all()
