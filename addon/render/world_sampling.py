# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions from which the world shines, drawn in proportion to how much."""

import numpy as np

from ..scene import World
from ..scene.arrays import Float32Array, Float64Array, Int64Array
from ..scene.equirectangular import box_sums, coarsened, look_up, texel_solid_angles

_LARGEST_TABLE = (256, 512)
_COARSE = (512, 1024)  # to which larger maps are averaged first
UNIFORM_SHARE = 0.25
"""Share of the samples that are drawn from everywhere alike: no direction's weight is more than what drawing all of
them so would give, divided by this."""
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


class WorldSampler:
    """Draws directions of one world.

    A map's directions are drawn from a table of its mean luminance, cell by cell, evenly within a cell; those of a
    world of one colour evenly from the whole sphere. Points that fill the unit square evenly give directions that fill
    the sphere evenly, weighted so.
    """

    def __init__(self, world: World) -> None:
        self._radiance = np.array(world.radiance)
        self._pixels = None if world.environment is None else world.environment.pixels
        turn = world.environment_from_world
        self._world_from_environment = np.eye(3) if turn is None else np.asarray(turn, np.float64).T
        cells = np.ones((1, 1)) if self._pixels is None else _cell_luminances(self._pixels, self._radiance)
        height, width = cells.shape
        self._solid_angles = texel_solid_angles(height, width)
        power = cells * self._solid_angles[:, None]
        everywhere = np.broadcast_to(self._solid_angles[:, None] / (4.0 * np.pi), power.shape)
        total = float(power.sum())
        self._probabilities = (
            everywhere if total == 0.0 else everywhere + (power / total - everywhere) * (1.0 - UNIFORM_SHARE)
        )
        self._row_edges = _cumulated(self._probabilities.sum(axis=1)[None])[0]
        self._column_edges = _cumulated(self._probabilities)

    def directions(self, points: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(directions, weights), each (n, 3) float64, for points (n, 2) in [0, 1).

        Directions are unit vectors in world space. A weight is the world's radiance there over the probability density
        per steradian: the mean of weight · f(direction) over well-distributed points tends to the integral of
        radiance · f over the sphere.
        """
        height, width = self._probabilities.shape
        row, within_row = _inverted(self._row_edges[None], np.zeros(len(points), np.int64), points[:, 1])
        column, within_column = _inverted(self._column_edges, row, points[:, 0])
        lowest, highest = (np.sin(((row + edge) / height - 0.5) * np.pi) for edge in (0.0, 1.0))
        sine = lowest + (highest - lowest) * within_row
        azimuth = (0.5 - (column + within_column) / width) * 2.0 * np.pi
        cosine = np.sqrt(np.maximum(1.0 - sine * sine, 0.0))
        drawn = np.stack([cosine * np.cos(azimuth), cosine * np.sin(azimuth), sine], axis=-1)
        density = self._probabilities[row, column] / self._solid_angles[row]
        return drawn @ self._world_from_environment.T, self._shown(drawn) / density[:, None]

    def _shown(self, directions: Float64Array) -> Float64Array:
        """(n, 3) radiance of directions (n, 3) of the map."""
        if self._pixels is None:
            return np.broadcast_to(self._radiance, directions.shape)
        return look_up(self._pixels, directions) * self._radiance


def _cell_luminances(pixels: Float32Array, radiance: Float64Array) -> Float64Array:
    """(H, W) mean luminance, up to a factor, of a map (h, w, 3) times `radiance` in at most 256 × 512 cells.

    Over one texel, bilinear interpolation has a mean of ¾ the texel and ⅛ either neighbour, along each axis.
    """
    weights = _LUMINANCE * radiance / max(float(radiance.max()), np.finfo(np.float64).tiny)
    luminance = coarsened(pixels, *_COARSE) @ weights.astype(np.float32)
    beside = np.pad(luminance, ((0, 0), (1, 1)), mode="wrap")
    luminance = np.float32(0.75) * luminance + np.float32(0.125) * (beside[:, :-2] + beside[:, 2:])
    above = np.pad(luminance, ((1, 1), (0, 0)), mode="edge")
    luminance = np.float32(0.75) * luminance + np.float32(0.125) * (above[:-2] + above[2:])
    rows, columns = (min(size, largest) for size, largest in zip(luminance.shape, _LARGEST_TABLE, strict=True))
    by_column = box_sums(luminance, np.linspace(0.0, luminance.shape[1], columns + 1))
    cells = box_sums(by_column.T, np.linspace(0.0, luminance.shape[0], rows + 1)).T
    return cells * (rows * columns / luminance.size)


def _cumulated(probabilities: Float64Array) -> Float64Array:
    """(rows, n + 1) from 0 to 1: the shares of each row (rows, n) that lie before each cell and after the last."""
    sums = np.pad(np.cumsum(probabilities, axis=1), ((0, 0), (1, 0)))
    return sums / sums[:, -1:]


def _inverted(edges: Float64Array, rows: Int64Array, shares: Float64Array) -> tuple[Int64Array, Float64Array]:
    """(cell, place within it 0…1), each (n,): where `shares` (n,) in [0, 1) lie in these rows of cumulated shares."""
    count = edges.shape[1] - 1
    # One sorted list for all rows: row r lies in r … r + 1.
    ascending = (edges[:, 1:] + np.arange(len(edges))[:, None]).ravel()
    cell = np.searchsorted(ascending, shares + rows, side="right") - rows * count
    cell = np.clip(cell, 0, count - 1)
    first, last = edges[rows, cell], edges[rows, cell + 1]
    place = np.divide(shares - first, last - first, out=np.full(len(shares), 0.5), where=last > first)
    return cell, np.clip(place, 0.0, 1.0)
