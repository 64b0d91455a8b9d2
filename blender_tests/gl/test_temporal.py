# SPDX-License-Identifier: GPL-3.0-or-later
"""The temporal pass alone, over successive views of planes with gathered irradiance that the tests write."""

from dataclasses import replace

import numpy as np
import pytest
from gathered import Plane, gathered_pixels, irradiance, positions, project, see, wide_camera
from viewport_views import FLOOR, SIZE, Shown, Views, moved, shifted, texels, turned

from addon.render.indirect_plan import HISTORY_SURFACES, HISTORY_TARGETS
from addon.scene import Channel, Moment
from addon.scene.indirect import IndirectMethod, IndirectSettings
from blender_tests import builders

ULP = float(np.finfo(np.float32).eps)
COLOR = np.array([3.0, 0.7, 12.5])
NOISY = 1e8  # a variance for which history is credible whatever it is
LONGEST = 16
divisors = pytest.mark.parametrize("divisor", [1, 2, 4])
projections = pytest.mark.parametrize("orthographic", [False, True], ids=["perspective", "orthographic"])


@pytest.fixture
def views():
    """views(divisor=1) -> Views."""
    made = []

    def make(divisor=1):
        made.append(Views(divisor))
        return made[-1]

    yield make
    for item in made:
        item.release()


def light_at(points, shape):
    """Irradiance that is linear in world-space position, with noise without bound."""
    return irradiance(10.0 + points @ np.array([1.0, 0.5, 0.25])[:, None], NOISY, shape)


def history_in(blended, gathered, length=1):
    """The history in what was blended of it, of so many samples, and of one gathered now."""
    return ((length + 1) * blended[..., :3].astype(np.float64) - gathered[..., :3]) / length


@divisors
def test_the_first_view_is_what_it_gathered(views, divisor):
    some = views(divisor)
    some.poison(5.0)
    gathered = irradiance(COLOR, 0.5, some.shape)
    np.testing.assert_array_equal(some.show(Shown(wide_camera()), gathered), gathered)


@divisors
@projections
def test_a_camera_at_rest_averages_views(views, divisor, orthographic):
    """The mean of all views so far, and the variance of such a mean, until the history is as long as it may be."""
    some, shown, generator = views(divisor), Shown(wide_camera(orthographic)), np.random.default_rng(1)
    found = [irradiance(generator.uniform(1, 2, (*some.shape, 1)), NOISY, some.shape) for _ in range(LONGEST + 3)]
    mean = None
    for count, gathered in enumerate(found):
        blended = some.show(shown, gathered)
        share = 1.0 / (min(count, LONGEST) + 1)
        mean = gathered if mean is None else (1 - share) * mean + share * gathered
        np.testing.assert_allclose(blended[..., :3], mean[..., :3], rtol=8 * LONGEST * ULP)
        if count <= LONGEST:
            np.testing.assert_allclose(blended[..., 3], NOISY / (count + 1), rtol=8 * LONGEST * ULP)


def test_the_film_of_a_view_holds_the_mean_of_history_and_samples(views):
    """However many samples: so history fades out of the film."""
    some, shown, generator = views(), Shown(wide_camera()), np.random.default_rng(2)
    found = [irradiance(generator.uniform(1, 2, (*some.shape, 1)), NOISY, some.shape) for _ in range(12)]
    for gathered in found[:3]:
        some.show(shown, gathered)
    film = some.show(shown, found[3]).astype(np.float64)
    for count, gathered in enumerate(found[4:], start=5):
        film += some.refine(gathered)
        expected = np.mean([item[..., :3] for item in found[:count]], axis=0)
        np.testing.assert_allclose(film[..., :3] / (count - 3), expected, rtol=100 * ULP)


