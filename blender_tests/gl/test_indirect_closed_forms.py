# SPDX-License-Identifier: GPL-3.0-or-later
"""Indirect light that has a closed form, or that symmetry ties to another picture's."""

from dataclasses import replace

import numpy as np
import pytest
from closed_forms import polygon_irradiance, rectangle_corners

from addon.scene import EmissionSampling, IndirectMethod, IndirectSettings, LightKind
from addon.scene.indirect import RAY_METHODS
from blender_tests import builders
from blender_tests.indirect_scenes import (
    CORNELL_CAMERA,
    GRID,
    UNFILTERED,
    cornell,
    glowing,
    looking,
    of,
    placed,
    radiance,
    rectangle,
    relative_difference,
    seen,
    seen_from,
    sphere,
)

FLOAT_NOISE = 1e-3
"""Relative: of float32 in sums over rays, cells and bounces, and of what cells keep in 16 bits."""

METHODS = [method for method in IndirectMethod if method is not IndirectMethod.NONE]


# --- Closed rooms -----------------------------------------------------------------------------------------------------


def furnace(albedo, sampling=EmissionSampling.NONE):
    """A closed cube of 2 m whose walls all shine with radiance 1."""
    return of((builders.box("furnace"), glowing(emission=1.0, albedo=albedo, sampling=sampling)))


def in_furnace(session, albedo, bounces, sampling=EmissionSampling.NONE, indirect=GRID, samples=8):
    """What a camera in the middle of it sees (H, W): a wall with its corners."""
    picture = radiance(
        session,
        furnace(albedo, sampling),
        looking((0.1, -0.2, 0.05), (0.0, 1.0, 0.0)),
        replace(indirect, bounces=bounces),
        samples=samples,
        size=32,
    )
    return picture[..., 0]


@pytest.mark.parametrize("albedo", [0.2, 0.5, 0.8, 0.95, 0.99])
def test_a_white_furnace_has_one_radiance_everywhere(shared_session, albedo):
    """L_e/(1 − ρ), which it nears from below."""
    found = in_furnace(shared_session, albedo, None)
    full = 1.0 / (1.0 - albedo)
    assert found.mean() == pytest.approx(full, rel=0.02)
    assert found.mean() <= full * (1.0 + FLOAT_NOISE)


@pytest.mark.parametrize("cell_size", [0.0884, 0.0462, 0.0163])
def test_no_light_leaves_a_white_furnace_however_large_its_cells_are(shared_session, cell_size):
    """Cells that no more than a strip of a wall is in have its surface, too: with an albedo of .99 a hole of a
    hundredth of a percent takes one percent of the light."""
    found = in_furnace(shared_session, 0.99, None, indirect=replace(GRID, cell_size=cell_size))
    assert found.mean() == pytest.approx(100.0, rel=0.02)
    assert found.mean() <= 100.0 * (1.0 + FLOAT_NOISE)


@pytest.mark.parametrize("albedo", [0.5, 0.95])
def test_each_bounce_adds_the_next_power_of_the_albedo(shared_session, albedo):
    """After n bounces, the emitter's light was reflected n + 1 times at most: Σ_{k ≤ n+1} ρᵏ L_e, and never more."""
    counts = (1, 2, 6, None)
    found = [in_furnace(shared_session, albedo, bounces, samples=2).mean() for bounces in counts]
    assert (np.diff(found) > 0.0).all()
    for bounces, mean in zip(counts[:-1], found, strict=False):
        least, most = (sum(albedo**k for k in range(bounces + extra)) for extra in (1, 2))
        assert least * 0.98 <= mean <= most * (1.0 + FLOAT_NOISE), bounces


