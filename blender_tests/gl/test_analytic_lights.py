# SPDX-License-Identifier: GPL-3.0-or-later
"""`shaders/common/analytic_lights.glsl`: whole lamps without sampling, against quadrature over their points."""

import numpy as np
import pytest
from glsl_functions import evaluate

from addon.scene import AreaShape, Light, LightKind

INCLUDES = ("common/analytic_lights.glsl",)
DEFINES = ("SUN_LIGHTS", "AREA_LIGHTS", "SPHERE_LIGHTS", "DISK_LIGHTS", "SPOT_CONES", "SPECULAR")
IRRADIANCE = """
vec4 evaluate() { return vec4(analytic_irradiance(fetch_light(int(place.w)), place.xyz, normal.xyz), 0); }
"""
SPECULAR = """
vec4 evaluate()
{
    Surface surface = make_surface(color.rgb, color.a, material.x, material.y, 0.0, dot(normal.xyz, view.xyz));
    return vec4(analytic_specular(fetch_light(int(place.w)), surface, place.xyz, normal.xyz, view.xyz), 0);
}
"""
BRDF = """
vec4 evaluate()
{
    Surface surface = make_surface(color.rgb, color.a, material.x, material.y, 0.0, dot(normal.xyz, view.xyz));
    return vec4(specular_brdf_cosine(surface, normal.xyz, view.xyz, direction.xyz), 0);
}
"""
GRID = 300


def turned(position, axis):
    """world_from_light of a light at `position` that shines along `axis`."""
    z = -np.asarray(axis, np.float64) / np.linalg.norm(axis)
    x = np.cross([0.3, 1.0, 0.2], z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    matrix[:3, 3] = position
    return matrix


def light(kind, position=(0.0, 0.0, 0.0), axis=(0.0, 0.0, -1.0), emission=(1.0, 2.0, 4.0), **arguments):
    return Light("light", "light", kind, turned(position, axis), emission, **arguments)


def unit_disk():
    """(N, 2) points and (N,) shares of the unit disk's area: Gauss–Legendre in r², so that the weights are exact."""
    nodes, weights = np.polynomial.legendre.leggauss(GRID)
    radius, angle = np.meshgrid(np.sqrt(0.5 * (nodes + 1.0)), 2 * np.pi * (np.arange(GRID) + 0.5) / GRID, indexing="ij")
    share = np.repeat(0.5 * weights / GRID, GRID)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1).reshape(-1, 2), share


def unit_square():
    """(N, 2) points of −1…1 squared and (N,) shares of its area."""
    nodes, weights = np.polynomial.legendre.leggauss(GRID)
    x, y = np.meshgrid(nodes, nodes, indexing="ij")
    return np.stack([x, y], axis=-1).reshape(-1, 2), np.outer(0.5 * weights, 0.5 * weights).ravel()


def basis(axis):
    x = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    return x, np.cross(axis, x)


