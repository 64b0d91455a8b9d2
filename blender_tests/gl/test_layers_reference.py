# SPDX-License-Identifier: GPL-3.0-or-later
"""The deep G-buffer against a float64 ray caster: which surface is in which layer, and the minimum separation Δz."""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import count, pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from layer_raycast import LayerReference, raycast_layers

from addon.render import Device, LayerImages, Renderer, gl_thread
from addon.scene import Camera, InstanceBatch, Material, Mesh, RenderSettings, Scene, SlotRange

WIDTH, HEIGHT = 96, 64
BOX_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
BOX_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]], np.uint32)
BOX_TRIANGLES = np.concatenate([BOX_QUADS[:, [0, 1, 2]], BOX_QUADS[:, [0, 2, 3]]])
VERSIONS = count(1)


@dataclass(frozen=True)
class Case:
    """A random scene, seen by a random camera."""

    seed: int
    layers: int
    separation: float
    orthographic: bool


CASES = st.builds(
    Case,
    seed=st.integers(0, 2**32 - 1),
    layers=st.integers(1, 4),
    separation=st.sampled_from([0.0, 0.05, 0.5, 1e4]),
    orthographic=st.booleans(),
)
few_renders = settings(
    max_examples=12, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@dataclass(frozen=True)
class Bench:
    """A renderer on the GL thread."""

    renderer: Renderer
    subpixel_bits: int

    def render(self, scene: Scene, camera: Camera, layers: int, separation: float) -> list[LayerImages]:
        """Every layer, from one sample at pixel centres."""
        settings = RenderSettings(
            WIDTH, HEIGHT, samples=1, layers=layers, minimum_separation=separation, deep_output=True
        )

        def job(_device: Device) -> list[LayerImages]:
            self.renderer.begin(scene, camera, settings)
            self.renderer.render_sample()
            return [self.renderer.read_layer(layer) for layer in range(layers)]

        return gl_thread().submit(job).result()


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    """One renderer for all cases, so that what an earlier one left behind would be noticed."""
    thread = gl_thread()
    renderer = thread.submit(Renderer).result()
    yield Bench(renderer, thread.submit(lambda device: device.context.info["GL_SUBPIXEL_BITS"]).result())
    thread.submit(lambda _device: renderer.release()).result()


def mesh(key: str, positions: np.ndarray, triangles: np.ndarray) -> Mesh:
    """A mesh of one slot without vertex normals."""
    return Mesh(
        key=key,
        name=key,
        version=next(VERSIONS),
        positions=np.ascontiguousarray(positions, np.float32),
        normals=np.zeros((len(positions), 3), np.float32),
        triangles=np.ascontiguousarray(triangles, np.uint32),
        slots=(SlotRange(0, 0, len(triangles)),),
    )


def batch(key: str, of: str, matrices: np.ndarray, first_index: int) -> InstanceBatch:
    """Instances of mesh `of` with consecutive pass indices."""
    indices = np.arange(first_index, first_index + len(matrices), dtype=np.int32)
    return InstanceBatch(key, of, ("grey",), next(VERSIONS), matrices, indices, indices.astype(np.int64))


def scene_of(meshes: list[Mesh], batches: list[InstanceBatch]) -> Scene:
    """A scene with one material."""
    return Scene(
        meshes={item.key: item for item in meshes},
        materials={"grey": Material("grey", "grey", 1)},
        batches=tuple(batches),
    )


def random_rotation(generator: np.random.Generator) -> np.ndarray:
    """A uniformly random rotation (3, 3)."""
    q, r = np.linalg.qr(generator.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.linalg.det(q)


def random_scene(generator: np.random.Generator) -> Scene:
    """Sixty loose triangles and eight boxes about the origin, within 4 m, each with a pass index of its own."""
    matrices = np.tile(np.eye(4), (8, 1, 1))
    for matrix in matrices:
        matrix[:3, :3] = random_rotation(generator) * generator.uniform(0.2, 0.8, 3)
        matrix[:3, 3] = generator.uniform(-2.0, 2.0, 3)
    meshes, batches = [mesh("box", BOX_CORNERS, BOX_TRIANGLES)], [batch("boxes", "box", matrices, 1000)]
    for index in range(6):
        corners = generator.uniform(-2.0, 2.0, (10, 1, 3)) + generator.uniform(-1.0, 1.0, (10, 3, 3))
        meshes.append(mesh(f"soup {index}", corners.reshape(-1, 3), np.arange(30).reshape(10, 3)))
        batches.append(batch(f"soup {index}", meshes[-1].key, np.eye(4)[None], index + 1))
    return scene_of(meshes, batches)


def random_camera(generator: np.random.Generator, orthographic: bool) -> Camera:
    """Somewhere at 3–9 m, looking at about the origin: sometimes from between the things."""
    backward = generator.normal(size=3)
    backward /= np.linalg.norm(backward)
    right = np.cross(generator.normal(size=3), backward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(backward, right), backward], axis=1)
    matrix[:3, 3] = backward * generator.uniform(3.0, 9.0) + generator.uniform(-0.5, 0.5, 3)
    half = generator.uniform(2.0, 4.0) if orthographic else generator.uniform(0.3, 0.8)
    shift_x, shift_y = generator.uniform(-0.2, 0.2, 2) * half
    aspect = HEIGHT / WIDTH
    window = (shift_x - half, shift_x + half, shift_y - half * aspect, shift_y + half * aspect)
    return Camera(matrix, window, clip_start=0.5, clip_end=12.0, orthographic=orthographic)


def built(case: Case) -> tuple[Scene, Camera]:
    """The scene and camera of a case."""
    generator = np.random.default_rng(case.seed)
    return random_scene(generator), random_camera(generator, case.orthographic)


def assert_separated(images: list[LayerImages], separation: float) -> None:
    """Z(k+1) > Z(k) + Δz everywhere, in the float32 arithmetic that the layers are stored in."""
    for nearer, farther in pairwise(images):
        there = np.isfinite(farther.depth)
        assert np.isfinite(nearer.depth[there]).all(), "a layer is covered where the one before it is empty"
        assert (farther.depth[there] > nearer.depth[there] + np.float32(separation)).all()


def assert_agrees(images: list[LayerImages], truth: LayerReference) -> None:
    """Coverage, depth, owner and normal of every layer equal the ray caster's at all pixels that are certain."""
    certain = ~truth.ambiguous
    for layer, image in enumerate(images):
        covered = np.isfinite(truth.depth[layer])
        wrong = certain & (covered != np.isfinite(image.depth))
        assert not wrong.any(), f"layer {layer}: coverage differs at (row, column) {np.argwhere(wrong)[:4].tolist()}"
        checked = certain & covered
        depth, expected = image.depth[checked].astype(np.float64), truth.depth[layer][checked]
        excess = np.abs(depth - expected) - truth.tolerance[layer][checked]
        assert excess.max(initial=0.0) <= 0.0, f"layer {layer}: depth is off at {np.argwhere(checked)[excess.argmax()]}"
        np.testing.assert_array_equal(image.object_index[checked], truth.owner[layer][checked])
        cosine = np.abs((image.normal[checked] * truth.normal[layer][checked]).sum(axis=-1))
        assert cosine.min(initial=1.0) > 0.999


def assert_identical(images: list[LayerImages], others: list[LayerImages]) -> None:
    """Every channel of every layer is the same to the last bit."""
    for image, other in zip(images, others, strict=True):
        for field in fields(LayerImages):
            np.testing.assert_array_equal(getattr(image, field.name), getattr(other, field.name), err_msg=field.name)


def compare(bench: Bench, scene: Scene, camera: Camera, layers: int, separation: float) -> LayerReference:
    """Render and hold against the ray caster."""
    images = bench.render(scene, camera, layers, separation)
    truth = raycast_layers(scene, camera, (WIDTH, HEIGHT), layers, separation, subpixel_bits=bench.subpixel_bits)
    assert_separated(images, separation)
    assert_agrees(images, truth)
    return truth


@few_renders
@given(CASES)
@example(Case(seed=0, layers=4, separation=0.0, orthographic=False))
@example(Case(seed=5, layers=4, separation=0.05, orthographic=True))
@example(Case(seed=3, layers=3, separation=0.5, orthographic=False))
def test_layers_equal_ray_caster(bench: Bench, case: Case) -> None:
    scene, camera = built(case)
    truth = compare(bench, scene, camera, case.layers, case.separation)
    # Expected share: total edge length × 2δ / picture area, and 300 triangles of this size have about 10⁴ px of edges.
    assert truth.ambiguous.mean() < 0.015 + 2.5 * 2.0**-bench.subpixel_bits


def test_separation_larger_than_the_scene_leaves_one_layer(bench: Bench) -> None:
    scene, camera = built(Case(seed=5, layers=3, separation=1e4, orthographic=False))
    images = bench.render(scene, camera, 3, 1e4)
    assert np.isfinite(images[0].depth).mean() > 0.5
    assert not np.isfinite(images[1].depth).any()
    assert not np.isfinite(images[2].depth).any()


def test_eight_layers(bench: Bench) -> None:
    scene, camera = built(Case(seed=5, layers=8, separation=0.05, orthographic=False))
    truth = compare(bench, scene, camera, 8, 0.05)
    assert np.isfinite(truth.depth[7]).any(), "the case must reach layer 8 to mean something"


def reordered(scene: Scene, generator: np.random.Generator) -> Scene:
    """The same scene handed over in another order: batches, meshes, materials, instances and triangles."""
    meshes = {}
    for key in generator.permutation(list(scene.meshes)):
        item = scene.meshes[str(key)]
        shuffled = generator.permutation(item.triangles)
        meshes[item.key] = replace(item, triangles=shuffled, version=item.version + 1)
    batches = []
    for position in generator.permutation(len(scene.batches)):
        item = scene.batches[position]
        order = generator.permutation(item.count)
        batches.append(
            replace(
                item,
                key=f"{generator.integers(10**6)} {item.key}",
                matrices=item.matrices[order],
                object_index=item.object_index[order],
                ids=item.ids[order],
            )
        )
    return replace(scene, meshes=meshes, batches=tuple(batches))


@few_renders
@given(CASES, st.integers(0, 2**32 - 1))
def test_submission_order_does_not_change_a_bit(bench: Bench, case: Case, order: int) -> None:
    scene, camera = built(case)
    images = bench.render(scene, camera, case.layers, case.separation)
    other = bench.render(reordered(scene, np.random.default_rng(order)), camera, case.layers, case.separation)
    assert_identical(images, other)


def test_layers_do_not_depend_on_how_many_are_built(bench: Bench) -> None:
    scene, camera = built(Case(seed=3, layers=4, separation=0.5, orthographic=False))
    assert_identical(
        bench.render(scene, camera, 4, 0.5)[:2],
        bench.render(scene, camera, 2, 0.5),
    )


def moved(scene: Scene, camera: Camera, offset: np.ndarray) -> tuple[Scene, Camera]:
    """Everything, the camera included, somewhere else."""
    translation = np.eye(4)
    translation[:3, 3] = offset
    batches = tuple(
        replace(item, matrices=translation @ item.matrices, version=item.version + 1) for item in scene.batches
    )
    return replace(scene, batches=batches), replace(camera, world_from_camera=translation @ camera.world_from_camera)


def rounded_to_binary(scene: Scene, camera: Camera) -> tuple[Scene, Camera]:
    """Translations rounded to 2⁻²⁰ m, so that a shift by 2²⁰ m is exact in float64."""

    def rounded(matrices: np.ndarray) -> np.ndarray:
        matrices = matrices.copy()
        matrices[..., :3, 3] = np.round(matrices[..., :3, 3] * 2.0**20) / 2.0**20
        return matrices

    batches = tuple(replace(item, matrices=rounded(item.matrices)) for item in scene.batches)
    return replace(scene, batches=batches), replace(camera, world_from_camera=rounded(camera.world_from_camera))


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_million_metres_from_the_origin_looks_the_same(bench: Bench, orthographic: bool) -> None:
    near = rounded_to_binary(*built(Case(seed=5, layers=3, separation=0.05, orthographic=orthographic)))
    far = moved(*near, 2.0**20 * np.array([1.0, -1.0, 0.5]))
    assert_identical(bench.render(*near, 3, 0.05), bench.render(*far, 3, 0.05))


@pytest.mark.parametrize("factor", [1e-4, 1e5], ids=["tenth of a millimetre", "hundred kilometres"])
@pytest.mark.parametrize("orthographic", [False, True])
def test_tiny_and_huge_scenes(bench: Bench, factor: float, orthographic: bool) -> None:
    scene, camera = built(Case(seed=3, layers=3, separation=0.5 * factor, orthographic=orthographic))
    scale = np.diag([factor, factor, factor, 1.0])
    batches = tuple(replace(item, matrices=scale @ item.matrices) for item in scene.batches)
    matrix = camera.world_from_camera.copy()
    matrix[:3, 3] *= factor
    window = tuple(edge * factor for edge in camera.window) if orthographic else camera.window
    scaled = Camera(matrix, window, camera.clip_start * factor, camera.clip_end * factor, orthographic)
    truth = compare(bench, replace(scene, batches=batches), scaled, 3, 0.5 * factor)
    assert np.isfinite(truth.depth[1]).mean() > 0.1


def test_ray_caster_selects_greedily() -> None:
    """Walls at 1.0, 1.3, 1.6 and 3.0 m: with Δz = 0.5 m the second layer is the third wall, not the second."""
    wall = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], np.float32)
    matrices = np.tile(np.eye(4), (4, 1, 1))
    matrices[:, 2, 3] = -np.array([3.0, 1.3, 1.0, 1.6])
    scene = scene_of([mesh("wall", wall, np.array([[0, 1, 2], [0, 2, 3]]))], [batch("walls", "wall", matrices, 1)])
    camera = Camera(np.eye(4), (-0.5, 0.5, -0.25, 0.25), 0.1, 100.0)
    truth = raycast_layers(scene, camera, (9, 5), 4, 0.5, subpixel_bits=8)
    certain = ~truth.ambiguous
    assert certain.mean() > 0.5, "only the diagonal of the walls is uncertain"
    for layer, (depth, owner) in enumerate([(1.0, 3), (1.6, 4), (3.0, 1), (np.inf, 0)]):
        np.testing.assert_allclose(truth.depth[layer][certain], depth, rtol=1e-12)
        np.testing.assert_array_equal(truth.owner[layer][certain], owner)