@pytest.mark.parametrize("albedo", [0.5, 0.95])
def test_emission_that_is_sampled_as_a_light_is_not_gathered_as_well(shared_session, albedo):
    """The picture is the same as where it is gathered alone, but for what `direct` loses or has as noise, which a
    series of reflections multiplies by no more than 1/(1 − ρ)."""
    samples = 32
    unlit = IndirectSettings()
    sampled = in_furnace(shared_session, albedo, None, EmissionSampling.AUTO, samples=samples)
    direct = in_furnace(shared_session, albedo, None, EmissionSampling.AUTO, unlit, samples)
    lost = abs(1.0 + albedo - direct.mean()) / (1.0 - albedo)
    full = 1.0 / (1.0 - albedo)
    assert lost < 0.15 * full, "else this test can tell nothing"
    assert sampled.mean() == pytest.approx(full, abs=0.02 * full + lost)


@pytest.mark.parametrize("albedo", [0.3, 0.5, 0.8])
def test_a_lamp_in_a_ball(shared_session, albedo):
    """Ulbricht's sphere: whatever is reflected arrives evenly everywhere, E = Φ ρ/((1 − ρ) 4π r²), and Φ = 4π I of the
    lamp in its middle."""
    radius, intensity = 2.0, 3.0
    scene = of(
        (sphere("ball", radius, inwards=True), builders.material(base_color=(albedo,) * 3)),
        lights=(builders.light(LightKind.POINT, (0.0, 0.0, 0.0), emission=(intensity,) * 3),),
    )
    camera = looking((0.3, -0.5, 0.2), (0.0, 2.0, 0.0))
    found, _, _ = seen(shared_session, scene, camera, replace(GRID, bounces=None), size=32)
    irradiance = 4.0 * np.pi * intensity * albedo / (1.0 - albedo) / (4.0 * np.pi * radius**2)
    assert found.mean() == pytest.approx(albedo / np.pi * irradiance, rel=0.02)


# --- Form factors -----------------------------------------------------------------------------------------------------

RHO = 0.5
PLATES = {
    "parallel, half their width apart": ((0.0, 0.0, 0.5), (0.5, 0.0, 0.0), (0.0, -0.5, 0.0)),
    "parallel, their width apart": ((0.0, 0.0, 1.0), (0.5, 0.0, 0.0), (0.0, -0.5, 0.0)),
    "parallel, twice as far": ((0.0, 0.0, 2.0), (0.5, 0.0, 0.0), (0.0, -0.5, 0.0)),
    "perpendicular, with an edge in common": ((-0.5, 0.0, 0.5), (0.0, 0.5, 0.0), (0.0, 0.0, 0.5)),
    "perpendicular, apart": ((-1.0, 0.0, 0.7), (0.0, 0.5, 0.0), (0.0, 0.0, 0.5)),
}
"""Centre and half axes of the plate that shines on a square of 1 m at the origin."""


def plate_irradiance(points, center, half_x, half_y):
    """(N,) of a plate of radiance 1 on points (N, 3) that face up."""
    corners = rectangle_corners(center, half_x, half_y)
    return np.array([polygon_irradiance(corners - point, np.array([0.0, 0.0, 1.0])) for point in points])


def on_the_receiver(session, scene, camera, indirect, **settings):
    """(irradiance (N,), points (N, 3), what area each shows (N,)): of the second object, which faces up."""
    found, points, index = seen(session, scene, camera, indirect, **settings)
    shown = index == 2
    assert shown.sum() > 100
    points = points[shown]
    away = points - camera.position
    depth = away @ -camera.world_from_camera[:3, 2]
    return found[shown, 0] * np.pi / RHO, points, depth**3 / np.abs(away[:, 2])  # pixels are of equal size at depth 1