def incident(item, position):
    """Directions (N, 3) to points of a light, and irradiance (N,) that each sends per n·l for an emission of 1."""
    rotation, center = item.world_from_light[:3, :3], item.world_from_light[:3, 3] - position
    axis = -rotation[:, 2]
    if item.kind is LightKind.AREA:
        ellipse = item.shape is AreaShape.ELLIPSE
        points, share = unit_disk() if ellipse else unit_square()
        area = item.size[0] * item.size[1] * (np.pi / 4 if ellipse else 1.0)
        to_light = center + 0.5 * points * item.size @ rotation[:, :2].T
        distance = np.linalg.norm(to_light, axis=1)
        cosine = -(to_light @ axis) / distance
        radiance = np.ones(len(share))
        if item.spread < np.pi - 1e-3:
            slope = np.tan(0.5 * item.spread)
            tangent = np.sqrt(np.maximum(1.0 - cosine**2, 0.0)) / np.maximum(cosine, 1e-9)
            radiance = np.maximum(slope - tangent, 0.0) / (slope - 0.5 * item.spread)
        return to_light / distance[:, None], radiance * np.maximum(cosine, 0.0) * area * share / distance**2
    if item.kind is LightKind.SUN:
        axis, sine, irradiance = -axis, np.sin(0.5 * item.angle), 1.0
    else:
        distance = np.linalg.norm(center)
        outer = np.hypot(distance, item.radius) if item.soft_falloff else max(distance, item.radius)
        axis, sine, irradiance = center / distance, item.radius / outer, 1.0 / outer**2
        if item.kind is LightKind.SPOT:
            edge = np.cos(0.5 * item.angle)
            t = np.clip((axis @ rotation[:, 2] - edge) / ((1.0 - edge) * item.blend), 0.0, 1.0)
            irradiance *= t * t * (3.0 - 2.0 * t)
    points, share = unit_disk()
    height = np.sqrt(1.0 - sine**2 * (points**2).sum(axis=1))
    x, y = basis(axis)
    directions = sine * (points[:, :1] * x + points[:, 1:] * y) + height[:, None] * axis
    return directions, irradiance * share / height  # a point of the disk is seen under 1/cosine of its area


LIGHTS = {
    "point": light(LightKind.POINT),
    "sphere": light(LightKind.POINT, radius=0.5),
    "facing disk": light(LightKind.POINT, radius=0.5, soft_falloff=True),
    "spot": light(LightKind.SPOT, axis=(0.3, 0.1, -1.0), angle=1.2, blend=0.4, radius=0.1),
    "narrow sun": light(LightKind.SUN, axis=(0.3, 0.1, -1.0), angle=0.0093),
    "wide sun": light(LightKind.SUN, axis=(0.3, 0.1, -1.0), angle=1.4),
    "half the sky": light(LightKind.SUN, axis=(0.3, 0.1, -1.0), angle=3.1),
    "square": light(LightKind.AREA, axis=(0.3, 0.1, -1.0), size=(1.0, 1.0)),
    "strip": light(LightKind.AREA, axis=(0.3, 0.1, -1.0), size=(3.0, 0.1)),
    "small square": light(LightKind.AREA, axis=(0.3, 0.1, -1.0), size=(0.02, 0.02)),
    "disk": light(LightKind.AREA, axis=(0.3, 0.1, -1.0), size=(1.0, 1.0), shape=AreaShape.ELLIPSE),
    "ellipse": light(LightKind.AREA, axis=(0.3, 0.1, -1.0), size=(2.0, 0.4), shape=AreaShape.ELLIPSE),
}


def places(generator, count=40):
    """Positions about a light at the origin, most below it, and normals towards it and away from it."""
    positions = generator.normal(size=(count, 3)) * [1.0, 1.0, 0.5] * generator.choice([0.5, 1.0, 4.0], (count, 1))
    positions[:, 2] = -np.abs(positions[:, 2]) - 0.2
    normals = generator.normal(size=(count, 3)) + [0.0, 0.0, 1.0]
    return positions, normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.mark.parametrize("name", LIGHTS)
def test_irradiance_is_that_of_all_points_of_the_light(name):
    item = LIGHTS[name]
    positions, normals = places(np.random.default_rng(3))
    inputs = {"place": np.column_stack([positions, np.zeros(len(positions))]), "normal": normals}
    result = evaluate(INCLUDES, IRRADIANCE, inputs, defines=DEFINES, lights=[item])[:, :3]
    expected, facing = np.empty(len(positions)), np.empty(len(positions))
    for row, (position, normal) in enumerate(zip(positions, normals, strict=True)):
        directions, weight = incident(item, position)
        expected[row] = weight @ np.maximum(directions @ normal, 0.0)
        facing[row] = weight.sum()
    error = np.abs(result / item.emission - expected[:, None])
    assert (error <= 2e-3 * expected[:, None] + 2e-4 * facing[:, None]).all(), (error.max(axis=1) / facing).max()
