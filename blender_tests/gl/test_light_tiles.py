# SPDX-License-Identifier: GPL-3.0-or-later
"""The light_tiles pass alone: lights against view depths that the tests write, and against numpy."""

from dataclasses import replace
from types import SimpleNamespace

import moderngl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.render import PlannedPass, gl_thread
from addon.render.layout import (
    CHANNELS,
    LIGHT_TILES_TARGET,
    TILE_SIZE,
    depth_tiles_target,
    light_pages,
    light_tiles_target,
)
from addon.render.light_table import TEXELS_PER_SAMPLE, as_texels, light_rows
from addon.render.passes.depth_tiles import DepthTilesPass
from addon.render.passes.light_tiles import LightTilesPass
from addon.render.targets import TexturePool
from addon.scene import AreaShape, Camera, LightKind
from blender_tests import builders

VIEW_DEPTH = next(channel for channel in CHANNELS if channel.name == "view_depth")


def masks_on_gpu(camera, depth, lights, reach):
    """(layers, tiles up, tiles across, L) bool of view depths (layers, H, W), lights and how far (L,) each reaches."""
    layers, height, width = depth.shape

    def job(device):
        def texture(rows):
            image = as_texels(rows)
            made = device.context.texture((image.shape[1], image.shape[0]), 4, image, dtype="f4")
            made.filter = (moderngl.NEAREST, moderngl.NEAREST)
            return made

        samples = np.zeros((len(lights), TEXELS_PER_SAMPLE, 4), np.float32)
        samples[:, 2, 0] = reach**2
        table, samples = texture(light_rows(lights, camera.position)), texture(samples)
        pool, passes = TexturePool(device), [DepthTilesPass(device), LightTilesPass(device)]
        targets = (VIEW_DEPTH.target(layers), depth_tiles_target(layers), light_tiles_target(layers, len(lights)))
        frame = SimpleNamespace(
            pool=pool,
            camera=camera,
            plan=SimpleNamespace(layers=layers),
            lighting=SimpleNamespace(table=lambda: table, upload_samples=lambda: samples, count=len(lights)),
        )
        try:
            pool.prepare((width, height), targets)
            pool.texture(targets[0].name).write(depth.tobytes(), alignment=1)
            for render_pass, read, written in zip(passes, targets, targets[1:], strict=False):
                render_pass.run(frame, PlannedPass(render_pass.name, (read.name,), (written,)))
            across, up, _ = pool.texture(LIGHT_TILES_TARGET).size
            assert device.context.error == "GL_NO_ERROR"
            return np.frombuffer(pool.read(LIGHT_TILES_TARGET), np.uint32).reshape(layers, -1, up, across, 4)
        finally:
            for item in (*passes, pool, table, samples):
                item.release()

    words = np.moveaxis(gl_thread().submit(job).result(), 1, 3)
    bits = words[..., None] >> np.arange(32, dtype=np.uint32) & 1
    bits = bits.reshape(*words.shape[:3], -1).astype(bool)
    assert bits.shape[-1] == 128 * light_pages(len(lights))
    assert not bits[..., len(lights) :].any()
    return bits[..., : len(lights)]


def pixel_positions(camera, depth):
    """(layers, H, W, 3) float64, world space, at pixel centres; NaN where empty."""
    _, height, width = depth.shape
    left, right, bottom, top = camera.window
    x = left + (np.arange(width) + 0.5) / width * (right - left)
    y = bottom + (np.arange(height) + 0.5) / height * (top - bottom)
    z = np.where(np.isinf(depth), np.nan, depth).astype(np.float64)
    scale = np.ones_like(z) if camera.orthographic else z
    return np.stack([x * scale, y[:, None] * scale, -z], axis=-1) @ camera.rotation.T + camera.position


