# SPDX-License-Identifier: GPL-3.0-or-later
"""What screen-space passes compute, in float64 from layers that were read back; pictures without guard band.

Arrays are (H, W, …), row 0 at the bottom, of a picture's first sample, whose random numbers are not shifted. Formulas:
METHOD's ambient obscurance and radiosity, after Mara et al. 2016, "Deep G-Buffers for Stable Global Illumination
Approximation".
"""

from dataclasses import dataclass

import numpy as np

from addon.render import gl_thread
from addon.render.indirect_plan import IRRADIANCE_TARGET
from addon.render.readback import read_target

AMBIGUOUS = 2e-3
"""Pixels from the edge of one within which float32 may take a tap for its neighbour's."""


@dataclass
class Layers:
    """A camera's view of the layers (L, H, W, …): relative positions (m), normals, radiance W/(sr·m²)."""

    camera: object
    depth: np.ndarray
    positions: np.ndarray
    normals: np.ndarray
    radiance: np.ndarray
    albedo: np.ndarray

    @property
    def shape(self):
        return self.depth.shape[1:]

    @property
    def covered(self):
        """(H, W) where there is a nearest surface."""
        return np.isfinite(self.depth[0])


def read_back(view, camera):
    """The layers of a view that was rendered with `deep_output`."""
    stacked = {
        name: np.stack([getattr(layer, name) for layer in view.layers]).astype(np.float64)
        for name in ("depth", "normal", "radiance", "albedo")
    }
    depth = stacked["depth"]
    _, height, width = depth.shape
    left, right, bottom, top = camera.window
    x = left + (np.arange(width) + 0.5) / width * (right - left)
    y = bottom + (np.arange(height) + 0.5) / height * (top - bottom)
    scale = np.ones_like(depth) if camera.orthographic else depth
    with np.errstate(invalid="ignore"):
        points = np.stack([x * scale, y[:, None] * scale, -depth], axis=-1) @ camera.rotation.T
    return Layers(camera, depth, points, stacked["normal"], stacked["radiance"], stacked["albedo"])


def pixels_per_metre(layers, depth):
    """(H, W, 2) at view depths (H, W)."""
    left, right, bottom, top = layers.camera.window
    height, width = layers.shape
    scale = np.ones_like(depth) if layers.camera.orthographic else depth
    return np.stack([width / (right - left) / scale, height / (top - bottom) / scale], axis=-1)


def subsampled(pixels, level, size):
    """The pixels (N, 2) that stand for those of a pyramid whose levels keep one of four on a rotated grid."""
    texels = pixels >> level
    for _ in range(level):
        texels = 2 * texels + ((texels[..., ::-1] & 1) ^ 1)
    return np.minimum(texels, np.asarray(size) - 1)


def hilbert_index(x, y):
    """How far along a Hilbert curve over 64 × 64 pixels a pixel is."""
    index, side = 0, 32
    while side:
        rx, ry = int(x & side > 0), int(y & side > 0)
        index += side * side * ((3 * rx) ^ ry)
        if ry == 0:
            if rx == 1:
                x, y = 63 - x, 63 - y
            x, y = y, x
        side //= 2
    return index


def lattice_point(ray, rays, shape):
    """(H, W, 2): a point of `rays` per pixel in [0, 1)²."""
    height, width = shape
    curve = np.array([[hilbert_index(x & 63, y & 63) for x in range(width)] for y in range(height)])
    ratios = np.array([0.7548776662466927, 0.5698402909980532], np.float32)
    lattice = np.array([(ray + 0.5) / rays, ray * 0.6180339887498949 % 1.0], np.float32)
    moved = np.modf(curve[..., None].astype(np.float32) * ratios)[0]  # rounded as on the GPU
    return np.modf(lattice + moved)[0].astype(np.float64)


def taps(layers, depth, count, turns, radius, fractions, finest, divisor=1):
    """For each tap: (H, W, 2) pixels, (H, W) whether they are on the screen, (H, W) whether that is certain.

    `fractions` (H, W): how far within its step a tap is; `finest`: exponent of the offset that is not subsampled.
    `divisor`: pixels along each side of those whose taps are the same.
    """
    height, width = layers.shape
    y, x = np.mgrid[:height, :width] // divisor
    hashed = np.float32(((3 * x) ^ (y + x * y)) & 1023) * np.float32(10.0 / (2.0 * np.pi))
    y, x = np.mgrid[:height, :width]
    phase = hashed.astype(np.float64)
    disc = radius * pixels_per_metre(layers, np.where(np.isfinite(depth), depth, 1.0))
    for tap in range(count):
        fraction = (tap + fractions) / count
        angle = 2.0 * np.pi * (fraction * turns + phase)
        offset = np.maximum(fraction[..., None] * disc, 0.75) * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        place = np.stack([x, y], axis=-1) + 0.5 + offset
        on_screen = ((place >= 0.0) & (place < (width, height))).all(axis=-1)
        exponent = np.log2(np.linalg.norm(offset, axis=-1))
        level = np.clip(np.floor(exponent).astype(int) - finest, 0, 5)
        near_edge = (np.abs(place - np.round(place)) < AMBIGUOUS).any(axis=-1)
        near_level = np.abs(exponent - np.round(exponent)) < AMBIGUOUS
        pixels = np.where(on_screen[..., None], place, 0.0).astype(int)
        for step in range(1, 6):
            chosen = level == step
            pixels[chosen] = subsampled(pixels[chosen], step, (width, height))
        yield pixels, on_screen, ~(near_edge | near_level)


