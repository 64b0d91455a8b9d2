# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays marched through layers: against the same march in numpy, exact rays, and light that has a closed form."""

from dataclasses import replace

import numpy as np
import pytest
from closed_forms import polygon_irradiance, rectangle_corners
from marching import march_in_numpy, march_on_gpu

from addon.scene import DebugView, IndirectMethod, IndirectSettings
from blender_tests import builders
from blender_tests.indirect_scenes import block, glowing, looking, of, radiance, rectangle, seen

MARCH = IndirectSettings(
    IndirectMethod.DEEP_MARCH, bounces=1, divisor=1, spatial_filter=False, temporal_filter=False, march_steps=64
)
INF = np.inf


def unit(vectors):
    """Vectors (N, 3) of length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def place(camera, size, x, y, depth):
    """Relative positions (N, 3) of pixel coordinates (N,) at view depths (N,)."""
    left, right, bottom, top = camera.window
    points = np.stack([left + x / size[0] * (right - left), bottom + y / size[1] * (top - bottom)], axis=-1)
    points = points * (1.0 if camera.orthographic else np.asarray(depth)[:, None])
    return np.concatenate([points, -np.asarray(depth)[:, None]], axis=-1) @ camera.rotation.T


def random_rays(generator, camera, depth, count):
    """Origins (N, 3) somewhat before what pixels show, and directions (N, 3)."""
    _, height, width = depth.shape
    x, y = generator.integers(0, width, count), generator.integers(0, height, count)
    shown = depth[0, y, x].astype(np.float64)
    shown = np.where(np.isfinite(shown), shown, 2.0 * depth[np.isfinite(depth)].max()) * 0.999
    return place(camera, (width, height), x + 0.5, y + 0.5, shown), unit(generator.normal(size=(count, 3)))


def random_layers(generator, layers, size, scale):
    """Blocks of depth (layers, H, W) some of which are empty, and exits behind them or nowhere."""
    blocks = generator.uniform(1.0, 4.0, (layers, 4, 4)).cumsum(axis=0) * scale
    blocks[generator.random(blocks.shape) < 0.15] = INF
    ramp = 1.0 + 0.2 * generator.random((size, size))
    depth = np.kron(np.sort(blocks, axis=0), np.ones((size // 4, size // 4))) * ramp
    exits = depth + generator.uniform(0.05, 2.0, depth.shape) * scale
    exits[generator.random(depth.shape) < 0.3] = INF
    backs = generator.random(depth[1:].shape) < 0.3
    exits[:-1][backs] = depth[1:][backs]
    return depth.astype(np.float32), exits.astype(np.float32)


@pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("layers", [1, 2, 3])
@pytest.mark.parametrize("with_exits", [False, True], ids=["sheets", "solids"])
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e6])
def test_it_is_the_march_in_numpy(orthographic, layers, with_exits, scale):
    """Where float32 cannot decide otherwise; a pixel's number and a depth are known to 1e-3 and 1e-5 of themselves."""
    generator = np.random.default_rng(layers)
    size, count = 32, 400
    camera = builders.camera(z=0.0, half_width=3.0 * scale if orthographic else 0.7, orthographic=orthographic)
    depth, exits = random_layers(generator, layers, size, scale)
    origins, directions = random_rays(generator, camera, depth, count)
    arguments = {
        "reach": generator.choice([0.5 * scale, 3.0 * scale, 1e30], count),
        "steps": int(generator.choice([1, 5, 16])),
        "jitter": generator.random(count),
    }
    exits = exits if with_exits else None
    found = march_on_gpu(camera, depth, exits, origins, directions, **arguments)
    expected = march_in_numpy(camera, depth, exits, origins, directions, **arguments)
    sure = ~expected.unsure
    assert sure.mean() > 0.5, "else this test can tell nothing"
    assert 0.05 < expected.hit[sure].mean() < 0.95
    for name in ("hit", "ended", "hidden", "layer", "pixel"):
        np.testing.assert_array_equal(getattr(found, name)[sure], getattr(expected, name)[sure], err_msg=name)
    np.testing.assert_allclose(found.distance[sure], expected.distance[sure], rtol=2e-3)
    assert np.isfinite(found.distance).all()
    assert (found.distance <= arguments["reach"] * (1.0 + 1e-5)).all()