def points_of(light, generator, count=16):
    """World-space points of a lamp, its middle first."""
    center, rotation = light.world_from_light[:3, 3], light.world_from_light[:3, :3]
    if light.kind is LightKind.AREA:
        local = np.column_stack([generator.uniform(-0.5, 0.5, (count, 2)) * light.size, np.zeros(count)])
    else:
        local = generator.normal(size=(count, 3))
        local *= light.radius / np.linalg.norm(local, axis=1, keepdims=True)
    local[0] = 0.0
    return center + local @ rotation.T


def is_lit(light, reach, positions, generator):
    """Which positions (…, 3) a light may light: within reach of its middle, before any point of it that shines."""
    center, axis = light.world_from_light[:3, 3], -light.world_from_light[:3, 2]
    with np.errstate(invalid="ignore"):
        lit = np.linalg.norm(positions - center, axis=-1) < reach
        if light.kind in (LightKind.POINT, LightKind.SUN):
            return lit
        shines = np.zeros_like(lit)
        for point in points_of(light, generator):
            towards = positions - point
            cosine = (towards @ axis) / np.linalg.norm(towards, axis=-1)
            shines |= cosine > (np.cos(0.5 * light.angle) if light.kind is LightKind.SPOT else 0.0)
    return lit & shines


def by_tile(pixels):
    """(layers, H, W) bool: whether any pixel of each tile is."""
    layers, height, width = pixels.shape
    padded = np.zeros((layers, -(-height // TILE_SIZE) * TILE_SIZE, -(-width // TILE_SIZE) * TILE_SIZE), bool)
    padded[:, :height, :width] = pixels
    return padded.reshape(layers, padded.shape[1] // TILE_SIZE, TILE_SIZE, -1, TILE_SIZE).any(axis=(2, 4))


def random_rotation(generator):
    rotation, _ = np.linalg.qr(generator.normal(size=(3, 3)))
    return rotation * np.sign(np.linalg.det(rotation))


def random_camera(generator, *, orthographic, mirrored):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = random_rotation(generator), generator.uniform(-100.0, 100.0, 3)
    left, bottom = generator.uniform(-1.5, 0.0, 2)
    right, top = np.add((left, bottom), generator.uniform(0.3, 2.5, 2))
    return Camera(pose, (right, left, bottom, top) if mirrored else (left, right, bottom, top), 0.1, 1e3, orthographic)


def random_depth(generator, shape):
    """Surfaces that are smooth in most tiles, broken in some and missing in others."""
    layers, height, width = shape
    y, x = np.mgrid[:height, :width]
    base = 8.0 + 3.0 * np.sin(x / 17.0 + np.arange(layers)[:, None, None]) + 2.0 * np.cos(y / 11.0)
    steps = np.kron(generator.uniform(0.5, 2.0, (-(-height // 23), -(-width // 23))), np.ones((23, 23)))
    depth = base * np.where(generator.random() < 0.5, 1.0, steps[:height, :width])
    holes = np.kron(generator.random((-(-height // 9), -(-width // 9))) < 0.2, np.ones((9, 9)))[:height, :width]
    return np.where(holes > 0.0, np.inf, depth).astype(np.float32)


def random_lights(generator, camera, count):
    """Lamps of every kind before and around the camera, and how far each reaches."""
    lights, reach = [], 10.0 ** generator.uniform(-1.0, 1.3, count)
    for index in range(count):
        kind = list(LightKind)[generator.integers(4)]
        pose = np.eye(4)
        pose[:3, :3] = random_rotation(generator)
        pose[:3, 3] = camera.rotation @ (generator.normal(size=3) * (8.0, 8.0, 6.0) - (0, 0, 8.0)) + camera.position
        lamp = builders.light(
            kind,
            radius=generator.uniform(0.0, 0.5) * (kind is not LightKind.AREA),
            angle=generator.uniform(0.02, np.pi),
            shape=list(AreaShape)[generator.integers(2)],
            size=tuple(generator.uniform(0.01, 2.0, 2)) if kind is LightKind.AREA else (0.0, 0.0),
        )
        lights.append(replace(lamp, world_from_light=pose))
        if kind is LightKind.SUN:
            reach[index] = np.inf
    return lights, reach


@settings(max_examples=20, deadline=None)
@given(
    st.booleans(),
    st.booleans(),
    st.integers(1, 2),
    st.integers(1, 45),
    st.integers(1, 60),
    st.sampled_from([17, 128, 130, 270]),
    st.integers(0, 2**32 - 1),
)
def test_no_light_that_reaches_a_pixel_is_missing_in_its_tile(
    orthographic, mirrored, layers, height, width, count, seed
):
    generator = np.random.default_rng(seed)
    camera = random_camera(generator, orthographic=orthographic, mirrored=mirrored)
    depth = random_depth(generator, (layers, height, width))
    lights, reach = random_lights(generator, camera, count)
    masks = masks_on_gpu(camera, depth, lights, reach)
    positions = pixel_positions(camera, depth)
    for index, light in enumerate(lights):
        needed = by_tile(is_lit(light, reach[index], positions, generator))
        missing = needed & ~masks[..., index]
        assert not missing.any(), (light, reach[index], np.argwhere(missing))
    assert not masks[~by_tile(np.isfinite(depth))].any()


@pytest.mark.parametrize("orthographic", [False, True])
def test_few_lights_are_in_a_tile_without_reaching_it(orthographic):
    """On a smooth surface: none that is farther beyond its reach than the tile is large, and few in all.

    Measured where a tile is 1 m wide and lights reach 0.1 to 6 m: 1.25 times as many as reach pixels, 1.36 of an
    orthographic camera; a spot's cone is tested against a ball about the tile.
    """
    generator = np.random.default_rng(8)
    half = 8.0 if orthographic else 1.0
    camera = replace(builders.camera(z=0.0, orthographic=orthographic), window=(-half, half, -half, half))
    y, x = np.mgrid[:256, :256]
    depth = (8.0 + 2.0 * np.sin(x / 80.0) + 1.5 * np.cos(y / 60.0)).astype(np.float32)[None]
    lights, reach = random_lights(generator, camera, 150)
    reach = np.minimum(reach, 6.0)
    masks = masks_on_gpu(camera, depth, lights, reach)
    positions = pixel_positions(camera, depth)
    lit = [by_tile(is_lit(light, reach[i], positions, generator)) for i, light in enumerate(lights)]
    needed = np.stack(lit, axis=-1)
    assert masks.sum() <= 1.4 * needed.sum()
    assert masks.mean() < 0.1
    tiles = positions.reshape(16, TILE_SIZE, 16, TILE_SIZE, 3).swapaxes(1, 2).reshape(16, 16, -1, 3)
    middles = tiles.mean(axis=2, keepdims=True)
    across = 2.0 * np.linalg.norm(tiles - middles, axis=-1).max() * (TILE_SIZE + 1) / TILE_SIZE
    for index, light in enumerate(lights):
        nearest = np.linalg.norm(tiles - light.world_from_light[:3, 3], axis=-1).min(axis=-1)
        assert not (masks[0, ..., index] & (nearest > reach[index] + across)).any()


def test_a_light_is_only_in_the_tiles_about_it():
    """One at the middle of a plane of 3×3 tiles, each 1 m wide, that reaches 0.4 m; another 0.6 m."""
    camera = builders.camera(z=5.0, half_width=1.5, orthographic=True)
    depth = np.full((1, 48, 48), 5.0, np.float32)
    near, far = builders.light(position=(0.0, 0.0, 0.0)), builders.light(position=(0.0, 0.0, 0.0))
    masks = masks_on_gpu(camera, depth, [near, far], np.array([0.4, 0.6]))[0]
    assert masks[..., 0].tolist() == [[False] * 3, [False, True, False], [False] * 3]
    assert masks[..., 1].tolist() == [[False, True, False], [True] * 3, [False, True, False]]
