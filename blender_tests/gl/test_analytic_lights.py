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
GRID = 200


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


def unit_disk(count=GRID):
    """(N, 2) points and (N,) shares of the unit disk's area: Gauss–Legendre in r², so that the weights are exact."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    turns = (np.arange(count) + 0.5) / count
    radius, angle = np.meshgrid(np.sqrt(0.5 * (nodes + 1.0)), 2 * np.pi * turns, indexing="ij")
    share = np.repeat(0.5 * weights / count, count)
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
    "spot": light(LightKind.SPOT, axis=(0.1, 0.1, -1.0), angle=2.4, blend=0.4, radius=0.1),
    "narrow sun": light(LightKind.SUN, axis=(0.3, 0.1, -1.0), angle=0.0093),
    "wide sun": light(LightKind.SUN, axis=(0.3, 0.1, -1.0), angle=1.4),
    "half the sky": light(LightKind.SUN, axis=(0.3, 0.1, -1.0), angle=3.1),
    "square": light(LightKind.AREA, axis=(0.3, 0.1, -1.0), size=(1.0, 1.0)),
    "strip": light(LightKind.AREA, axis=(0.3, 0.1, -1.0), size=(3.0, 0.1)),
    "small square": light(LightKind.AREA, axis=(0.3, 0.1, -1.0), size=(0.02, 0.02)),
    "disk": light(LightKind.AREA, axis=(0.3, 0.1, -1.0), size=(1.0, 1.0), shape=AreaShape.ELLIPSE),
    "ellipse": light(LightKind.AREA, axis=(0.3, 0.1, -1.0), size=(2.0, 0.4), shape=AreaShape.ELLIPSE),
}


SPREAD = {
    "spread": light(LightKind.AREA, axis=(0.3, 0.1, -1.0), size=(1.0, 1.0), spread=1.4),
    "narrow spread": light(LightKind.AREA, axis=(0.3, 0.1, -1.0), size=(1.0, 1.0), spread=0.3),
    "spread of an ellipse": light(
        LightKind.AREA, axis=(0.3, 0.1, -1.0), size=(1.0, 0.5), spread=1.0, shape=AreaShape.ELLIPSE
    ),
}


def places(count=30):
    """Positions below a light at the origin, most normals towards it."""
    generator = np.random.default_rng(3)
    positions = generator.normal(size=(count, 3)) * [1.0, 1.0, 0.5] * generator.choice([0.5, 1.0, 4.0], (count, 1))
    positions[:, 2] = -np.abs(positions[:, 2]) - 0.2
    normals = generator.normal(size=(count, 3)) + np.float64([0.0, 0.0, 1.0])
    return positions, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def irradiances(item):
    """Per place: irradiance by the shader (N, 3) and by quadrature (N,), and that of a surface facing the light."""
    positions, normals = places()
    inputs = {"place": np.column_stack([positions, np.zeros(len(positions))]), "normal": normals}
    result = evaluate(INCLUDES, IRRADIANCE, inputs, defines=DEFINES, lights=[item])[:, :3] / item.emission
    expected, facing = np.empty(len(positions)), np.empty(len(positions))
    for row, (position, normal) in enumerate(zip(positions, normals, strict=True)):
        directions, weight = incident(item, position)
        expected[row] = weight @ np.maximum(directions @ normal, 0.0)
        facing[row] = weight.sum()
    return result, expected, facing


@pytest.mark.parametrize("name", LIGHTS)
def test_irradiance_is_that_of_all_points_of_the_light(name):
    """To 0.2 %, and where the horizon cuts through the light to 0.1 % of the whole: there the quadrature has a kink,
    whose error is a fraction of a cell, 1/200, of what arrives at grazing angles."""
    result, expected, facing = irradiances(LIGHTS[name])
    error = np.abs(result - expected[:, None])
    assert (expected > 0.0).sum() > 3
    assert (error <= 2e-3 * expected[:, None] + 1e-3 * facing[:, None]).all()
    clear = expected > 0.3 * facing
    np.testing.assert_allclose(result[clear], np.repeat(expected[clear, None], 3, axis=1), rtol=2e-3)


@pytest.mark.parametrize("sine", [1e-5, 5e-3, 0.1, 0.3, 0.9])
def test_the_horizon_cuts_through_a_cone(sine):
    """At any height of its axis, against quadrature; relative to the greatest factor of those that are cut."""
    height = np.linspace(-1.2, 1.2, 25)[1:-1] * sine
    height = height[np.abs(height) < 1.0]
    body = "vec4 evaluate() { return vec4(cone_cosine_factor(cone.x, cone.y)); }"
    cones = np.column_stack([height, np.full(len(height), sine)])
    result = evaluate(INCLUDES, body, {"cone": cones}, defines=DEFINES)[:, 0]
    points, share = unit_disk(600)
    across, along = sine * points[:, 0], np.sqrt(1.0 - sine**2 * (points**2).sum(axis=1))
    expected = [(np.maximum(across * np.sqrt(1.0 - z * z) + along * z, 0.0) * share / along).sum() for z in height]
    np.testing.assert_allclose(result, expected, atol=2e-4 * sine)


def test_half_of_all_directions_light_a_tilted_surface_by_a_mean_of_its_tilt():
    """(1 + cosω)/2 for a hemisphere of uniform radiance."""
    height = np.linspace(-1.0, 1.0, 21)
    body = "vec4 evaluate() { return vec4(cone_cosine_factor(cone.x, 1.0)); }"
    result = evaluate(INCLUDES, body, {"cone": height[:, None]}, defines=DEFINES)[:, 0]
    np.testing.assert_allclose(result, 0.5 * (1.0 + height), atol=1e-4)


@pytest.mark.parametrize("name", SPREAD)
def test_spread_is_right_to_a_hundredth(name):
    """An approximation: measured, the mean error is 0.2 % to 0.9 %."""
    result, expected, _ = irradiances(SPREAD[name])
    assert (expected > 0.0).sum() > 3
    assert np.abs(result[:, 0] - expected).sum() <= 0.02 * expected.sum()


def test_a_rough_diffuse_surface_reflects_a_light_as_its_brdf_says_of_the_centre():
    item = light(LightKind.AREA, (0.5, 0.2, 2.0), (-0.3, 0.1, -1.0), size=(0.02, 0.02))
    body = """
    vec4 evaluate()
    {
        Surface surface = make_surface(color.rgb, 0.0, 0.0, 1.0, material.z, dot(normal.xyz, view.xyz));
        Light light = fetch_light(0);
        vec3 whole = analytic_diffuse(light, surface, place.xyz, normal.xyz, view.xyz);
        LightPoint center = LightPoint(vec3(0), vec3(0), 0, 0, false, 0.0);
        LightSample point = sample_light(light, place.xyz, center);
        vec3 sampled = point.weight * diffuse_brdf_cosine(surface, normal.xyz, view.xyz, point.direction);
        return vec4(whole / sampled, 0);
    }
    """
    inputs = {"place": [[0, 0, 0, 0]] * 3, "normal": [[0, 0, 1]] * 3, "view": [[0.6, 0.0, 0.8]] * 3}
    inputs |= {"color": [[0.9, 0.5, 0.2, 1.0]] * 3, "material": [[0, 1, roughness] for roughness in (0.0, 0.4, 1.0)]}
    ratio = evaluate(INCLUDES, body, inputs, defines=(*DEFINES, "DIFFUSE_ROUGHNESS"), lights=[item])
    np.testing.assert_allclose(ratio[:, :3], 1.0, rtol=1e-3)


MATERIALS = {"metal": ((0.9, 0.6, 0.2, 0.04), 1.0), "plastic": ((0.0, 0.0, 0.0, 0.04), 0.0)}


def highlights(item, roughness, color, metallic):
    """Per point of a floor below a light: radiance by the shader and by quadrature, each (N, 3)."""
    count = 12
    positions = np.stack(
        [np.linspace(-3.0, 3.0, count), np.tile([-2.0, -1.0, 0.5], count // 3), np.full(count, -2.0)], 1
    )
    views = np.float64([0.0, -5.0, 0.5]) - positions
    views /= np.linalg.norm(views, axis=1, keepdims=True)
    normal, surface = np.float64([0.0, 0.0, 1.0]), {"color": color, "material": (metallic, roughness)}

    def rows(values, length):
        return {name: np.tile(value, (length, 1)) for name, value in values.items()}

    places_and_views = {"place": np.column_stack([positions, np.zeros(count)]), "view": views}
    result = evaluate(
        INCLUDES,
        SPECULAR,
        places_and_views | rows({"normal": normal, **surface}, count),
        defines=DEFINES,
        lights=[item],
    )
    expected = np.empty((count, 3))
    for row in range(count):
        directions, weight = incident(item, positions[row])
        inputs = rows({"normal": normal, "view": views[row], **surface}, len(directions))
        brdf = evaluate(INCLUDES, BRDF, {"direction": directions, **inputs}, defines=DEFINES, lights=[item])
        expected[row] = weight @ brdf[:, :3].astype(np.float64)
    return result[:, :3] / item.emission, expected


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize(
    ("name", "roughness", "bound"),
    [
        ("sphere", 0.3, 0.03),
        ("facing disk", 0.8, 0.02),
        ("square", 0.3, 0.03),
        ("square", 0.8, 0.02),
        ("ellipse", 0.5, 0.08),
        ("half the sky", 0.4, 0.1),
    ],
)
def test_highlights_of_large_lights_are_those_of_linearly_transformed_cosines(name, roughness, bound, material):
    """An approximation of the lobe's shape: the bounds are a little above what is measured."""
    result, expected = highlights(LIGHTS[name], roughness, *MATERIALS[material])
    assert np.abs(result - expected).sum() <= bound * expected.sum()


