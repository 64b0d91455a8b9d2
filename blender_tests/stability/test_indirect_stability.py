# SPDX-License-Identifier: GPL-3.0-or-later
"""Indirect light from frame to frame, as a viewport shows it: a few samples each, the picture before known."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

from addon.scene import IndirectMethod, Light, LightKind, Moment, Scene
from addon.scene import Sequence as Frames
from addon.scene.versions import new_version
from blender_tests import builders
from blender_tests.gl.closed_forms import polygon_irradiance, rectangle_corners
from blender_tests.gl.conftest import Session
from blender_tests.indirect_scenes import GRID, beside, cornell, glowing, looking, of, rectangle, seen

SIZE = 32
INDIRECT = replace(GRID, cells=32)
EVERY_METHOD = [method for method in IndirectMethod if method is not IndirectMethod.NONE]


@pytest.fixture
def session() -> Iterator[Session]:
    """A viewport."""
    session = Session()
    yield session
    session.release()


def frame(
    session: Session, moment: Moment, before: Moment | None, seed: int = 0, samples: int = 8, **numbers: object
) -> tuple[np.ndarray, ...]:
    """The next picture of a viewport: (indirect radiance, positions, object indices); see `seen`."""
    sequence = Frames(previous=before, continuous=True)
    indirect = replace(INDIRECT, **numbers)
    return seen(
        session, moment.scene, moment.camera, indirect, samples=samples, size=SIZE, seed=seed, sequence=sequence
    )


def played(session: Session, moments: Sequence[Moment], **numbers: object) -> list[tuple[np.ndarray, ...]]:
    """All pictures of a clip."""
    before: list[Moment | None] = [None, *moments]
    return [frame(session, moment, before[at], **numbers) for at, moment in enumerate(moments)]


def patches(picture: tuple[np.ndarray, ...], thing: int, cells: int = 3, half: float = 0.6) -> np.ndarray:
    """(cells²,) mean radiance in squares of a thing's x and z (m): the same places however the camera moves.

    NaN for those of which less than 12 pixels are seen.
    """
    light, points, index = picture
    edges = np.linspace(-half, half, cells + 1)
    result = np.full((cells, cells), np.nan)
    for row in range(cells):
        for column in range(cells):
            inside = (index == thing) & (points[..., 0] >= edges[column]) & (points[..., 0] < edges[column + 1])
            inside &= (points[..., 2] >= edges[row]) & (points[..., 2] < edges[row + 1])
            if inside.sum() >= 12:
                result[row, column] = light[inside].mean()
    return result.ravel()


BACK = 3
"""Index of the back wall of the Cornell box."""


def test_an_emitter_that_leaves_the_screen_goes_on_shining(session: Session) -> None:
    """A camera turns away from a panel; what the panel gives to each point of the floor stays, which is what Cycles
    shows: Lambert's polygon, within 10 %."""
    center, half_x, half_y = (-1.2, 0.0, 0.8), (0.0, 0.5, 0.0), (0.0, 0.0, 0.5)
    albedo = 0.5
    scene = of(
        (rectangle("panel", center, half_x, half_y), glowing()),
        (rectangle("floor", (0, 0, 0), (2, 0, 0), (0, 2, 0)), builders.material(base_color=(albedo,) * 3)),
    )
    eye = np.array([0.3, -2.2, 1.2])
    turns = np.radians([-25.0, -15.0, -5.0, 5.0, 15.0, 25.0])
    targets = [eye + np.array([np.sin(turn), np.cos(turn), -0.55]) for turn in turns]
    moments = [Moment(scene, looking(eye, target, half_width=0.45)) for target in targets]
    corners = rectangle_corners(center, half_x, half_y)
    seen_panel = []
    for light, points, index in played(session, moments, bounces=1):
        seen_panel.append(bool((index == 1).any()))
        shown = (index == 2) & (np.abs(points[..., :2]) < 1.0).all(axis=-1)
        expected = [polygon_irradiance(corners - point, np.array([0.0, 0.0, 1.0])) for point in points[shown]]
        assert len(expected) > 40
        assert light[shown].mean(axis=-1).sum() == pytest.approx(np.sum(expected) * albedo / np.pi, rel=0.1)
    assert seen_panel[0]
    assert not seen_panel[-1], "the panel must leave the screen"


@pytest.mark.parametrize("method", EVERY_METHOD)
def test_a_cut_leaves_no_trace_after_a_frame(session: Session, method: IndirectMethod) -> None:
    """The second picture after a cut differs from that of a viewport that never saw anything else by no more than one
    with other random numbers."""
    lamp = builders.light(LightKind.POINT, (0.1, -0.2, 0.6), emission=(1.0, 0.8, 0.6))
    scene = cornell(lamp)
    scene = replace(scene, world=replace(scene.world, radiance=(0.2, 0.1, 0.3)))
    here = Moment(scene, looking((0.0, -3.6, 0.0), (0.0, 0.0, 0.0), half_width=0.38))
    there = Moment(scene, looking((0.2, -0.9, 0.2), (-0.9, 0.6, -0.6), half_width=0.8))

    def last(first: list[Moment], seed: int) -> np.ndarray:
        """The second picture of `here` after others."""
        viewport = Session()
        moments = [*first, here, here]
        before: list[Moment | None] = [None, *moments]
        for at, moment in enumerate(moments):
            picture = frame(viewport, moment, before[at], seed, samples=4, method=method)
        viewport.release()
        return picture[0]

    alone, cut, other = last([], 0), last([there, there], 0), last([], 100)
    noise = np.abs(alone - other).sum()
    assert np.isfinite(cut).all()
    assert np.abs(cut - alone).sum() <= 1.2 * noise + 0.01 * alone.sum()
    assert abs(cut.mean() / alone.mean() - 1.0) < 0.02


