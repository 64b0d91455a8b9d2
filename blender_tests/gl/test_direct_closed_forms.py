# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance under every light type against closed forms, after 64 samples: a Lambertian plane's radiance is ρ/π of it.

The plane casts shadows, so that none of this holds where it shadows itself.
"""

from dataclasses import replace

import numpy as np
import pytest
from closed_forms import (
    disk_corners,
    facing,
    polygon_irradiance,
    rectangle_corners,
    sphere_irradiance,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.scene import AreaShape, Channel, EnvironmentMap, Light, LightKind, World
from blender_tests import builders

RHO = 0.5
SAMPLES = 64
CLOSE = 2e-3
"""What the project asks for after 64 samples."""

PLACE = np.array([1 / 32, 1 / 32, 0.0])
"""World position that pixel (16, 16) of 32×32 sees."""

UP = np.array([0.0, 0.0, 1.0])


def lamp(kind, position, toward=(0.0, 0.0, -1.0), turn=0.0, emission=(5.0, 3.0, 2.0), **arguments):
    """A light at `position` from PLACE that shines along `toward`."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = facing(toward, turn), PLACE + position
    key = f"{kind} {position} {turn} {arguments}"
    return Light(key, "lamp", kind, matrix, emission, **arguments)


def lit_scene(lights=(), world=None, **material):
    """A floor at z = 0 that faces up."""
    scene = builders.scene(builders.quad("floor", half=50.0), materials=(builders.material(**material),), lights=lights)
    return scene if world is None else replace(scene, world=world)


def irradiance(session, lights=(), world=None, samples=SAMPLES, **options):
    """W/m² (3,) float64 that arrives at PLACE."""
    view = session.show(lit_scene(lights, world), builders.camera(half_width=1 / 3), samples=samples, **options)
    return view.channels[Channel.COMBINED][16, 16, :3].astype(np.float64) * np.pi / RHO


@pytest.mark.parametrize("radius", [0.0, 0.25])
@pytest.mark.parametrize("distance", [0.5, 2.0, 30.0])
def test_inverse_square(shared_session, distance, radius):
    """A sphere wholly above the horizon irradiates like a point: I cosθ/d²."""
    light = lamp(LightKind.POINT, (0.0, 0.0, distance), radius=radius)
    np.testing.assert_allclose(irradiance(shared_session, (light,)), np.float64([5, 3, 2]) / distance**2, rtol=CLOSE)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 85.0])
@pytest.mark.parametrize("soft", [False, True])
def test_cosine(shared_session, degrees, soft):
    """A sphere: I cosθ/d². A disk that faces the plane (soft falloff): π L sin²σ cosθ with sin²σ = r²/(d² + r²)."""
    angle, distance, radius = np.radians(degrees), 3.0, 0.2
    light = lamp(
        LightKind.POINT,
        (distance * np.sin(angle), 0.0, distance * np.cos(angle)),
        radius=radius,
        soft_falloff=soft,
    )
    expected = np.cos(angle) / (distance**2 + (radius**2 if soft else 0.0))
    np.testing.assert_allclose(irradiance(shared_session, (light,)), expected * np.float64([5, 3, 2]), rtol=CLOSE)