@pytest.mark.parametrize("name", ["point", "small square", "narrow sun"])
def test_highlights_of_small_lights_are_those_of_their_centres(name):
    """Against quadrature; the lobe is 0.36 wide, so that what is taken as one direction differs by 1e-3 at most."""
    result, expected = highlights(LIGHTS[name], 0.6, *MATERIALS["metal"])
    np.testing.assert_allclose(result, expected, rtol=3e-3)


def test_a_light_all_around_is_reflected_by_the_albedo():
    """A luminous ceiling so near that it fills the sky; the fitted lobes have 2 % of their light below the horizon."""
    ceiling = light(LightKind.AREA, (0.0, 0.0, 1e-3), emission=(1.0, 1.0, 1.0), size=(100.0, 100.0))
    for roughness in (0.1, 0.5, 1.0):
        inputs = {"place": [[0, 0, 0, 0]], "normal": [[0, 0, 1]], "view": [[0.6, 0.0, 0.8]]}
        inputs |= {"color": [[1.0, 1.0, 1.0, 0.0]], "material": [[1.0, roughness]]}
        result = evaluate(INCLUDES, SPECULAR, inputs, defines=DEFINES, lights=[ceiling])
        np.testing.assert_allclose(result[0, :3], 1.0, atol=0.03)


