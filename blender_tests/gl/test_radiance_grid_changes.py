# SPDX-License-Identifier: GPL-3.0-or-later
"""The radiance grid is filled anew where something changed, and there only; it looks as if all of it were new."""

from dataclasses import replace

import numpy as np
import pytest

from addon.scene import Channel, LightKind
from addon.scene import Sequence as Frames
from addon.scene.versions import new_version
from blender_tests import builders
from blender_tests.gl.conftest import Session
from blender_tests.indirect_scenes import (
    CORNELL_CAMERA,
    GRID,
    beside,
    block,
    cornell,
    glowing,
    looking,
    of,
    radiance,
    rectangle,
    relative_difference,
    seen,
)

LAMP = builders.light(LightKind.POINT, position=(0.0, -0.2, 0.7), emission=(1.0, 1.0, 1.0))
INDIRECT = replace(GRID, cell_size=0.09, bounces=3)
ROUNDING = 1e-5
FLOOR = 1
"""Object index."""

WHITE = builders.material(base_color=(0.5,) * 3)


def moved(scene, key, matrices):
    """The scene with a batch elsewhere."""
    batches = tuple(
        replace(batch, matrices=np.asarray(matrices).reshape(-1, 4, 4), version=new_version())
        if batch.key == key
        else batch
        for batch in scene.batches
    )
    return replace(scene, batches=batches)


def painted(scene, key, **changes):
    """The scene with a material that differs."""
    material = replace(scene.materials[key], version=new_version(), **changes)
    return replace(scene, materials={**scene.materials, key: material})


def without(scene, key):
    """The scene without a batch."""
    return replace(scene, batches=tuple(batch for batch in scene.batches if batch.key != key))


