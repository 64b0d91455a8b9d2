# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit linearly transformed cosines to the GGX BRDF and write the table that the add-on loads.

python tooling/fit_ltc.py      # about a minute; only needed again where the BRDF of shaders/common/ggx.glsl changes

Heitz, Dupuy, Hill and Neubelt 2016, "Real-Time Polygonal-Light Shading with Linearly Transformed Cosines". Per node of
the table, a matrix M is sought such that directions distributed as a clamped cosine, transformed by M, are distributed
as the BRDF times n·l reflects them, without Fresnel. Light in the plane of view leaves three free parameters.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

sys.path.append(str(Path(__file__).resolve().parent.parent))

from addon.render.ggx_albedo import reflection_weight, visible_normals
from addon.render.ltc import LTC_FILE, TABLE_SIZE, node_cosines, node_roughnesses

Array = npt.NDArray[np.float64]

STRATA = 32
SMALLEST_ALPHA = 1e-3  # of shaders/common/ggx.glsl
NARROWEST = 1e-7  # of a lobe's scales


class Lobe:
    """GGX times n·l for one view, normalised to 1, and directions drawn from it and from transformed cosines."""

    def __init__(self, alpha: float, view_cosine: float) -> None:
        self._alpha = alpha
        self._view = np.array([np.sqrt(1.0 - view_cosine**2), 0.0, view_cosine])
        strata = (np.arange(STRATA) + 0.5) / STRATA
        first, second = (grid.ravel() for grid in np.meshgrid(strata, strata))
        around = np.stack([np.cos(2.0 * np.pi * first), np.sin(2.0 * np.pi * first)], axis=-1)
        self._cosine_distributed = np.column_stack([np.sqrt(second)[:, None] * around, np.sqrt(1.0 - second)])
        half = visible_normals(alpha, self._view[2:], np.column_stack([first, second]))[0]
        self._drawn = 2.0 * (half @ self._view)[:, None] * half - self._view
        weights = reflection_weight(alpha, self._view[2:], self._drawn[:, 2])
        self.albedo = float(weights.mean())
        self.mean_direction = (weights[:, None] * self._drawn).sum(axis=0)
        self.mean_direction /= np.linalg.norm(self.mean_direction)
        self._drawn = self._drawn[self._drawn[:, 2] > 0.0]
        self._value_drawn, self._density_drawn = self._value(self._drawn)

    def _value(self, light: Array) -> tuple[Array, Array]:
        """Normalised BRDF times n·l towards light directions (N, 3), and the density that they are drawn with."""
        half = light + self._view
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        a2, cosine = self._alpha**2, self._view[2]
        # 1 + z²(a² − 1), without losing the digits of a narrow lobe.
        denominator = half[:, 0] ** 2 + half[:, 1] ** 2 + a2 * half[:, 2] ** 2
        distribution = a2 / (np.pi * denominator**2)
        # G₁ D / (4 n·v), with n·v / G₁ = (n·v + √(a² + (1 − a²) (n·v)²)) / 2.
        density = distribution / (2.0 * (cosine + np.sqrt(a2 + (1.0 - a2) * cosine**2)))
        return density * reflection_weight(self._alpha, self._view[2:], light[:, 2]) / self.albedo, density

    def error(self, matrix: Array) -> float:
        """Cubed difference to the cosine that `matrix` transforms, integrated with samples of both."""
        inverse = np.linalg.inv(matrix)
        determinant = abs(np.linalg.det(inverse))

        def transformed_cosine(light: Array) -> Array:
            original = light @ inverse.T
            length = np.linalg.norm(original, axis=1)
            return np.maximum(original[:, 2], 0.0) / (np.pi * length**4) * determinant

        drawn = self._cosine_distributed @ matrix.T
        drawn /= np.linalg.norm(drawn, axis=1, keepdims=True)
        density = transformed_cosine(drawn)
        value, other_density = self._value(drawn)
        ours = np.abs(density - value) ** 3 / (density + other_density)
        fitted = transformed_cosine(self._drawn)
        theirs = np.abs(fitted - self._value_drawn) ** 3 / (fitted + self._density_drawn)
        return float(ours.sum() + theirs.sum())