@divisors
@projections
@pytest.mark.parametrize(
    "step",
    [{"x": 0.5}, {"x": -0.3, "y": 0.2}, {"z": -0.4}, {"z": 0.5}, "turn"],
    ids=["side", "up", "in", "out", "turn"],
)
def test_history_is_where_the_surface_was(views, divisor, orthographic, step):
    """A moved camera before a slanted floor, with light that is linear in the world. Between texels it is too in an
    orthographic view; in perspective it bends by the change of depth over a texel, and motion is rounded to 11 bits."""
    normal = np.array([0.1, -0.2, 1.0]) / np.sqrt(1.05)
    before = Shown(wide_camera(orthographic), (Plane((0.0, 0.0, 0.0), tuple(normal)),))
    camera = turned(before.camera, 0.05) if step == "turn" else shifted(before.camera, **step)
    now = moved(Shown(camera, before.planes), before)
    some = views(divisor)
    points = texels(before, divisor)[0]
    some.show(before, light_at(points, some.shape))
    gathered = irradiance(100.0, NOISY, some.shape)
    blended = some.show(now, gathered)
    # Where four texels of the view before are around: elsewhere there are fewer to interpolate between, or none.
    rows, columns = gathered_pixels(*SIZE, divisor)
    x, y = np.moveaxis((np.indices(SIZE[::-1])[::-1].transpose(1, 2, 0) - now.motion)[np.ix_(rows, columns)], -1, 0)
    inside = (x >= columns[0]) & (x < columns[-1]) & (y >= rows[0]) & (y < rows[-1])
    assert inside.mean() > 0.4
    expected = light_at(texels(now, divisor)[0], some.shape)[..., 0]
    width = divisor * 2.0 / SIZE[1] * now.surfaces.depth.max()
    tolerance = 2e-3 * width * np.abs(now.motion).max() + 0.05 * width
    np.testing.assert_allclose(history_in(blended, gathered)[inside, 0], expected[inside], atol=tolerance)


@pytest.mark.parametrize("divisor", [1, 2])
def test_what_was_hidden_takes_no_history(views, divisor):
    """A wall that covers the left half of the picture stands before another; the camera steps aside, by eight pixels of
    the near wall and three of the far one, and sees more of that."""
    width, height = SIZE
    far, near = Plane((0.0, 0.0, -5.0), FLOOR.normal), FLOOR
    before = Shown(wide_camera(), (far, replace(near, half="left")))
    camera = shifted(before.camera, x=1.5)
    covered = np.broadcast_to(np.arange(width) < width // 2 - 8, (height, width))
    surfaces = see(camera, width, height, far)
    surfaces.depth = np.where(covered, see(camera, width, height, near).depth, surfaces.depth)
    points = positions(camera, surfaces.depth)
    old = project(before.camera, points, width, height)
    now = Shown(camera, motion=project(camera, points, width, height) - old, surfaces=surfaces)
    chosen = np.ix_(*gathered_pixels(width, height, divisor))
    some = views(divisor)
    left = np.broadcast_to(np.arange(width) < width // 2, (height, width))[chosen]
    some.show(before, irradiance(np.where(left[..., None], 1.0, 2.0), NOISY, some.shape))
    gathered = irradiance(100.0, NOISY, some.shape)
    blended = some.show(now, gathered)
    # Beside the edge, a texel that saw the far wall is among those around.
    was_hidden = (~covered & (old[..., 0] < width // 2 - divisor) & (old[..., 0] >= 0))[chosen]
    assert was_hidden.any()
    np.testing.assert_array_equal(blended[was_hidden][:, :3], 100.0)
    # What has history has that of its own wall.
    known = blended[..., 0] != 100.0
    assert known.mean() > 0.4
    expected = np.where(covered[chosen], 1.0, 2.0)
    np.testing.assert_allclose(history_in(blended, gathered)[known, 0], expected[known], rtol=100 * ULP)


def test_a_moving_object_takes_its_history_along(views):
    """The whole floor slides by three pixels, and then comes two pixels' width nearer on its way."""
    some, pixel = views(), 2.0 / SIZE[0] * 3.0
    before = Shown(wide_camera())
    column = np.broadcast_to(np.arange(SIZE[0], dtype=float), SIZE[::-1])
    some.show(before, irradiance(1.0 + column[..., None], NOISY, some.shape))
    motion = np.broadcast_to((3.0, 0.0), (*SIZE[::-1], 2))
    for height, count in ((0.0, 1), (2.0 * pixel, 2)):
        gathered = irradiance(100.0, NOISY, some.shape)
        blended = some.show(Shown(before.camera, (Plane((0.0, 0.0, height), FLOOR.normal),), motion), gathered)
        inside = slice(3 * count, None)
        assert (blended[:, inside, 0] != 100.0).all()
        if count == 1:
            history = history_in(blended, gathered)[:, inside, 0]
            np.testing.assert_allclose(history, column[:, inside] - 2.0, rtol=100 * ULP)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e38])
@pytest.mark.parametrize("part", ["all", "irradiance", "surfaces", "depth", "count"])
def test_poisoned_history_is_gone_after_one_view(views, part, value):
    some, shown, gathered = views(), Shown(wide_camera()), irradiance(COLOR, NOISY, (SIZE[1], SIZE[0]))
    arguments = {
        "all": {},
        "irradiance": {"names": HISTORY_TARGETS},
        "surfaces": {"names": HISTORY_SURFACES},
        "depth": {"names": HISTORY_SURFACES, "components": 2},
        "count": {"names": HISTORY_SURFACES, "components": 3},
    }[part]
    some.show(shown, gathered)
    some.poison(value, **arguments)
    for _ in range(2):
        np.testing.assert_allclose(some.show(shown, gathered)[..., :3], gathered[..., :3], rtol=20 * ULP)
    some.poison(value, **arguments)
    np.testing.assert_allclose(some.refine(gathered)[..., :3], gathered[..., :3], rtol=20 * ULP)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e38])
