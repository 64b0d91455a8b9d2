# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light as a whole: energy, emission, layers, many lights. Closed forms of each light are tests of their own."""

from dataclasses import replace

import numpy as np
import pytest

from addon.scene import Channel, LightKind
from blender_tests import builders

RHO = 0.5


def plane_radiance(render, lights=(), samples=1, world=(0, 0, 0), **material):
    """Radiance of the pixel at (1/32, 1/32) of a plane at z = 0, seen from above; every light is always there."""
    scene = builders.scene(
        builders.quad("floor", half=50.0), materials=(builders.material(**material),), lights=lights, world=world
    )
    view = render(scene, builders.camera(half_width=1 / 3), samples=samples, light_threshold=0.0)
    return view.channels[Channel.COMBINED][16, 16, :3]


def test_area_lights_do_not_shine_backwards(render):
    light = builders.light(LightKind.AREA, (0.0, 0.0, 2.0), (5, 5, 5), size=(1, 1))
    turned = light.world_from_light @ np.diag([-1.0, 1.0, -1.0, 1.0])
    for samples in (1, 4):
        assert plane_radiance(render, (light,), samples).all()
        assert not plane_radiance(render, (replace(light, world_from_light=turned),), samples).any()


@pytest.mark.parametrize(("samples", "tolerance"), [(1, 1e-4), (64, 2e-3)])
def test_a_white_diffuse_surface_in_a_white_world_disappears(render, samples, tolerance):
    """By one look at the world, and by directions of which the other half is below the plane."""
    radiance = plane_radiance(render, samples=samples, world=(0.7, 0.7, 0.7), base_color=(1, 1, 1))
    np.testing.assert_allclose(radiance, 0.7, rtol=tolerance)


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
            light = builders.light(LightKind.SUN, emission=(weight,) * 3, casts_shadow=False)
            lights.append(replace(light, world_from_light=matrix))
    metal = {"base_color": (1, 1, 1), "metallic": 1.0, "roughness": roughness}
    swept = plane_radiance(render, tuple(lights), **metal)
    furnace = plane_radiance(render, world=(1, 1, 1), **metal)
    np.testing.assert_allclose(swept, furnace, atol=0.01)
    np.testing.assert_allclose(furnace, 1.0, atol=2e-3)


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
    light = builders.light(position=(0, 0, 3.0), casts_shadow=False)
    scene = builders.scene(builders.quad("front", z=0.5), builders.quad("back", z=-1.0), lights=(light,))
    view = render(scene, builders.camera(z=3.0), deep_output=True)
    for layer, distance in zip(view.layers, (2.5, 4.0), strict=True):
        np.testing.assert_allclose(layer.radiance[16, 16], RHO / np.pi * 10 / distance**2, rtol=5e-3)