@pytest.mark.parametrize("name", PLATES)
@pytest.mark.parametrize(("filtered", "limit"), [(False, 0.03), (True, 0.05)], ids=["as gathered", "filtered"])
def test_form_factors(shared_session, name, filtered, limit):
    """Lambert's polygon, whose mean over the square is the form factor, within 3 %; where pixels share what they gather
    and smooth it, a few more are lost at the square's edges."""
    center, half_x, half_y = PLATES[name]
    scene = of(
        (rectangle("plate", center, half_x, half_y), glowing()),
        (rectangle("square", (0, 0, 0), (0.5, 0, 0), (0, 0.5, 0)), builders.material(base_color=(RHO,) * 3)),
    )
    camera = looking((0.5, -2.0, 0.45), (0.0, 0.0, 0.1), half_width=0.32)
    indirect = replace(GRID if filtered else UNFILTERED, bounces=1)
    found, points, area = on_the_receiver(shared_session, scene, camera, indirect, samples=32)
    expected = plate_irradiance(points, center, half_x, half_y)
    assert (area @ found) / (area @ expected) == pytest.approx(1.0, abs=limit)
    for quarter in np.arange(-0.5, 0.5, 0.25):
        there = (points[:, 0] >= quarter) & (points[:, 0] < quarter + 0.25)
        assert found[there].sum() == pytest.approx(expected[there].sum(), rel=0.1), "the light must be where it belongs"


@pytest.mark.parametrize("toward", [1.0, -1.0], ids=["lit in front", "lit behind"])
def test_a_wall_by_a_lit_floor(shared_session, toward):
    """A floor under a vertical sun irradiates a wall, which the sun grazes, as a plate of radiance ρE/π; a wall that
    turns its back to the floor gets nothing of it."""
    sun = builders.light(LightKind.SUN, (0.0, 0.0, 5.0), emission=(1.0, 1.0, 1.0))
    floor = rectangle("floor", (0, 0, 0), (0.5, 0, 0), (0, 0.5, 0))
    wall = rectangle("wall", (-0.5 * toward, 0, 0.52), (0, 0.5, 0), (0, 0, 0.5))
    white, gray = builders.material(base_color=(RHO,) * 3), builders.material("gray", base_color=(0.2,) * 3)
    scene = of((floor, white), (wall, gray), lights=(sun,))
    camera = looking((2.0, -0.6, 0.9), (-0.5 * toward, 0.0, 0.5), half_width=0.3)
    found, points, index = seen(shared_session, scene, camera, replace(UNFILTERED, bounces=1), samples=16)
    shown = index == 2
    corners = rectangle_corners((0, 0, 0), (0.5, 0, 0), (0, 0.5, 0))
    normal = np.array([1.0, 0.0, 0.0])
    expected = np.array([polygon_irradiance(corners - point, normal, RHO / np.pi) for point in points[shown]])
    irradiance = found[shown, 0] * np.pi / 0.2
    assert shown.sum() > 100
    assert irradiance.sum() == pytest.approx(expected.sum(), rel=0.03, abs=1e-3 * shown.sum())


# --- A sphere on a plane ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("numbers", "nearest"),
    [({}, 1.0), ({"cells": 192, "contact_steps": 0}, 0.6)],
    ids=["medium", "fine cells"],
)
def test_a_ball_on_a_plane_under_a_white_world(shared_session, numbers, nearest):
    """The ball touches the plane, so that none of it is below the horizon: of the hemisphere weighted by its cosine it
    covers sin²σ cosθ = (r/D)³, D from the point to its middle. Cells of an eighth of its radius do not know its shape
    below it: nearer than `nearest` radii to where it stands, finer ones are needed."""
    radius = 0.5
    scene = of(
        (rectangle("plane", (0, 0, 0), (4, 0, 0), (0, 4, 0)), builders.material(base_color=(RHO,) * 3)),
        (sphere("ball", radius, (0.0, 0.0, radius)), builders.material("black", base_color=(0.0,) * 3)),
        world=(1.0, 1.0, 1.0),
    )
    camera = looking((0.0, -4.0, 2.0), (0.0, -0.4, 0.2), half_width=0.35)
    found, points, index = seen(shared_session, scene, camera, replace(UNFILTERED, **numbers), samples=16)
    distance = np.linalg.norm(points[..., :2], axis=-1) / radius
    openness = found[..., 0] / RHO
    covered = (1.0 + distance**2) ** -1.5
    for least, most in ((0.6, 1.0), (1.0, 1.5), (1.5, 2.0), (2.0, 3.0)):
        ring = (index == 1) & (distance >= least) & (distance < most)
        assert ring.sum() > 20
        if least >= nearest:
            assert openness[ring].mean() == pytest.approx((1.0 - covered[ring]).mean(), rel=0.03), (least, most)
    near = (index == 1) & (distance >= nearest) & (distance < 3.0)
    assert (1.0 - openness[near]).sum() == pytest.approx(covered[near].sum(), rel=0.03)