def test_a_bad_sample_takes_the_history_and_leaves_none_of_itself(views, value):
    some, shown = views(), Shown(wide_camera())
    gathered = irradiance(COLOR, NOISY, some.shape)
    some.show(shown, gathered)
    bad = gathered.copy()
    bad[5, 7, 1] = value
    for sample in (some.show(shown, bad), some.refine(bad), some.show(shown, gathered)):
        np.testing.assert_allclose(sample[..., :3], gathered[..., :3], rtol=20 * ULP)


@pytest.mark.parametrize("cut", ["turned", "far", "zoomed"])
def test_a_cut_leaves_no_trace(views, cut):
    some, before = views(), Shown(wide_camera())
    camera = {
        "turned": turned(before.camera, 1.2),
        "far": shifted(before.camera, x=200.0),
        "zoomed": before.camera.cropped(0.3, 0.6, 0.3, 0.6),
    }[cut]
    some.show(before, irradiance(COLOR, NOISY, some.shape))
    gathered = irradiance(100.0, NOISY, some.shape)
    gathered[~texels(Shown(camera), 1)[1]] = 0.0
    np.testing.assert_array_equal(some.show(Shown(camera), gathered), gathered)


def test_only_the_view_before_is_history(views):
    """Not one before that, nor any where nothing is continued, nor what a texture holds that was made anew."""
    some, shown = views(), Shown(wide_camera())
    gathered, other = irradiance(COLOR, NOISY, some.shape), irradiance(100.0, NOISY, some.shape)
    elsewhere = Moment(some.scene, shifted(shown.camera, x=0.1))
    for arguments in ({"previous": elsewhere}, {"previous": None}, {"continuous": False}):
        some.show(shown, gathered)
        np.testing.assert_array_equal(some.show(shown, other, **arguments), other)
    some.show(shown, gathered)
    some.reallocate()
    np.testing.assert_array_equal(some.show(shown, other), other)