def lobe_matrix(parameters: Array, mean_direction: Array) -> Array:
    """M (3, 3): scales along and across the plane of view and a shear, about the lobe's mean direction."""
    scale_x, scale_y, shear = parameters
    x, z = mean_direction[0], mean_direction[2]
    frame = np.array([[z, 0.0, x], [0.0, 1.0, 0.0], [-x, 0.0, z]])
    return frame @ np.array([[max(scale_x, NARROWEST), 0.0, shear], [0.0, max(scale_y, NARROWEST), 0.0], [0, 0, 1.0]])


def minimum(function: Callable[[Array], float], start: Array, step: Array, iterations: int = 120) -> Array:
    """Where `function` is least, by the simplex of Nelder and Mead (1965), from `start` with edges `step`."""
    points = np.vstack([start, start + np.diag(step)])
    values = np.array([function(point) for point in points])
    for _ in range(iterations):
        order = np.argsort(values)
        points, values = points[order], values[order]
        if np.all(np.abs(points[1:] - points[0]) <= 1e-5 * np.abs(step)):
            break
        centre = points[:-1].mean(axis=0)
        candidate = 2.0 * centre - points[-1]
        value = function(candidate)
        if value < values[0]:
            farther = 3.0 * centre - 2.0 * points[-1]
            farther_value = function(farther)
            if farther_value < value:
                candidate, value = farther, farther_value
        elif value >= values[-2]:
            inside = 0.5 * (centre + (candidate if value < values[-1] else points[-1]))
            inside_value = function(inside)
            if inside_value < min(value, values[-1]):
                candidate, value = inside, inside_value
            else:
                points[1:] = 0.5 * (points[1:] + points[0])
                values[1:] = [function(point) for point in points[1:]]
                continue
        points[-1], values[-1] = candidate, value
    return points[np.argmin(values)]


def fit(roughness: float, cosine: float, start: Array) -> tuple[Array, Array]:
    """Parameters of the best lobe and M⁻¹, scaled to 1 in its middle."""
    alpha = max(roughness**2, SMALLEST_ALPHA)
    lobe = Lobe(alpha, cosine)
    upright = cosine > 1.0 - 1e-9
    mean_direction = np.array([0.0, 0.0, 1.0]) if upright else lobe.mean_direction
    if upright:  # round: one parameter
        scale = minimum(
            lambda p: lobe.error(lobe_matrix(np.array([p[0], p[0], 0.0]), mean_direction)), start[:1], 0.1 * start[:1]
        )
        best = np.array([scale[0], scale[0], 0.0])
    else:
        best = minimum(lambda p: lobe.error(lobe_matrix(p, mean_direction)), start, 0.1 * start[[0, 1, 1]])
    inverse = np.linalg.inv(lobe_matrix(best, mean_direction))
    return best, inverse / inverse[1, 1]


def main() -> None:
    """Fit every node, from rough to smooth and from upright to grazing, each from its neighbour's solution."""
    table = np.empty((TABLE_SIZE, TABLE_SIZE, 4))
    upright = np.array([1.0, 1.0, 0.0])
    for column in reversed(range(TABLE_SIZE)):
        roughness = node_roughnesses()[column]
        best = upright
        for row, cosine in enumerate(node_cosines()):
            best, inverse = fit(roughness, cosine, best)
            upright = best if row == 0 else upright
            table[row, column] = inverse[0, 0], inverse[0, 2], inverse[2, 0], inverse[2, 2]
        print(f"roughness {roughness:.2f}")
    np.savez_compressed(LTC_FILE, inverse_matrix=table.astype(np.float32))


if __name__ == "__main__":
    main()