@pytest.mark.parametrize("blend", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("off_axis", [0.0, 0.25, 0.45, 0.55, 0.62])
def test_spot_falloff(shared_session, blend, off_axis):
    """Blender's smoothstep of (cosθ − cos half)/((1 − cos half)·blend); the floor faces the lamp at cosθ."""
    half, height = 0.6, 2.0
    light = lamp(LightKind.SPOT, (height * np.tan(off_axis), 0.0, height), angle=2.0 * half, blend=blend)
    cosine = np.cos(off_axis)
    share = np.clip((cosine - np.cos(half)) / max((1.0 - np.cos(half)) * blend, 1e-6), 0.0, 1.0)
    expected = share * share * (3.0 - 2.0 * share) * cosine * (cosine / height) ** 2
    found = irradiance(shared_session, (light,))
    np.testing.assert_allclose(found, expected * np.float64([5, 3, 2]), rtol=CLOSE, atol=1e-7)


@pytest.mark.parametrize("degrees", [0.0, 45.0, 80.0])
@pytest.mark.parametrize("angle", [0.0, 0.01, 0.3])
def test_sun(shared_session, degrees, angle):
    """A disc wholly above the horizon: strength times the cosine, whatever its size."""
    elevation = np.radians(degrees)
    light = lamp(LightKind.SUN, (0, 0, 0), (-np.sin(elevation), 0.0, -np.cos(elevation)), angle=angle)
    found = irradiance(shared_session, (light,))
    np.testing.assert_allclose(found, np.cos(elevation) * np.float64([5, 3, 2]), rtol=CLOSE)


AREAS = {
    "small, overhead": ((0.0, 0.0, 2.0), (0.0, 0.0, -1.0), (0.2, 0.2)),
    "large, overhead": ((0.0, 0.0, 2.0), (0.0, 0.0, -1.0), (1.0, 3.0)),
    "aside": ((1.5, -0.8, 1.2), (-0.3, 0.4, -1.0), (0.6, 1.4)),
    "tilted": ((-2.0, 0.5, 1.0), (1.0, -0.2, -0.4), (1.5, 0.7)),
}


@pytest.mark.parametrize("name", AREAS)
@pytest.mark.parametrize("shape", AreaShape)
def test_area_light_is_lamberts_polygon(shared_session, name, shape):
    position, toward, size = AREAS[name]
    light = lamp(LightKind.AREA, position, toward, turn=0.4, size=size, shape=shape)
    expected = polygon_irradiance(area_corners(light), UP)
    np.testing.assert_allclose(irradiance(shared_session, (light,)), expected * np.float64([5, 3, 2]), rtol=CLOSE)


def area_corners(light):
    """An area light's outline (V, 3) from PLACE."""
    rotation, center = light.world_from_light[:3, :3], light.world_from_light[:3, 3] - PLACE
    halves = 0.5 * light.size[0] * rotation[:, 0], 0.5 * light.size[1] * rotation[:, 1]
    return (rectangle_corners if light.shape is AreaShape.RECTANGLE else disk_corners)(center, *halves)


@settings(max_examples=25)
@given(
    azimuth=st.floats(0.0, 2.0 * np.pi),
    elevation=st.floats(0.3, 0.5 * np.pi),
    turn=st.floats(0.0, np.pi),
    size=st.tuples(st.floats(0.01, 0.8), st.floats(0.01, 0.8)),
    shape=st.sampled_from(AreaShape),
)
def test_any_area_light_above_the_horizon(shared_session, azimuth, elevation, turn, size, shape):
    direction = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    light = lamp(LightKind.AREA, 2.0 * direction, -direction, turn, size=size, shape=shape)
    expected = polygon_irradiance(area_corners(light), UP)
    np.testing.assert_allclose(irradiance(shared_session, (light,))[0], 5.0 * expected, rtol=CLOSE)


@pytest.mark.parametrize("height", [0.25, 0.1, 0.0, -0.1])
def test_area_light_that_the_horizon_cuts(shared_session, height):
    """A wall's window that reaches below the floor. Half of the samples are lost, and the cosine has a kink: the error
    of 64 points on it is first order, 1/64 of the share that the kink moves."""
    light = lamp(LightKind.AREA, (1.5, 0.3, height), (-1.0, 0.0, 0.0), size=(0.6, 0.8))
    expected = polygon_irradiance(area_corners(light), UP)
    np.testing.assert_allclose(irradiance(shared_session, (light,))[0], 5.0 * expected, rtol=1.0 / 64.0)


@pytest.mark.parametrize("cosine", [0.5, 0.2, 0.05, -0.1])
def test_sphere_that_the_horizon_cuts(shared_session, cosine):
    """Light of the part above it; for the kink, see the window."""
    distance, radius = 2.0, 0.8
    sine = np.sqrt(1.0 - cosine**2)
    light = lamp(LightKind.POINT, (distance * sine, 0.0, distance * cosine), radius=radius)
    radiance = 5.0 / (np.pi * radius**2)
    expected = sphere_irradiance(radius / distance, cosine, radiance)
    rtol = CLOSE if cosine >= radius / distance else 1.0 / 64.0
    np.testing.assert_allclose(irradiance(shared_session, (light,))[0], expected, rtol=rtol)


def test_narrow_spread_keeps_the_flux_of_a_small_light(shared_session):
    """The profile (T − tan θ)/(T − h) puts a Lambertian emitter's flux into the cone: on the axis ×T/(T − h)."""
    half = 0.7
    wide, narrow = (
        irradiance(shared_session, (lamp(LightKind.AREA, (0, 0, 2.0), size=(1e-3, 1e-3), spread=spread),))
        for spread in (np.pi, 2.0 * half)
    )
    np.testing.assert_allclose(narrow / wide, np.tan(half) / (np.tan(half) - half), rtol=CLOSE)


def test_spread_of_a_large_light(shared_session):
    """Irradiance is L ∫ (T − tan θ)/(T − h) cos²θ/r² dA, here by the midpoint rule over 400² cells."""
    half, height, size = 0.6, 2.0, 1.6
    light = lamp(LightKind.AREA, (0.3, 0.0, height), size=(size, size), spread=2.0 * half)
    axis = ((np.arange(400) + 0.5) / 400 - 0.5) * size
    x, y = np.meshgrid(axis + 0.3, axis)
    squared = x * x + y * y + height**2
    slope = np.sqrt(x * x + y * y) / height
    profile = np.maximum(np.tan(half) - slope, 0.0) / (np.tan(half) - half)
    expected = (profile * height**2 / squared**2).sum() * (size / 400) ** 2
    np.testing.assert_allclose(irradiance(shared_session, (light,))[0], 5.0 * expected, rtol=CLOSE)


def test_uniform_world(shared_session):
    """π L, from one colour and from a map of one colour alike."""
    radiance = np.float64([0.7, 0.5, 0.2])
    uniform = EnvironmentMap("uniform", "uniform", 1, np.ones((8, 16, 3), np.float32))
    for world in (World(tuple(radiance)), World(tuple(radiance), uniform)):
        np.testing.assert_allclose(irradiance(shared_session, world=world), np.pi * radiance, rtol=CLOSE)


def gradient_map(axis, height=128):
    """1 + ½ (direction · axis): irradiance on normal n is π (1 + (n · axis)/3), by the cosine's second moment."""
    elevation = ((np.arange(height) + 0.5) / height - 0.5) * np.pi
    azimuth = (0.5 - (np.arange(2 * height) + 0.5) / (2 * height)) * 2.0 * np.pi
    up, around = np.meshgrid(elevation, azimuth, indexing="ij")
    directions = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1)
    pixels = np.repeat(1.0 + 0.5 * (directions @ np.asarray(axis))[..., None], 3, axis=-1)
    return EnvironmentMap(f"gradient {axis}", "gradient", 1, pixels.astype(np.float32))


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.48, 0.64, 0.6)])
def test_gradient_world(shared_session, axis):
    world = World((1.0, 0.5, 2.0), gradient_map(axis))
    expected = np.pi * (1.0 + axis[2] / 3.0) * np.float64([1.0, 0.5, 2.0])
    np.testing.assert_allclose(irradiance(shared_session, world=world), expected, rtol=CLOSE)