def test_nothing_beyond_its_reach_is_met():
    camera, depth = builders.camera(z=0.0, half_width=1.0), np.full((1, 32, 32), 4.0, np.float32)
    origins = place(camera, (32, 32), np.full(3, 16.5), np.full(3, 16.5), np.full(3, 2.0))
    directions = unit(np.tile((0.3, 0.0, -1.0), (3, 1)))
    length = 2.0 * np.sqrt(1.0 + 0.3**2)  # to the wall
    found = march_on_gpu(
        camera, depth, None, origins, directions, reach=np.array([0.9, 1.1, 1e30]) * length, steps=32, jitter=0.0
    )
    assert found.hit.tolist() == [False, True, True]
    assert not found.ended.any()
    assert found.distance[0] == pytest.approx(0.9 * length)


def test_the_screen_ends():
    camera, depth = builders.camera(z=0.0, half_width=1.0), np.full((1, 32, 32), INF, np.float32)
    origins = place(camera, (32, 32), np.full(2, 16.0), np.full(2, 16.0), np.full(2, 2.0))
    directions = np.array([(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
    found = march_on_gpu(camera, depth, None, origins, directions, reach=10.0, steps=8, jitter=0.0)
    assert found.ended.all()
    assert not found.hit.any()
    assert found.distance[0] == pytest.approx(2.0), "the window's edge at this depth"
    assert found.distance[1] == pytest.approx(2.0, rel=1e-3), "the eye"


# --- What layers and exits are for ------------------------------------------------------------------------------------


def post_before_a_wall():
    """(2, 32, 32) depths and exits: a post in the middle, 0.2 m thick, 3 m before a wall; behind it a block."""
    depth = np.full((2, 32, 32), INF, np.float32)
    exits = np.full((2, 32, 32), INF, np.float32)
    depth[0] = 5.0
    depth[0, :, 12:20], exits[0, :, 12:20] = 2.0, 2.2
    depth[1, :, 12:20] = 5.0
    depth[1, :, 14:18], exits[1, :, 14:18] = 3.5, 3.9
    return depth, exits


@pytest.mark.parametrize(("layers", "with_exits", "hit_layer"), [(2, True, 1), (1, True, None), (2, False, 1)])
def test_the_second_layer_has_what_a_post_hides(layers, with_exits, hit_layer):
    """A ray that passes behind the post meets the block that it hides, if that is known."""
    camera = builders.camera(z=0.0, half_width=1.0)
    depth, exits = post_before_a_wall()
    origins = place(camera, (32, 32), np.array([4.5]), np.array([16.5]), np.array([3.7]))
    found = march_on_gpu(
        camera,
        depth[:layers],
        exits[:layers] if with_exits else None,
        origins,
        np.array([(1.0, 0.0, 0.0)]),
        reach=5.5,
        steps=64,
        jitter=0.5,
    )
    assert found.hit.tolist() == [hit_layer is not None]
    if hit_layer is not None:
        assert found.layer[0] == hit_layer
        assert 14 <= found.pixel[0, 0] < 18


@pytest.mark.parametrize("thickness", [0.05, 1.0])
def test_exits_say_how_thick_a_sheet_is(thickness):
    """With them a ray passes behind the post unless it is as thick as it is far away; without them few steps make it
    as thick as they are wide."""
    camera = builders.camera(z=0.0, half_width=1.0)
    depth, exits = post_before_a_wall()
    depth, exits = depth[:1], exits[:1]
    exits[:, :, 12:20] = 2.0 + thickness
    origins = place(camera, (32, 32), np.array([4.5]), np.array([16.5]), np.array([2.3]))
    arguments = {"reach": 2.5, "steps": 6, "jitter": 0.5}
    found = march_on_gpu(camera, depth, exits, origins, np.array([(1.0, 0.0, 0.0)]), **arguments)
    assert found.hit.tolist() == [thickness > 0.3]
    assert march_on_gpu(camera, depth, None, origins, np.array([(1.0, 0.0, 0.0)]), **arguments).hit.all()


@pytest.mark.parametrize("layers", [1, 2])
def test_a_surface_without_thickness_is_not_passed_through(layers):
    """Steep walls change their depth by more than steps do; and behind a post they go on as the next layer."""
    camera = builders.camera(z=0.0, half_width=1.0)
    depth = np.full((2, 32, 32), INF, np.float32)
    depth[0] = 6.0 - 0.15 * np.arange(32)
    depth[1, :, 20:22] = depth[0, :, 20:22]
    depth[0, :, 20:22] = 0.5
    origins = place(camera, (32, 32), np.full(8, 4.5), np.full(8, 16.5), np.full(8, 2.0))
    directions = unit(np.stack([np.linspace(0.8, 1.0, 8), np.zeros(8), np.full(8, -0.4)], axis=-1))
    found = march_on_gpu(camera, depth[:layers], None, origins, directions, reach=1e30, steps=8, jitter=0.5)
    # One layer does not tell the wall from a post that comes in between: rays may be lost, but none may meet the post.
    assert found.hit.all() or layers == 1
    behind = origins[:, 2] + found.distance * directions[:, 2]
    assert (found.distance[found.hit] > 0.1).all()
    assert (behind[found.hit] < -2.0).all()


# --- Against exact rays -----------------------------------------------------------------------------------------------

BOXES = [((0.0, 0.0, -0.7), 0.3), ((-0.6, 0.2, -0.4), 0.25), ((0.5, -0.5, -0.2), 0.35)]


def box_distances(origins, directions):
    """(N,) m to the nearest of BOXES, infinite where there is none: the slab test of Kay and Kajiya 1986."""
    nearest = np.full(len(origins), INF)
    for center, half in BOXES:
        with np.errstate(divide="ignore"):
            one, other = ((np.array(center) + side * half - origins) / directions for side in (-1.0, 1.0))
        enter, leave = np.minimum(one, other).max(axis=-1), np.maximum(one, other).min(axis=-1)
        nearest = np.where((enter <= leave) & (enter > 0.0) & (enter < nearest), enter, nearest)
    return nearest


@pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])
def test_boxes_are_met_where_exact_rays_meet_them(render, orthographic):
    """Of rays from a plate: at a pixel a step a layer is known to half a pixel's diagonal, so rays are left out that
    would meet something else if moved by a pixel. Two layers do not know what two boxes hide: 2 % of the rest."""
    size = 96
    plate = rectangle("plate", (0.0, 0.0, -1.0), (1.5, 0.0, 0.0), (0.0, 1.5, 0.0))
    scene = of(
        (plate, builders.DIFFUSE), *((block(f"{half}", center, half), builders.DIFFUSE) for center, half in BOXES)
    )
    camera = builders.camera(z=5.0, half_width=2.0 if orthographic else 0.4, orthographic=orthographic)
    view = render(
        scene, camera, width=size, height=size, layers=2, minimum_separation=0.05, deep_output=True, exit_surfaces=True
    )
    depth = np.stack([layer.depth for layer in view.layers])
    exits = np.stack([layer.exit_depth for layer in view.layers])
    generator = np.random.default_rng(1)
    pixel = 4.0 / size
    points = np.concatenate([generator.uniform(-1.3, 1.3, (1500, 2)), np.full((1500, 1), -1.0 + pixel)], axis=-1)
    directions = generator.normal(size=(1500, 3))
    directions[:, 2] = np.abs(directions[:, 2])
    directions = unit(directions)
    outside = box_distances(points, directions) > 1e-3
    for center, half in BOXES:
        outside &= (np.abs(points - center) > half + pixel).any(axis=-1)
    points, directions = points[outside], directions[outside]
    seen_points = points - (0.0, 0.0, 5.0)
    columns = seen_points[:, :2] / (1.0 if orthographic else -seen_points[:, 2:])
    columns = np.floor((columns / camera.window[1] * 0.5 + 0.5) * size).astype(int)
    visible = depth[0, columns[:, 1], columns[:, 0]] > 5.9
    points, directions, seen_points = points[visible], directions[visible], seen_points[visible]
    exact = box_distances(points, directions)
    moved = [box_distances(points + pixel * np.array(shift), directions) for shift in np.eye(3)]
    moved += [box_distances(points - pixel * np.array(shift), directions) for shift in np.eye(3)]
    sure = np.all([np.isfinite(other) == np.isfinite(exact) for other in moved], axis=0)
    found = march_on_gpu(camera, depth, exits, seen_points, directions, reach=1e30, steps=2 * size, jitter=0.5)
    assert sure.sum() > 500
    assert 0.1 < np.isfinite(exact[sure]).mean() < 0.9
    agree = found.hit[sure] == np.isfinite(exact[sure])
    assert agree.mean() > 0.98
    both = sure & found.hit & np.isfinite(exact)
    error = found.distance[both] - exact[both]
    assert np.median(np.abs(error)) < 1.5 * pixel


# --- Light ------------------------------------------------------------------------------------------------------------

RHO = 0.5
PLATES = {
    "parallel": ((0.0, 0.0, 0.8), (0.5, 0.0, 0.0), (0.0, -0.5, 0.0)),
    "perpendicular": ((-0.5, 0.0, 0.5), (0.0, 0.5, 0.0), (0.0, 0.0, 0.5)),
}


@pytest.mark.parametrize("name", PLATES)
def test_form_factors(shared_session, name):
    """Lambert's polygon, over all of the square that is seen, within 3 %."""
    center, half_x, half_y = PLATES[name]
    scene = of(
        (rectangle("plate", center, half_x, half_y), glowing()),
        (rectangle("square", (0, 0, 0), (0.5, 0, 0), (0, 0.5, 0)), builders.material(base_color=(RHO,) * 3)),
    )
    camera = looking((0.3, -1.2, 0.4), (0.0, 0.0, 0.35), half_width=0.9)
    found, points, index = seen(shared_session, scene, camera, replace(MARCH, march_steps=128), samples=8, size=96)
    shown = index == 2
    assert shown.sum() > 100
    corners = rectangle_corners(center, half_x, half_y)
    expected = [polygon_irradiance(corners - point, np.array([0.0, 0.0, 1.0])) for point in points[shown]]
    assert found[shown, 0].sum() * np.pi / RHO == pytest.approx(np.sum(expected), rel=0.03)


def corner(emission, **arguments):
    """A floor and two walls, all of which a camera sees whole, of one emission."""
    white = glowing("white", emission, RHO)
    return of(
        (rectangle("floor", (0, 0, 0), (1, 0, 0), (0, 1, 0)), white),
        (rectangle("back", (0, 1, 1), (1, 0, 0), (0, 0, -1)), white),
        (rectangle("left", (-1, 0, 1), (0, 1, 0), (0, 0, 1)), white),
        **arguments,
    )


CORNER_CAMERA = looking((2.6, -2.6, 2.6), (-0.2, 0.2, 0.6), half_width=0.6)


def test_a_furnace_stays_one(shared_session):
    """Walls and world of radiance 1: whatever a ray meets, it brings 1, unless it meets a back; none of these can."""
    found, _, index = seen(shared_session, corner(1.0, world=(1.0, 1.0, 1.0)), CORNER_CAMERA, MARCH, samples=4)
    assert found[index > 0].mean() == pytest.approx(RHO, rel=5e-3)
    assert found.max() <= RHO * (1.0 + 1e-5)


def test_bounces_add_the_next_powers_of_the_albedo(shared_session):
    """In the furnace's corner without a world each bounce is what the walls send of the one before: less than RHO of
    it, and more than the share of it that walls see of one another, which is what the first bounce is of the emission.
    """
    found = []
    for bounces in (1, 2, 3):
        light, _, index = seen(shared_session, corner(1.0), CORNER_CAMERA, replace(MARCH, bounces=bounces), samples=8)
        found.append(light[index > 0].mean())
    first, second, third = np.diff([0.0, *found])
    share = first / RHO  # of each other's radiance
    assert 0.1 < share < 0.9
    assert second == pytest.approx(first * RHO * share, rel=0.25)
    assert third == pytest.approx(second**2 / first, rel=0.25)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_light_is_linear_in_power(shared_session, factor):
    one, other = (
        seen(shared_session, corner(power, world=(power,) * 3), CORNER_CAMERA, replace(MARCH, bounces=2), samples=1)[0]
        for power in (1.0, factor)
    )
    np.testing.assert_allclose(other / factor, one, rtol=1e-3, atol=1e-3 * one.mean())


def test_a_back_blocks_but_does_not_shine(shared_session):
    """A wall whose front the camera sees stands between the floor behind it and the world: rays meet it from behind."""
    screen = rectangle("screen", (0.0, 0.0, 0.5), (1.0, 0.0, 0.0), (0.0, 0.0, 0.5))
    floor = rectangle("floor", (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    scene = of((screen, glowing(emission=1000.0)), (floor, builders.material(base_color=(RHO,) * 3)))
    camera = looking((0.0, -2.5, 3.0), (0.0, 0.6, 0.4), half_width=0.6)
    found, points, index = seen(shared_session, scene, camera, MARCH, samples=2)
    shown = (index == 2) & (points[..., 1] > 0.1)
    assert shown.sum() > 30
    assert found[shown].max() < 1.0


def test_what_passes_behind_something_is_not_taken_for_the_world(shared_session):
    """A block before the left half of the picture: rays that leave the screen behind it bring nothing."""
    floor = rectangle("floor", (0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (0.0, 3.0, 0.0))
    white = builders.material(base_color=(RHO,) * 3)
    camera = looking((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), half_width=0.5)
    near = block("near", (-0.75, 0.0, 2.5), 0.74)
    open_floor, _, _ = seen(shared_session, of((floor, white), world=(1.0,) * 3), camera, MARCH, samples=2)
    assert open_floor.mean() == pytest.approx(RHO, rel=1e-3)
    scene = of((floor, white), (near, white), world=(1.0,) * 3)
    found, _, index = seen(shared_session, scene, camera, MARCH, samples=2)
    # Of the cosine-weighted hemisphere over a floor, half is left and half is right.
    assert 0.4 * RHO < found[index == 1].mean() < 0.8 * RHO


def test_debug_views_show_what_rays_met(session):
    """An open floor sends all its rays to the world; in the corner rays that meet a wall bring as much as the others,
    but for the few that pass between two walls and end behind them."""
    floor = of((rectangle("floor", (0, 0, 0), (9, 0, 0), (0, 9, 0)), builders.DIFFUSE), world=(1.0,) * 3)
    above = looking((0.0, 0.0, 2.0), (0.0, 0.0, 0.0))
    for view, expected in ((DebugView.MARCH_HITS, (0.0, 0.0, 0.0)), (DebugView.LIGHT_ORIGIN, (0.0, 0.0, 1.0))):
        shown = radiance(session, floor, above, MARCH, samples=1, debug_view=view)
        np.testing.assert_allclose(shown, np.broadcast_to(expected, shown.shape))
    scene = corner(1.0, world=(1.0,) * 3)
    hits, origins = (
        radiance(session, scene, CORNER_CAMERA, MARCH, samples=2, debug_view=view)
        for view in (DebugView.MARCH_HITS, DebugView.LIGHT_ORIGIN)
    )
    assert 0.1 < hits.mean() < 0.9
    assert np.isclose(origins[..., 0], hits[..., 0], atol=1e-5).mean() > 0.99
    np.testing.assert_allclose(origins[..., 1], 0.0)
