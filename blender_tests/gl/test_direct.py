# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light against closed forms: radiance of a Lambertian plane is ρ/π times the irradiance."""

from dataclasses import replace

import numpy as np
import pytest

from addon.scene import AreaShape, Channel, LightKind
from blender_tests import builders

RHO = 0.5
# 8-bit storage plays no part in these scenes; float16 albedo is exact for 0.5 and shading is float32.
EXACT = 2e-5


def plane_radiance(render, lights=(), samples=1, world=(0, 0, 0), camera=None, **material):
    """Radiance of the pixel at (1/32, 1/32) of a plane at z = 0, seen from above."""
    scene = builders.scene(
        builders.quad("floor", half=50.0), materials=(builders.material(**material),), lights=lights, world=world
    )
    view = render(scene, camera or builders.camera(half_width=1 / 3), samples=samples)
    return view.channels[Channel.COMBINED][16, 16, :3]


@pytest.mark.parametrize("height", [0.5, 2.0, 30.0])
@pytest.mark.parametrize("radius", [0.0, 0.3])
def test_point_light_follows_the_inverse_square_whatever_its_radius(render, height, radius):
    """A sphere wholly above the horizon irradiates like a point: I cosθ/d²."""
    pixel = 1 / 32
    light = builders.light(position=(pixel, pixel, height), emission=(8, 4, 2), radius=radius)
    samples = 64 if radius else 1
    radiance = plane_radiance(render, (light,), samples)
    # 64 points of a low-discrepancy sequence over a smooth integrand: error well below the range over 64.
    tolerance = EXACT + (radius / height) ** 2 / 64
    np.testing.assert_allclose(radiance, RHO / np.pi * np.float64([8, 4, 2]) / height**2, rtol=tolerance)


@pytest.mark.parametrize("radius", [0.0, 0.5, 2.0])
def test_soft_falloff_is_a_disk_that_faces_the_surface(render, radius):
    """A uniform disk of radiance L overhead irradiates by π L sin² of its half angle: I/(d² + r²).

    Koksma's bound: variation of the integrand, below (r/d)² of its mean, times a discrepancy of about 2/N.
    """
    light = builders.light(position=(1 / 32, 1 / 32, 2.0), emission=(8, 8, 8), radius=radius, soft_falloff=True)
    radiance = plane_radiance(render, (light,), 128 if radius else 1)
    np.testing.assert_allclose(radiance, RHO / np.pi * 8 / (4 + radius**2), rtol=EXACT + (radius / 2) ** 2 / 64)


def test_oblique_light_falls_with_the_cosine(render):
    light = builders.light(position=(3.0 + 1 / 32, 1 / 32, 4.0), emission=(25, 25, 25))
    np.testing.assert_allclose(plane_radiance(render, (light,)), RHO / np.pi * 25 / 25 * 0.8, rtol=EXACT)


@pytest.mark.parametrize("angle", [0.0, 0.5])
def test_sun_strength_is_irradiance(render, angle):
    light = builders.light(LightKind.SUN, emission=(2, 3, 4), angle=angle)
    radiance = plane_radiance(render, (light,), 64 if angle else 1)
    np.testing.assert_allclose(radiance, RHO / np.pi * np.float64([2, 3, 4]), rtol=EXACT + angle**2 / 64)


@pytest.mark.parametrize("blend", [0.0, 0.5, 1.0])
def test_spot_cone_is_blenders_smoothstep(render, blend):
    """Cycles: smoothstep of (cosθ − cos half) / ((1 − cos half)·blend)."""
    half = 0.6
    for offset in (0.0, 0.3, 0.5, 0.58, 0.65):
        x = 2.0 * np.tan(offset)
        light = builders.light(LightKind.SPOT, (x + 1 / 32, 1 / 32, 2.0), (10, 10, 10), angle=2 * half, blend=blend)
        cosine = np.cos(offset)
        t = np.clip((cosine - np.cos(half)) / max((1 - np.cos(half)) * blend, 1e-6), 0, 1)
        expected = RHO / np.pi * 10 * cosine**3 / 4 * t * t * (3 - 2 * t)
        np.testing.assert_allclose(plane_radiance(render, (light,))[0], expected, rtol=1e-3, atol=1e-7)