def obscurance(layers, count, turns, radius):
    """Mean of the taps' obscurance (H, W) and where it is certain (H, W)."""
    bias = 0.023 / 0.75 * radius + 4.0 * 1.1920929e-7 * np.where(layers.covered, layers.depth[0], 0.0)
    softening = 1e-3 / 0.75**2 * radius**2
    total, number, certain = np.zeros(layers.shape), np.zeros(layers.shape), layers.covered.copy()
    fractions = np.full(layers.shape, 0.5)
    with np.errstate(invalid="ignore"):
        for pixels, on_screen, sure in taps(layers, layers.depth[0], count, turns, radius, fractions, 3):
            offset = layers.positions[:, pixels[..., 1], pixels[..., 0]] - layers.positions[0]
            squared = (offset**2).sum(axis=-1)
            elevation = ((offset * layers.normals[0]).sum(axis=-1) - bias) / np.sqrt(squared + softening)
            value = np.where(squared < radius**2, (1.0 - squared / radius**2) * np.maximum(elevation, 0.0), 0.0)
            total += np.where(on_screen, value.max(axis=0), 0.0)
            number += on_screen
            certain &= sure
    return total / np.maximum(number, 1.0), certain


@dataclass
class Senders:
    """Sums over the taps' layers that may send to each pixel of a layer (H, W, …)."""

    radiance: np.ndarray
    cosines: np.ndarray
    count: np.ndarray
    taps: np.ndarray
    certain: np.ndarray


def senders(layers, radiance, count, turns, radius, receiver=0, divisor=1):
    """What the layers' `radiance` (L, H, W, 3) sends to the pixels of one of them; `divisor` as in `taps`."""
    shape = layers.shape
    found = Senders(np.zeros((*shape, 3)), *(np.zeros(shape) for _ in range(3)), np.isfinite(layers.depth[receiver]))
    y, x = np.mgrid[: shape[0], : shape[1]] // divisor
    jitter = 0.1 + 0.8 * lattice_point(0, 1, shape)[y, x, 0]
    with np.errstate(invalid="ignore"):
        for pixels, on_screen, sure in taps(layers, layers.depth[receiver], count, turns, radius, jitter, 4, divisor):
            x, y = pixels[..., 0], pixels[..., 1]
            offset = layers.positions[:, y, x] - layers.positions[receiver]
            distance = np.linalg.norm(offset, axis=-1)
            direction = offset / (distance + 1e-5 * radius)[..., None]
            cosine = (direction * layers.normals[receiver]).sum(axis=-1)
            facing = -(direction * layers.normals[:, y, x]).sum(axis=-1)
            valid = (cosine > 0.0) & (facing > 0.01) & on_screen
            # Where either cosine is within rounding of its limit, so is what becomes of the tap.
            grazing = (np.abs(cosine) < 1e-4) & (facing > 0.005)
            averted = (np.abs(facing - 0.01) < 1e-4) & (cosine > -1e-4)
            sends = np.where(valid & (distance < radius), cosine, 0.0)
            found.radiance += (sends[..., None] * radiance[:, y, x]).sum(axis=0)
            found.cosines += sends.sum(axis=0)
            found.count += valid.sum(axis=0)
            found.taps += on_screen
            found.certain &= sure & ~(grazing | averted).any(axis=0)
    return found


def energy_correct_irradiance(found):
    """(H, W, 3) W/m²: taps without a sender are dark, and no more comes than a hemisphere of the brightest sends."""
    weight = np.minimum(
        2.0 * np.pi / np.maximum(np.maximum(found.count, found.taps), 1.0), np.pi / np.maximum(found.cosines, 1e-6)
    )
    return weight[..., None] * found.radiance


def reported_over_found_variance(session, show, pictures=12):
    """What `indirect.irradiance` says its luminance's variance is, over by how much it differs between seeds.

    `show`: renders a picture of one sample with a seed into the session.
    """

    def irradiance(_device):
        return read_target(session._renderer._pool, IRRADIANCE_TARGET)[0].astype(np.float64)

    found = []
    for seed in range(1, pictures + 1):
        show(seed)
        found.append(gl_thread().submit(irradiance).result())
    luminance = np.stack(found)[..., :3] @ (0.2126, 0.7152, 0.0722)
    return np.stack(found)[..., 3].mean() / luminance.var(axis=0, ddof=1).mean()