def test_a_light_behind_the_surface_or_turned_away_gives_nothing():
    items = [
        light(LightKind.POINT, (0.0, 0.0, -2.0), radius=0.5),
        light(LightKind.AREA, (0.0, 0.0, 2.0), (0, 0, 1), size=(1, 1)),
    ]
    items += [
        light(LightKind.AREA, (0.0, 0.0, -2.0), (0.0, 0.0, 1.0), size=(9, 9)),
        light(LightKind.SUN, axis=(0, 0, 1), angle=1.0),
    ]
    place = np.column_stack([np.zeros((len(items), 3)), np.arange(len(items))])
    rows = {"normal": (0, 0, 1), "view": (0.6, 0, 0.8), "color": (1, 1, 1, 0.04), "material": (0.5, 0.3)}
    inputs = {"place": place} | {name: np.tile(row, (len(items), 1)) for name, row in rows.items()}
    assert not evaluate(INCLUDES, IRRADIANCE, inputs, defines=DEFINES, lights=items)[:, :3].any()
    assert not evaluate(INCLUDES, SPECULAR, inputs, defines=DEFINES, lights=items)[:, :3].any()


def test_no_place_or_light_gives_nan():
    """Every light without size, of tiny and of great size, seen from its centre, its plane, its rim and far away."""
    sizes = (0.0, 1e-12, 1e-3, 1.0, 1e4)
    items = [
        light(kind, radius=size, soft_falloff=soft, angle=1.0, blend=0.0)
        for kind in (LightKind.POINT, LightKind.SPOT)
        for size in sizes
        for soft in (False, True)
    ]
    items += [
        light(LightKind.AREA, size=(x, y), shape=shape, spread=spread)
        for x in sizes
        for y in sizes
        for shape in AreaShape
        for spread in (0.0, 1.0, np.pi)
    ]
    items += [light(LightKind.SUN, angle=angle) for angle in (0.0, 1e-6, 1.0, np.pi)]
    spots = np.float64([[0, 0, 0], [0, 0, -1e-12], [0, 0, -1], [1, 0, 0], [0.5, 0, 0], [0.5, 0, -1e-6], [3, 2, -1e5]])
    normals = np.float64([[0, 0, 1], [1, 0, 0], [0, 0, -1]])
    views = np.float64([[0, 0, 1], [1, 0, 0], [-0.6, 0, 0.8]])
    index, spot, normal, view = np.meshgrid(*(np.arange(len(group)) for group in (items, spots, normals, views)))
    inputs = {
        "place": np.column_stack([spots[spot.ravel()], index.ravel()]),
        "normal": normals[normal.ravel()],
        "view": views[view.ravel()],
    }
    count = index.size
    generator = np.random.default_rng(2)
    inputs["color"] = generator.choice([0.0, 0.04, 1.0], (count, 4))
    inputs["material"] = generator.choice([0.0, 0.03, 0.5, 1.0], (count, 2))
    for body, defines in ((IRRADIANCE, DEFINES), (SPECULAR, DEFINES), (SPECULAR, (*DEFINES, "PHONG"))):
        result = evaluate(INCLUDES, body, inputs, defines=defines, lights=items)[:, :3]
        assert not np.isnan(result).any()
        assert (result >= 0.0).all()
        assert np.isfinite(result[np.abs(inputs["place"][:, 2]) > 1e-3]).all()