def test_a_sample_of_another_surface_neither_takes_history_nor_leaves_any(views):
    """A texel's samples look from several pixels: some may see what is behind. A history of twice 1, on a slope; then a
    sample of 100 that sees something else in the right half; then one of 4."""
    slope = (0.6, 0.0, 0.8)
    some, plane = views(), Plane((0.0, 0.0, 0.0), slope)
    shown = Shown(wide_camera(), (plane,))
    for _ in range(2):
        some.show(shown, irradiance(1.0, NOISY, some.shape))
    behind = (replace(plane, half="left"), Plane((0.0, 0.0, -9.0), slope, "right"))
    first = some.refine(irradiance(100.0, NOISY, some.shape), behind)
    second = some.refine(irradiance(4.0, NOISY, some.shape), (plane,))
    # With one sample of history in the view's first, the share of sample i is (i + 1)/(i + 2). On the right, the sample
    # that was left out is missing from the mean, and what is there counts for no more than the view's own.
    left, right = slice(None, SIZE[0] // 2), slice(SIZE[0] // 2, None)
    np.testing.assert_array_equal(first[:, right, :3], 100.0)
    np.testing.assert_allclose(first[:, left, :3], 1.0 + 99.0 * 2.0 / 3.0, rtol=20 * ULP)
    np.testing.assert_allclose(second[:, left, :3], 34.0 + (4.0 - 34.0) * 3.0 / 4.0, rtol=20 * ULP)
    np.testing.assert_allclose(second[:, right, :3], 4.0, rtol=20 * ULP)
    last = some.show(shown, irradiance(1.0, NOISY, some.shape))
    np.testing.assert_allclose(last[:, left, :3], (1.0 + 1.0 + 100.0 + 4.0 + 1.0) / 5.0, rtol=20 * ULP)
    np.testing.assert_allclose(last[:, right, :3], (1.0 + 1.0 + 4.0 + 1.0) / 4.0, rtol=20 * ULP)


def test_light_that_changed_is_followed(views):
    """Found without noise, nothing of the old light is left. With noise, what is within two standard deviations is, and
    counts for as few samples as it had to be moved far."""
    left = LONGEST * 0.2 / 9.0
    for variance, expected in ((0.0, 1.0), (0.01, 1.0 + 0.2 * left / (left + 1.0))):
        some, shown = views(), Shown(wide_camera())
        for _ in range(LONGEST):
            some.show(shown, irradiance(10.0, variance, some.shape))
        blended = some.show(shown, irradiance(1.0, variance, some.shape))
        np.testing.assert_allclose(blended[..., :3], expected, rtol=1e-5)


def test_the_sky_has_no_history(views):
    half = (Plane(FLOOR.point, FLOOR.normal, "left"),)
    some, shown = views(), Shown(wide_camera(), half)
    gathered = irradiance(COLOR, NOISY, some.shape)
    for sample in (some.show(shown, gathered), some.show(shown, gathered), some.refine(gathered)):
        np.testing.assert_array_equal(sample[:, SIZE[0] // 2 :], 0.0)
    everything = some.show(Shown(shown.camera), irradiance(100.0, NOISY, some.shape))
    np.testing.assert_array_equal(everything[:, SIZE[0] // 2 :, :3], 100.0)


WORLD_ONLY = IndirectSettings(method=IndirectMethod.OCCLUSION, divisor=2)


def world_moment(camera):
    """A box on a plane under an even sky."""
    meshes = builders.quad("floor", half=4.0), builders.box("box", half=0.5)
    return Moment(builders.scene(*meshes, world=(1.0, 1.0, 1.0)), camera)


def test_a_viewport_blends_and_a_final_render_does_not(session, render):
    moment = world_moment(wide_camera())
    views = session.play([moment, moment], indirect=WORLD_ONLY)
    assert all("temporal" in [name for name, _ in view.statistics.passes] for view in views)
    alone = render(moment.scene, moment.camera, indirect=WORLD_ONLY)
    assert "a final render has no views before it" in dict(alone.statistics.left_out)["temporal"]
    first, second = (view.channels[Channel.COMBINED] for view in views)
    assert not np.array_equal(first, second)
    np.testing.assert_allclose(first.mean(), second.mean(), rtol=0.02)


def test_a_picture_after_a_cut_is_as_if_nothing_had_been_before(session):
    """The very same bits, whatever the view before showed."""
    here, there = world_moment(wide_camera()), world_moment(shifted(wide_camera(), x=100.0, z=40.0))
    other = type(session)()
    try:
        pictures = [
            viewport.play([before, here], indirect=WORLD_ONLY)[-1].channels[Channel.COMBINED]
            for viewport, before in ((session, there), (other, Moment(there.scene, shifted(there.camera, y=50.0))))
        ]
    finally:
        other.release()
    np.testing.assert_array_equal(*pictures)