def rectangle_irradiance(radiance, width, height, distance):
    """Centred parallel rectangle over a small plane; Howell, catalogue of view factors, B-3 (four quarters)."""
    a, b = 0.5 * width / distance, 0.5 * height / distance
    root_a, root_b = np.sqrt(1 + a * a), np.sqrt(1 + b * b)
    quarter = (a / root_a * np.arctan(b / root_a) + b / root_b * np.arctan(a / root_b)) / (2 * np.pi)
    return np.pi * radiance * 4 * quarter


@pytest.mark.parametrize("size", [(0.2, 0.2), (1.0, 3.0)])
def test_rectangle_area_light_has_the_closed_form_irradiance(render, size):
    light = builders.light(LightKind.AREA, (1 / 32, 1 / 32, 2.0), (5, 5, 5), size=size)
    expected = RHO / np.pi * rectangle_irradiance(5, *size, 2.0)
    np.testing.assert_allclose(plane_radiance(render, (light,), 128)[0], expected, rtol=3e-3)


def test_disk_area_light_has_the_closed_form_irradiance(render):
    """πL sin² of the half angle."""
    light = builders.light(LightKind.AREA, (1 / 32, 1 / 32, 2.0), (5, 5, 5), size=(2, 2), shape=AreaShape.ELLIPSE)
    expected = RHO / np.pi * np.pi * 5 * 1 / (1 + 4)
    np.testing.assert_allclose(plane_radiance(render, (light,), 128)[0], expected, rtol=3e-3)


def test_narrow_spread_keeps_the_flux_of_a_small_light(render):
    """The spread profile (T − tan θ)/(T − h) puts the flux of a Lambertian emitter into the cone: at the axis, the
    radiance grows by T/(T − h)."""
    half = 0.7
    arguments = {"position": (1 / 32, 1 / 32, 2.0), "emission": (5, 5, 5), "size": (1e-3, 1e-3)}
    wide = plane_radiance(render, (builders.light(LightKind.AREA, **arguments),))
    narrow = plane_radiance(render, (builders.light(LightKind.AREA, spread=2 * half, **arguments),))
    np.testing.assert_allclose(narrow / wide, np.tan(half) / (np.tan(half) - half), rtol=1e-3)


def test_area_lights_do_not_shine_backwards(render):
    light = builders.light(LightKind.AREA, (0.0, 0.0, -2.0), (5, 5, 5), size=(1, 1))
    assert not plane_radiance(render, (light,)).any()


def test_a_white_diffuse_surface_in_a_white_world_disappears(render):
    radiance = plane_radiance(render, world=(0.7, 0.7, 0.7), base_color=(1, 1, 1))
    np.testing.assert_allclose(radiance, 0.7, rtol=1e-4)


