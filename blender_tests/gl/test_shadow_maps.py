# SPDX-License-Identifier: GPL-3.0-or-later
"""Which shadow maps are drawn, kept and given up from view to view, and that a picture does not depend on it."""

from dataclasses import replace

import numpy as np
import pytest

from addon.render import gl_thread
from addon.render.passes.shadow_maps import ShadowMapsPass
from addon.scene import AreaShape, Channel, LightKind, Sequence
from blender_tests import builders

VIEWPORT = Sequence(continuous=True)
SETTINGS = {"width": 48, "height": 48, "shadow_map_size": 128, "shadow_memory": 16}
CAMERA = builders.camera(z=12.0, half_width=0.4)


def turned(light, direction):
    """A light that shines in a direction (3,)."""
    z = -np.array(direction, float) / np.linalg.norm(direction)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    pose = light.world_from_light.copy()
    pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    return replace(light, world_from_light=pose)


def box_at(x, key, version=1, **arguments):
    """A box of ½ m about 1 m above the floor."""
    item = builders.batch("box", [builders.translation(x=x, z=1.0)], key=key)
    return replace(item, version=version, **arguments)


def room(lights, *boxes, world=(0.0, 0.0, 0.0)):
    """A floor, and boxes above it."""
    meshes = builders.quad("floor", half=6.0), builders.box("box", half=0.25)
    return builders.scene(*meshes, lights=lights, batches=[builders.batch("floor"), *boxes], world=world)


def lamp(x, key="lamp", **arguments):
    """A bulb above the floor."""
    return replace(builders.light(position=(x, 0.0, 3.0), **arguments), key=key)


BOXES = box_at(-2.0, "left"), box_at(2.0, "right")


def shown(session, scene, camera=CAMERA, sequence=VIEWPORT, **settings):
    """(COMBINED, maps drawn, maps kept) of a view."""
    view = session.show(scene, camera, sequence, **SETTINGS | settings)
    statistics = view.statistics
    return view.channels[Channel.COMBINED], statistics.shadow_maps_drawn, statistics.shadow_maps_kept


LIGHTS = [
    lamp(0.0),
    lamp(0.0, radius=0.3),
    lamp(0.0, radius=0.3, soft_falloff=True),
    builders.light(LightKind.SUN, angle=0.1),
    builders.light(LightKind.SPOT, (0, 0, 3), angle=1.0, radius=0.1),
    builders.light(LightKind.SPOT, (0, 0, 3), angle=2.8),
    builders.light(LightKind.AREA, (0, 0, 3), size=(1, 1)),
    builders.light(LightKind.AREA, (0, 0, 3), size=(1, 2), shape=AreaShape.ELLIPSE, spread=0.8),
]


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize(
    "light", LIGHTS, ids=lambda light: f"{light.kind}{light.radius}{light.angle}{light.spread:.1f}"
)
def test_an_equal_view_draws_no_map_again(session, light, samples):
    scene = room((light,), *BOXES)
    assert shown(session, scene, samples=samples)[1] > 0
    picture, _, _ = shown(session, scene, samples=samples)  # what was lost when pages were added is drawn again
    again, drawn, kept = shown(session, scene, samples=samples)
    assert (drawn, kept > 0) == (0, True)
    np.testing.assert_array_equal(again, picture)


def test_an_equal_scene_of_other_objects_draws_no_map_again(session):
    """As sync hands over after something unrelated changed: new tuples, equal versions."""
    scene = room((lamp(0.0),), *BOXES)
    shown(session, scene)
    white = builders.material(base_color=(0.9, 0.1, 0.1), specular=0.0)
    repainted = replace(
        scene, materials={"white": replace(white, version=2)}, batches=tuple(map(replace, scene.batches))
    )
    assert shown(session, repainted)[1] == 0