def test_turned_world(shared_session):
    """`environment_from_world` maps the world's up to where the map grows."""
    to_x = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # z of the world is x of the map
    world = World((1.0, 1.0, 1.0), gradient_map((1.0, 0.0, 0.0)), to_x)
    np.testing.assert_allclose(irradiance(shared_session, world=world), np.pi * 4.0 / 3.0, rtol=CLOSE)


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.48, 0.64, 0.6)])
def test_gradient_world_of_a_preview(shared_session, axis):
    """One sample looks the irradiance up; what the lookup's smoothing costs must stay below a hundredth."""
    world = World((1.0, 1.0, 1.0), gradient_map(axis))
    found = irradiance(shared_session, world=world, samples=1)
    np.testing.assert_allclose(found, np.pi * (1.0 + axis[2] / 3.0), rtol=0.01)


EVERY_KIND = {
    "point": lamp(LightKind.POINT, (0.3, 0.0, 2.0), radius=0.3),
    "disk": lamp(LightKind.POINT, (0.3, 0.0, 2.0), radius=0.3, soft_falloff=True),
    "spot": lamp(LightKind.SPOT, (0.3, 0.0, 2.0), angle=1.0, blend=0.5, radius=0.1),
    "sun": lamp(LightKind.SUN, (0.0, 0.0, 2.0), (0.5, 0.0, -1.0), angle=0.1),
    "rectangle": lamp(LightKind.AREA, (0.3, 0.0, 2.0), size=(1.0, 0.5)),
    "ellipse": lamp(LightKind.AREA, (0.3, 0.0, 2.0), size=(1.0, 0.5), shape=AreaShape.ELLIPSE, spread=1.5),
}