# --- What leaves a picture as it is -----------------------------------------------------------------------------------

LAMP = builders.light(LightKind.POINT, (0.1, -0.2, 0.6), emission=(1.0, 0.8, 0.6))


def settings_of(method, **numbers):
    """Of a method, so short that a picture takes no time."""
    return IndirectSettings(method, divisor=1, spatial_filter=False, temporal_filter=False, cells=32, **numbers)


def world_lit(method):
    """Whether the method finds light of nothing but the world."""
    return method in (IndirectMethod.OCCLUSION, IndirectMethod.SSAO)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("factor", [1e6, 1e-6])
def test_light_is_linear_in_power(shared_session, method, factor):
    """Of lamps, emission and the world alike."""
    pictures = []
    for power in (1.0, factor):
        lamp = replace(LAMP, emission=tuple(power * channel for channel in LAMP.emission))
        scene = cornell(lamp)
        scene = replace(scene, world=replace(scene.world, radiance=(0.2 * power, 0.1 * power, 0.3 * power)))
        pictures.append(radiance(shared_session, scene, CORNELL_CAMERA, settings_of(method), samples=2) / power)
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=1e-3, atol=1e-3 * pictures[0].mean())


@pytest.mark.parametrize("factor", [1e6, 1e-6])
def test_light_is_linear_in_emission(shared_session, factor):
    pictures = [
        radiance(
            shared_session, cornell(emission=power), CORNELL_CAMERA, settings_of(IndirectMethod.MARCH_GRID), samples=2
        )
        / power
        for power in (1.0, factor)
    ]
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=1e-3, atol=1e-3 * pictures[0].mean())


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("factor", [2.0**-10, 2.0**10, 300.0])
def test_a_larger_world_with_stronger_lamps_looks_the_same(shared_session, method, factor):
    """×s with lamps ×s². A power of two changes no float's rounding but that of what is not a length; for another
    factor, cells of another share of the view are chosen."""
    matrix = np.diag([factor, factor, factor, 1.0])
    lamp = replace(LAMP, emission=tuple(factor**2 * channel for channel in LAMP.emission))
    scene = replace(cornell(LAMP), world=replace(cornell(LAMP).world, radiance=(0.2, 0.1, 0.3)))
    large = placed(replace(scene, lights=(lamp,)), matrix)
    one, other = (
        radiance(
            shared_session, shown, camera, settings_of(method, radius=size), samples=2, minimum_separation=0.5 * size
        )
        for shown, camera, size in ((scene, CORNELL_CAMERA, 1.0), (large, seen_from(CORNELL_CAMERA, matrix), factor))
    )
    assert relative_difference(other, one) < (5e-3 if factor in (2.0**-10, 2.0**10) else 0.02)


def noise_of(session, scene, camera, indirect, samples):
    """Relative difference of two pictures whose random numbers differ."""
    one, other = (radiance(session, scene, camera, indirect, samples=samples, seed=seed) for seed in (0, 1))
    return relative_difference(one, other)