@pytest.mark.parametrize("kind", [LightKind.POINT, LightKind.SPOT])
def test_the_camera_moves_and_what_fixed_lights_see_stays(session, kind):
    """A light's map shows all that it shines on, not only what this camera sees of it: small steps need no other."""
    light = lamp(0.0) if kind is LightKind.POINT else builders.light(kind, (0, 0, 3), angle=1.5)
    scene = room((light,), *BOXES)
    _, drawn, _ = shown(session, scene)
    total = 0
    for step in range(1, 9):
        moved = replace(CAMERA, world_from_camera=builders.translation(x=0.002 * step, z=12.0))
        _, more, kept = shown(session, scene, moved)
        assert more + kept == drawn
        total += more
    assert total <= 1


def test_a_new_sample_draws_new_maps_of_lights_with_a_size_only(session):
    lamps = lamp(-1.0, "fixed"), lamp(1.0, "large", radius=0.5)
    scene = room(lamps, *BOXES)
    counts = [shown(session, scene, samples=samples) for samples in (1, 3)]
    alone = shown(session, room(lamps[:1], *BOXES), samples=3)
    assert counts[1][1] > 0
    assert alone[1] == 0, "the fixed light had its maps before"


def test_moving_a_caster_redraws_only_what_sees_it(session):
    """Two spots, each over a box of its own."""
    spots = tuple(
        replace(builders.light(LightKind.SPOT, (x, 0, 3), angle=0.6), key=key) for x, key in ((-2, "l"), (2, "r"))
    )
    _, drawn, _ = shown(session, room(spots, *BOXES))
    assert drawn == 2
    moved = box_at(2.1, "right", version=2)
    picture, drawn, kept = shown(session, room(spots, BOXES[0], moved))
    assert (drawn, kept) == (1, 1)
    fresh, _, _ = shown(session, room(spots, BOXES[0], moved), shadow_map_size=64)  # another page size: all are new
    again, drawn, _ = shown(session, room(spots, BOXES[0], moved))
    assert drawn == 2
    np.testing.assert_array_equal(again, picture)
    assert not np.array_equal(fresh, shown(session, room(spots, *BOXES))[0])


def test_a_caster_that_goes_and_comes_back_is_drawn_again(session):
    lights = (builders.light(LightKind.SPOT, (-2, 0, 3), angle=0.6),)
    with_box, without = room(lights, *BOXES), room(lights, BOXES[1])
    picture = shown(session, with_box)[0]
    bare = shown(session, without)[0]
    assert not np.array_equal(picture, bare)
    np.testing.assert_array_equal(shown(session, with_box)[0], picture)
    np.testing.assert_array_equal(shown(session, without)[0], bare)


def shadow_bytes(session, scene, **settings):
    """Bytes of shadow maps after a view, 0 where there are none."""
    view = session.show(scene, CAMERA, VIEWPORT, **SETTINGS | settings)
    return view.statistics.bytes.get("shadow maps", 0)


@pytest.mark.parametrize(
    "dark", [{"emission": (0.0, 0.0, 0.0)}, {"casts_shadow": False}, None], ids=["off", "without shadow", "removed"]
)
def test_a_light_that_goes_takes_its_maps_along(session, dark):
    scene = room((lamp(0.0),), *BOXES)
    assert shadow_bytes(session, scene) > 0
    lights = () if dark is None else (replace(scene.lights[0], **dark),)
    assert shadow_bytes(session, replace(scene, lights=lights)) == 0
    assert shown(session, scene)[1] > 0


@pytest.mark.parametrize("memory", [1, 2, 4])
def test_memory_is_kept_to(session, memory):
    """With many lights, each of which would like more: maps get smaller, and no picture fails."""
    lamps = tuple(lamp(0.2 * index - 1.5, f"lamp {index}", radius=0.2) for index in range(15))
    scene = room(lamps, *BOXES)
    for _ in range(2):
        view = session.show(scene, CAMERA, VIEWPORT, **SETTINGS | {"shadow_memory": memory, "samples": 3})
        depth = 4 * SETTINGS["shadow_map_size"] ** 2
        assert view.statistics.bytes["shadow maps"] <= memory * 2**20 + depth
        assert view.channels[Channel.COMBINED].any()