@pytest.mark.parametrize("roughness", [0.0, 0.3, 1.0])
def test_no_surface_reflects_more_than_it_receives(render, roughness):
    """Furnace: dielectric layer over white; what the layer reflects is missing below, so that 1 is never passed."""
    for tilt in (0.0, 60.0, 85.0):
        angle = np.radians(tilt)
        turned = np.eye(4)
        turned[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
        scene = builders.scene(
            builders.quad("q"),
            materials=(builders.material(base_color=(1, 1, 1), specular=0.04, roughness=roughness),),
            batches=[builders.batch("q", [turned])],
            world=(1, 1, 1),
        )
        radiance = render(scene, builders.camera(half_width=0.01)).channels[Channel.COMBINED][16, 16, :3]
        assert (radiance <= 1.0 + 1e-3).all()
        assert (radiance >= 0.9).all()


@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
def test_ggx_highlight_integrates_to_its_directional_albedo(render, roughness):
    """A sun swept over the hemisphere reflects what the albedo table says; for a white metal that is everything.

    The midpoint rule over 64 directions per half plane is second order: its error is below 1 %.
    """
    n_theta, n_phi = 64, 4
    lights = []
    for t in (np.arange(n_theta) + 0.5) / n_theta:
        theta = 0.5 * np.pi * t * t  # denser towards the narrow lobe
        weight = 2 * np.pi / n_phi * np.sin(theta) * np.pi * t / n_theta
        for phi in 2 * np.pi * (np.arange(n_phi) + 0.5) / n_phi:
            z_axis = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
            x_axis = np.cross([0, 0, 1], z_axis) / np.sin(theta)
            matrix = np.eye(4)
            matrix[:3, :3] = np.stack([x_axis, np.cross(z_axis, x_axis), z_axis], axis=1)
            lights.append(replace(builders.light(LightKind.SUN, emission=(weight,) * 3), world_from_light=matrix))
    metal = {"base_color": (1, 1, 1), "metallic": 1.0, "roughness": roughness}
    swept = plane_radiance(render, tuple(lights), **metal)
    furnace = plane_radiance(render, world=(1, 1, 1), **metal)
    np.testing.assert_allclose(swept, furnace, atol=0.01)
    np.testing.assert_allclose(furnace, 1.0, atol=2e-3)


@pytest.mark.parametrize("power", [1e-6, 1.0, 1e6])
def test_linear_in_light_power_over_twelve_orders(render, power):
    def radiance(emission):
        light = builders.light(position=(1 / 32, 1 / 32, 2.0), emission=(emission,) * 3)
        return plane_radiance(render, (light,), specular=0.04)

    np.testing.assert_allclose(radiance(power) / power, radiance(1.0), rtol=1e-3)


def test_a_light_on_the_surface_gives_a_finite_picture(render):
    for kind in (LightKind.POINT, LightKind.SPOT, LightKind.AREA):
        light = builders.light(kind, (1 / 32, 1 / 32, 0.0), (1e6, 1e6, 1e6), size=(1, 1), angle=1.0, radius=0.0)
        assert np.isfinite(plane_radiance(render, (light,))).all()


def test_emission_adds_to_reflected_light(render):
    light = builders.light(position=(1 / 32, 1 / 32, 2.0))
    lit = plane_radiance(render, (light,))
    glowing = plane_radiance(render, (light,), emission=(2.0, 0.0, 100000.0))
    # The G-buffer's emission: 11 binary digits, and 2 of 100000 still has two of them.
    np.testing.assert_allclose(glowing - lit, (2.0, 0.0, 100000.0), rtol=2**-11, atol=1e-6)


def test_emission_beyond_float32_stays_finite_and_bright(render):
    radiance = plane_radiance(render, emission=(1e39, 0.0, 1e39), samples=4)
    assert np.isfinite(radiance).all()
    assert radiance[0] > 1e20


def test_more_lights_than_a_row_of_the_table_add_up(render):
    light = builders.light(position=(1 / 32, 1 / 32, 2.0), emission=(1e-3, 1e-3, 1e-3))
    one, many = (plane_radiance(render, (light,) * count, specular=0.04) for count in (1, 600))
    np.testing.assert_allclose(many, 600 * one, rtol=1e-4)


def test_every_layer_is_lit(render):
    scene = builders.scene(
        builders.quad("front", z=0.5), builders.quad("back", z=-1.0), lights=(builders.light(position=(0, 0, 3.0)),)
    )
    view = render(scene, builders.camera(z=3.0), deep_output=True)
    for layer, distance in zip(view.layers, (2.5, 4.0), strict=True):
        np.testing.assert_allclose(layer.radiance[16, 16], RHO / np.pi * 10 / distance**2, rtol=5e-3)
