# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance that has a closed form, in float64; directions and positions are (3,), from the lit point."""

import numpy as np


def polygon_irradiance(corners, normal, radiance=1.0):
    """Of a uniformly radiant polygon (V, 3) that faces the origin, on a surface there, the horizon respected.

    Lambert's sum over the edges, Σ Γ·(v×w)/|v×w| · n / 2: Baum et al. 1989, "Improving Radiosity Solutions Through the
    Use of Analytically Determined Form-Factors".
    """
    corners = clipped(np.asarray(corners, np.float64), np.asarray(normal, np.float64))
    if len(corners) < 3:
        return 0.0
    unit = corners / np.linalg.norm(corners, axis=-1, keepdims=True)
    following = np.roll(unit, -1, axis=0)
    across = np.cross(unit, following)
    lengths = np.linalg.norm(across, axis=-1)
    angles = np.arctan2(lengths, (unit * following).sum(axis=-1))
    edges = lengths > 0.0
    terms = angles[edges] * (across[edges] @ normal) / lengths[edges]
    return 0.5 * radiance * abs(terms.sum())


def clipped(corners, normal):
    """The part of a convex polygon (V, 3) on the side of a plane through the origin that `normal` points to.

    Sutherland and Hodgman 1974, "Reentrant Polygon Clipping".
    """
    kept = []
    heights = corners @ normal
    for index in range(len(corners)):
        start, end = index - 1, index
        if (heights[start] > 0.0) != (heights[end] > 0.0):
            share = heights[start] / (heights[start] - heights[end])
            kept.append(corners[start] + share * (corners[end] - corners[start]))
        if heights[end] > 0.0:
            kept.append(corners[end])
    return np.array(kept).reshape(-1, 3)


def sphere_irradiance(sine, cosine, radiance=1.0):
    """Of a uniform sphere whose angular radius has this sine < 1, its centre at this cosine from the normal.

    Snyder 1996, "Area Light Sources for Real-Time Graphics": π L sin² cos above the horizon, and what is left of it
    where the sphere is cut by it.
    """
    if cosine >= sine:
        return np.pi * radiance * cosine * sine**2
    if cosine <= -sine:
        return 0.0
    tangent = np.sqrt(1.0 / sine**2 - 1.0)
    rest = np.sqrt(1.0 - (cosine / sine) ** 2)
    cut = cosine * np.arccos(-cosine * tangent / np.sqrt(1.0 - cosine**2)) - rest * tangent
    return radiance * (cut * sine**2 + np.arctan(rest / tangent))


def disk_share(edge):
    """Share of a unit disk that lies beyond a straight edge at a signed distance from its centre: a segment's area."""
    edge = np.clip(edge, -1.0, 1.0)
    return (np.arccos(edge) - edge * np.sqrt(1.0 - edge * edge)) / np.pi


def disk_corners(center, half_x, half_y, count=2048):
    """A polygon (count, 3) of an ellipse's area and centre: its error falls with the square of the count."""
    angles = 2.0 * np.pi * np.arange(count) / count
    grown = np.sqrt(2.0 * np.pi / count / np.sin(2.0 * np.pi / count))
    return center + grown * (np.cos(angles)[:, None] * half_x + np.sin(angles)[:, None] * half_y)


def rectangle_corners(center, half_x, half_y):
    """The four corners (4, 3) in order."""
    center, half_x, half_y = (np.asarray(item, np.float64) for item in (center, half_x, half_y))
    return np.array([center + x * half_x + y * half_y for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])


def facing(direction, turn=0.0):
    """A rotation (3, 3) whose −Z points along `direction` (3,), turned about it by `turn` radians."""
    z = -np.asarray(direction, np.float64) / np.linalg.norm(direction)
    x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0), z)
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    cosine, sine = np.cos(turn), np.sin(turn)
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=1)