@pytest.mark.parametrize("name", EVERY_KIND)
@settings(max_examples=12)
@given(exponent=st.floats(-6.0, 6.0))
def test_linear_over_twelve_orders(shared_session, name, exponent):
    """Radiance in proportion to power from 1e-6 to 1e6 W; on a glossy surface too."""
    power = 10.0**exponent

    def radiance(emission):
        light = replace(EVERY_KIND[name], emission=(emission,) * 3)
        scene = lit_scene((light,), specular=0.04, roughness=0.4)
        view = shared_session.show(scene, builders.camera(half_width=1 / 3), samples=2)
        return view.channels[Channel.COMBINED][16, 16, :3].astype(np.float64)

    one = radiance(1.0)
    assert (one > 0.0).all()
    np.testing.assert_allclose(radiance(power) / power, one, rtol=1e-3)


@pytest.mark.parametrize("power", [1e-6, 1.0, 1e6])
def test_world_is_linear_over_twelve_orders(shared_session, power):
    gradient = gradient_map((0.0, 0.0, 1.0))
    one, scaled = (
        irradiance(shared_session, world=World((strength,) * 3, gradient), samples=4) for strength in (1.0, power)
    )
    np.testing.assert_allclose(scaled / power, one, rtol=1e-3)


WIDTHS = {
    LightKind.POINT: [{"radius": 0.0}, {"radius": 0.5}, {"radius": 0.5, "soft_falloff": True}],
    LightKind.SPOT: [{"radius": 0.0, "angle": 0.0}, {"radius": 0.5, "angle": np.pi}, {"radius": 0.1, "angle": 1.0}],
    LightKind.SUN: [{"angle": 0.0}, {"angle": np.pi}, {"angle": 1e-6}],
    LightKind.AREA: [
        {"size": (0.0, 0.0)},
        {"size": (0.0, 1.0)},
        {"size": (1.0, 1.0)},
        {"size": (1.0, 1.0), "spread": 0.0},
        {"size": (1.0, 0.0), "shape": AreaShape.ELLIPSE},
    ],
}
EXTREMES = [(kind, arguments) for kind, each in WIDTHS.items() for arguments in each]


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize(("kind", "arguments"), EXTREMES)
@pytest.mark.parametrize(
    "position",
    [(0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1e-20), (0.0, 0.0, 0.3), (50.0, 50.0, 0.0)],
    ids=["on the surface", "below it", "nearly on it", "inside the sphere", "on a corner"],
)
def test_no_light_breaks_the_picture(shared_session, kind, arguments, position, samples):
    """Every pixel is finite and at least 0: lights at distance 0, inside surfaces, and of size 0 included."""
    light = lamp(kind, position, emission=(1e6, 1e6, 1e6), **arguments)
    scene = lit_scene((light,), specular=0.04, roughness=0.0)
    cube = builders.box("cube", half=0.5)
    scene = replace(scene, meshes={**scene.meshes, "cube": cube}, batches=(*scene.batches, builders.batch("cube")))
    view = shared_session.show(scene, builders.camera(half_width=1 / 3), samples=samples)
    picture = view.channels[Channel.COMBINED]
    assert np.isfinite(picture).all()
    assert (picture >= 0.0).all()


@pytest.mark.parametrize("samples", [1, 3])
def test_no_world_breaks_the_picture(shared_session, samples):
    """Maps of one texel, of zeros, and of one bright texel among zeros."""
    bright = np.zeros((4, 8, 3), np.float32)
    bright[3, 2] = 1e6
    for number, pixels in enumerate((np.ones((1, 1, 3)), np.zeros((4, 8, 3)), bright)):
        environment = EnvironmentMap(f"extreme {number}", "extreme", 1, pixels.astype(np.float32))
        scene = lit_scene(world=World((1.0, 1.0, 1.0), environment), specular=0.04, roughness=0.0)
        view = shared_session.show(scene, builders.camera(half_width=1 / 3), samples=samples)
        assert np.isfinite(view.channels[Channel.COMBINED]).all()