MEAN_NOISE = {
    IndirectMethod.OCCLUSION: 8e-4,
    IndirectMethod.SSAO: 2e-4,
    IndirectMethod.RADIOSITY: 6e-3,
    IndirectMethod.DEEP_MARCH: 3e-3,
    IndirectMethod.MARCH_GRID: 1e-3,
}
"""Relative standard deviation of the difference of two such pictures' means, of 32 samples: all pixels share a sample's
shift, so that their noise does not average out among them. Estimated from pairs of three seeds, rounded up."""


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("quarters", [1, 2])
def test_a_camera_that_is_rolled_shows_the_same_light(shared_session, method, quarters):
    """By quarters of a turn every pixel shows the same point: what differs is noise, of which four times as many
    samples leave about half, and the means differ by no more than three standard deviations of theirs."""
    scene = replace(cornell(LAMP), world=replace(cornell().world, radiance=(0.2, 0.1, 0.3)))
    rolled = looking((0.0, -3.6, 0.0), (0.0, 0.0, 0.0), half_width=0.38, roll=0.5 * np.pi * quarters)
    differences = []
    for samples in (8, 32):
        upright, _, things = seen(shared_session, scene, CORNELL_CAMERA, settings_of(method), samples=samples, size=32)
        other, _, turned_things = seen(shared_session, scene, rolled, settings_of(method), samples=samples, size=32)
        same = things == np.rot90(turned_things, -quarters)  # at an edge, either side may be seen
        assert same.mean() > 0.9
        turned = np.rot90(other, -quarters)
        differences.append(relative_difference(turned[same], upright[same]))
    assert differences[1] < 0.65 * differences[0] + 1e-3
    assert abs(turned[same].mean() / upright[same].mean() - 1.0) < 3.0 * MEAN_NOISE[method]


@pytest.mark.parametrize("degrees", [15.0, 45.0])
def test_a_camera_that_looks_elsewhere_shows_the_same_light(shared_session, degrees):
    """Points that two turned cameras both see have the light that they had; only that is in view changes."""
    scene, indirect = cornell(LAMP), replace(settings_of(IndirectMethod.MARCH_GRID), cell_size=0.1)
    eye, angle = np.array([0.0, -0.9, 0.0]), np.radians(degrees)
    pictures = []
    for turn in (-0.5 * angle, 0.5 * angle):
        camera = looking(eye, eye + np.array([np.sin(turn), np.cos(turn), 0.0]))
        found, points, index = seen(shared_session, scene, camera, indirect, samples=24)
        pictures.append((found[index == 3].mean(axis=-1), points[index == 3]))
    compared = [
        [light[(np.abs(points[:, 0] - x) < 0.1) & (np.abs(points[:, 2]) < 0.7)] for light, points in pictures]
        for x in np.arange(-0.9, 1.0, 0.2)
    ]
    compared = [(one.mean(), other.mean()) for one, other in compared if min(len(one), len(other)) > 20]
    assert len(compared) >= 3
    one, other = np.array(compared).T
    np.testing.assert_allclose(other, one, rtol=0.05)


@pytest.mark.parametrize("share", [0.5, 0.25])
def test_where_cells_lie_does_not_matter(shared_session, share):
    """The scene and its camera moved by part of a cell, on all three axes."""
    cell = 0.125
    indirect = replace(settings_of(IndirectMethod.MARCH_GRID), cell_size=cell)
    matrix = builders.translation(*(share * cell,) * 3)
    scene, samples = cornell(LAMP), 16
    here = radiance(shared_session, scene, CORNELL_CAMERA, indirect, samples=samples)
    there = radiance(
        shared_session, placed(scene, matrix), seen_from(CORNELL_CAMERA, matrix), indirect, samples=samples
    )
    noise = noise_of(shared_session, scene, CORNELL_CAMERA, indirect, samples)
    assert relative_difference(there, here) < 1.5 * noise + 0.01
    assert abs(there.mean() / here.mean() - 1.0) < 0.01


@pytest.mark.parametrize("method", sorted(RAY_METHODS))
def test_more_samples_remove_noise(shared_session, method):
    """Every sample has other rays, of low discrepancy: four times as many leave at most 0.6 of the noise, where as many
    independent ones left 0.5."""
    scene, indirect = cornell(), replace(settings_of(method), rays=2)
    few, many = (noise_of(shared_session, scene, CORNELL_CAMERA, indirect, samples) for samples in (4, 16))
    assert 0.0 < many < 0.6 * few