def turned(angle):
    """A turn about Z."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return matrix


def room():
    """The room with two small things in it: one is twice there, one shines."""
    small = block("small", (0, 0, 0), 0.15)
    scene = beside(
        cornell(LAMP), (small, WHITE), matrices=[builders.translation(-0.5, 0, -0.8), builders.translation(0, -0.6, 0)]
    )
    panel = rectangle("glowing", (0, 0, 0), (0.1, 0, 0), (0, -0.1, 0))
    return beside(scene, (panel, glowing(emission=30.0)), matrices=[builders.translation(-0.7, 0.5, 0.5)])


CHANGES = {
    "moved": lambda scene: moved(scene, "block", builders.translation(-0.7, -0.3, 0.1)),
    "turned": lambda scene: moved(scene, "block", turned(0.3)),
    "one of two instances": lambda scene: moved(
        scene, "small", [builders.translation(-0.5, 0, -0.8), builders.translation(0.5, -0.6, 0.3)]
    ),
    "painted": lambda scene: painted(scene, "red", base_color=(0.1, 0.1, 0.6)),
    "brighter": lambda scene: painted(scene, "glow", emission=(90.0, 60.0, 30.0)),
    "gone": lambda scene: without(scene, "block"),
    "new": lambda scene: beside(scene, (block("new", (-0.3, -0.3, 0.2), 0.1), WHITE)),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_changed_scene_looks_as_if_it_were_new(shared_session, render, change):
    """To the bit: what is kept is what would be found again, and nothing is kept that changed."""
    scene = room()
    other = change(scene)
    settings = {"width": 48, "height": 48, "samples": 1, "indirect": INDIRECT}
    shared_session.show(scene, CORNELL_CAMERA, **settings)
    changed = shared_session.show(other, CORNELL_CAMERA, **settings)
    fresh = render(other, CORNELL_CAMERA, **settings)
    for channel, picture in fresh.channels.items():
        np.testing.assert_array_equal(changed.channels[channel], picture, str(channel))
    before = render(scene, CORNELL_CAMERA, **settings)
    assert any((before.channels[channel] != picture).any() for channel, picture in fresh.channels.items())


def test_what_did_not_change_is_not_filled_again(shared_session):
    """A wall gets another colour on the sly, without a new version, and a block moves: the grid keeps its old one."""
    scene = room()
    sly = replace(
        scene, materials={**scene.materials, "red": replace(scene.materials["red"], base_color=(0.0, 0.0, 0.9))}
    )
    there = builders.translation(0.05, 0.0, 0.0)
    indirect = replace(INDIRECT, contact_steps=0, divisor=1, spatial_filter=False)
    seen(shared_session, scene, CORNELL_CAMERA, indirect, samples=1)
    kept, _, objects = seen(shared_session, moved(sly, "block", there), CORNELL_CAMERA, indirect, samples=1)
    expected, _, _ = seen(shared_session, moved(scene, "block", there), CORNELL_CAMERA, indirect, samples=1)
    np.testing.assert_array_equal(kept[objects == FLOOR], expected[objects == FLOOR])


def test_levels_grow_with_the_scene(viewport):
    """A block leaves the room, and the levels cover more than before: the same picture as in a new grid, but for the
    rounding of positions that are counted from another corner."""
    first = room()
    second = moved(first, "block", builders.translation(0.0, -2.0, 0.6))
    changed = viewport([(first, CORNELL_CAMERA), (second, CORNELL_CAMERA)], INDIRECT)
    assert relative_difference(changed, viewport([(second, CORNELL_CAMERA)] * 2, INDIRECT)) < ROUNDING


def test_cells_stay_where_the_levels_move(viewport):
    """A walk along a floor that is larger than the levels: cells that come in are filled, others are kept."""
    floor = rectangle("floor", (0, 0, 0), (60, 0, 0), (0, 60, 0))
    blocks = [(block(f"block {x}", (2.0 * x, 1.0, 0.5), 0.5), WHITE) for x in range(-6, 7)]
    lamp = replace(LAMP, emission=(50.0, 50.0, 50.0))
    scene = of((floor, WHITE), *blocks, lights=(lamp,), world=(0.3, 0.4, 0.5))
    indirect = replace(INDIRECT, cells=32, cell_size=0.2)
    walk = [(scene, looking((x, -4.0, 1.0), (x, 0.0, 1.0))) for x in (0.0, 3.0, 6.0, 9.0)]
    assert relative_difference(viewport(walk, indirect), viewport(walk[-1:] * 4, indirect)) < ROUNDING


@pytest.fixture(name="viewport")
def viewport_fixture():
    """viewport(pictures, indirect): the last of a new viewport's pictures of (scene, camera), (48, 48, 3)."""

    def show(pictures, indirect):
        session, indirect = Session(), replace(indirect, temporal_filter=False)
        try:
            for scene, camera in pictures:
                shown = radiance(session, scene, camera, indirect, samples=1, sequence=Frames(continuous=True))
            return shown
        finally:
            session.release()

    return show


def test_a_film_is_the_same_whatever_was_rendered_before(shared_session, render):
    """To the bit, also where the levels moved: a frame in an animation is that frame alone."""
    places = np.linspace(-30.0, 30.0, 61)
    heights = np.random.default_rng(1).uniform(0.0, 1.0, (61, 61))  # so that it sees itself
    corners = np.stack([*np.meshgrid(places, places), heights], axis=-1).reshape(-1, 3)
    first = (np.arange(60)[:, None] * 61 + np.arange(60)).ravel()
    triangles = np.concatenate([np.stack([first, first + b, first + c], axis=1) for b, c in ((1, 62), (62, 61))])
    lamp = replace(LAMP, emission=(50.0, 50.0, 50.0))
    scene = of((builders.mesh("floor", corners, triangles), WHITE), lights=(lamp,), world=(0.3, 0.4, 0.5))
    scene = beside(scene, (block("block", (1.0, 0.0, 0.5), 0.5), WHITE))
    indirect = replace(INDIRECT, cells=32, cell_size=0.2)
    for x in (0.0, 1.7):
        camera = looking((x, -4.0, 2.0), (x, 0.0, 0.0), half_width=0.4)
        after = radiance(shared_session, scene, camera, indirect, samples=1)
    alone = render(scene, camera, width=48, height=48, samples=1, indirect=indirect).channels[Channel.COMBINED]
    np.testing.assert_array_equal(after, alone[..., :3])