def busy_scene(seed):
    """Every kind of light, a world, and boxes, all somewhere at random."""
    generator = np.random.default_rng(seed)
    lights = [
        replace(
            turned(light, generator.normal(size=3) * (0.3, 0.3, 0.0) + (0.0, 0.0, -1.0)),
            key=f"light {index}",
            emission=tuple(generator.uniform(0.5, 2.0, 3)),
        )
        for index, light in enumerate(LIGHTS)
    ]
    boxes = [box_at(generator.uniform(-3.0, 3.0), f"box {index}", version=seed) for index in range(4)]
    return room(lights, *boxes, world=(0.1, 0.2, 0.3))


@pytest.mark.parametrize("before", [VIEWPORT, Sequence()], ids=["a viewport", "a final picture"])
def test_a_final_picture_is_the_same_whatever_came_before(render, session, before):
    """Bit for bit: maps that happen to be there already are those that would be drawn."""
    scene, other = busy_scene(1), busy_scene(2)
    settings = SETTINGS | {"samples": 5, "filter_radius": 1.5, "shadow_memory": 1, "shadow_updates": 3}
    expected = render(scene, CAMERA, Sequence(), **settings).channels[Channel.COMBINED]
    assert np.isfinite(expected).all()
    for past in (other, scene, replace(scene, batches=scene.batches[:-1])):
        session.show(past, CAMERA, before, **settings)
        found = session.show(scene, CAMERA, Sequence(), **settings).channels[Channel.COMBINED]
        np.testing.assert_array_equal(found, expected)


def test_a_viewports_picture_is_the_same_whatever_came_before(session):
    """Growing and evicting while it renders changes nothing: any two views of the same are equal."""
    scene, other = busy_scene(1), busy_scene(2)
    settings = {"samples": 4, "shadow_memory": 1}
    first = shown(session, scene, **settings)[0]
    shown(session, other, **settings)
    same = np.isclose(shown(session, scene, **settings)[0], first, rtol=1e-4).all(axis=-1)
    assert same.mean() > 0.97, "where a map lies decides how it is rounded, and that may decide the edge of a shadow"


def test_a_map_whose_drawing_failed_is_drawn_by_the_next_view(session, monkeypatch):
    scene = room((lamp(0.0),), *BOXES)
    draw = ShadowMapsPass._draw

    def fail(*_arguments):
        raise RuntimeError("the driver gave up")

    with monkeypatch.context() as broken:
        broken.setattr(ShadowMapsPass, "_draw", fail)
        with pytest.raises(RuntimeError):
            shown(session, scene)
    assert ShadowMapsPass._draw is draw
    picture, drawn, _ = shown(session, scene)
    assert drawn > 0
    fresh = shown(session, scene, sequence=Sequence())[0]
    np.testing.assert_array_equal(picture, fresh)
    assert np.ptp(picture[..., 0]) > 0.0


def test_many_small_maps_do_not_keep_a_large_one_out(session):
    """A memory of few pages on all of which there is something: nothing fails, and the picture is as ever."""
    lamps = tuple(lamp(0.4 * index - 1.5, f"lamp {index}") for index in range(8))
    sun = turned(builders.light(LightKind.SUN), (0.2, 0.1, -1.0))
    settings = {"shadow_map_size": 256, "shadow_memory": 1}
    first = shown(session, room((*lamps, sun), *BOXES), **settings)[0]
    for count in (8, 3, 1, 5):
        shown(session, room(lamps[:count], *BOXES), **settings)
    again = shown(session, room((*lamps, sun), *BOXES), **settings)[0]
    assert np.isclose(again, first, rtol=1e-4).all(axis=-1).mean() > 0.97


def test_a_pass_that_never_drew_anything_is_released():
    def job(device):
        shadow_maps = ShadowMapsPass(device)
        shadow_maps.release()
        return True

    assert gl_thread().submit(job).result()