def wall_light(pictures: Sequence[tuple[np.ndarray, ...]]) -> np.ndarray:
    """(frames,) mean light of the middle of the back wall."""
    return np.array([patches(picture, BACK, cells=1)[0] for picture in pictures])


def steps(series: np.ndarray) -> np.ndarray:
    """Relative changes from frame to frame."""
    return np.diff(series) / series.mean()


@pytest.mark.parametrize("cell_size", [0.0, 0.1])
def test_a_slow_pan_does_not_pop(session: Session, cell_size: float) -> None:
    """A camera goes through the room, nearer and sideways, while cells that suit the view get smaller, and the grid's
    levels, which do not cover what there is 12 m away, move along: from frame to frame the light of a place changes by
    no more than a few standard deviations of what it does where nothing moves farther than a pixel, and by no more
    than a few percent in all."""
    specks = [rectangle(f"speck {x}", (x, x, x), (0.01, 0, 0), (0, 0.01, 0)) for x in (-12.0, 12.0)]
    scene = beside(cornell(), *((speck, builders.DIFFUSE) for speck in specks))
    generator = np.random.default_rng(3)

    def at(x: float, nearer: float) -> Moment:
        return Moment(scene, looking((x, -2.2 + nearer, 0.0), (x, 0.0, 0.0), half_width=0.6))

    numbers = {"cell_size": cell_size, "bounces": None, "temporal_filter": False}
    moving = [at(0.3 * share, 0.8 * share) for share in np.linspace(0.0, 1.0, 12)]
    resting = [at(*generator.uniform(-0.04, 0.04, 2)) for _ in range(12)]
    viewport = Session()
    rest, pan = (wall_light(played(one, clip, **numbers)) for one, clip in ((viewport, resting), (session, moving)))
    viewport.release()
    assert np.isfinite(pan).all()
    assert np.abs(steps(pan)).max() <= 4.0 * steps(rest).std() + 0.01
    assert abs(pan[-4:].mean() / pan[:4].mean() - 1.0) < 0.05


def lamp_at(x: float, strength: float = 1.0) -> Light:
    """A lamp that is one from frame to frame, wherever it is."""
    emission = (strength, 0.8 * strength, 0.6 * strength)
    return replace(builders.light(LightKind.POINT, (x, -0.2, 0.3), emission=emission), key="lamp")


ROOM = cornell(lamp_at(0.0))


def lit(x: float, strength: float = 1.0) -> Moment:
    """One room with its lamp at a place."""
    camera = looking((0.0, -3.6, 0.0), (0.0, 0.0, 0.0), half_width=0.38)
    return Moment(replace(ROOM, lights=(lamp_at(x, strength),)), camera)


def light_of(viewport: Session, moments: Sequence[Moment], **numbers: object) -> np.ndarray:
    """(frames, patches) of the back wall; pictures of equal number have equal random numbers."""
    return np.array([patches(picture, BACK) for picture in played(viewport, moments, bounces=2, **numbers)])


def test_light_follows_a_lamp_that_moves(session: Session) -> None:
    """In every frame what is shown is within a frame's worth of what a viewport shows that has always seen the lamp
    where it is; and a few frames after it stopped, nothing is left of where it was."""
    places = [*np.linspace(-0.6, 0.6, 9), *[0.6] * 5]
    followed = light_of(session, [lit(x) for x in places])

    def settled(x: float) -> np.ndarray:
        viewport = Session()
        series = light_of(viewport, [lit(x)] * 6)
        viewport.release()
        return np.nanmean(series[2:], axis=0)

    middle, end = settled(places[4]), settled(places[-1])
    np.testing.assert_allclose(followed[4], middle, rtol=0.2)
    np.testing.assert_allclose(np.nanmean(followed[-3:], axis=0), end, rtol=0.05)


def test_light_that_goes_out_is_gone(session: Session) -> None:
    """After the lamp is switched off, what is left after as many frames as there are bounces is none of it."""
    series = light_of(session, [lit(0.0)] * 3 + [lit(0.0, 1e-6)] * 6)
    assert np.nanmax(series[-1]) < 0.01 * np.nanmin(series[2])


def test_a_moving_object_takes_its_light_along(session: Session) -> None:
    """A panel that shines moves across the room: where it was, nothing of it is left in the grid."""
    camera = looking((0.0, -3.6, 0.0), (0.0, 0.0, 0.0), half_width=0.38)
    room = cornell()

    def moved(x: float) -> Scene:
        batches = list(room.batches)
        batches[-1] = replace(batches[-1], matrices=builders.translation(x=x)[None], version=new_version())
        return replace(room, batches=tuple(batches))

    still = Moment(moved(0.5), camera)
    clip = [*(Moment(moved(x), camera) for x in (-0.5, -0.25, 0.0, 0.25)), *[still] * 4]
    followed = light_of(session, clip, temporal_filter=False)
    viewport = Session()
    rested = light_of(viewport, [still] * 8, temporal_filter=False)
    viewport.release()
    np.testing.assert_allclose(followed[4:], rested[4:], rtol=1e-3)
    assert np.nanmax(np.abs(followed[:3] / rested[:3] - 1.0)) > 0.1, "the panel must have changed something"
