# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow maps that draw only clusters of casters, against those that draw every caster whole."""

from dataclasses import replace

import numpy as np

from addon.render import caster_clusters
from addon.scene import Channel, SlotRange
from blender_tests import builders


def leaves(generator, count):
    """Small quads all over a box above the floor, in two slots."""
    middles = generator.uniform((-3.0, -3.0, 0.2), (3.0, 3.0, 1.5), (count, 1, 3))
    sides = generator.normal(scale=0.1, size=(count, 2, 3))
    corners = middles + np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) @ sides
    triangles = (4 * np.arange(count)[:, None, None] + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3)
    half = count // 2 * 2
    slots = (SlotRange(0, 0, half), SlotRange(1, half, len(triangles) - half))
    return builders.mesh("leaves", corners, triangles, normals=np.zeros((4 * count, 3)), slots=slots)


def test_clusters_cast_the_shadows_of_whole_meshes(render, monkeypatch):
    generator = np.random.default_rng(9)
    lamps = tuple(
        replace(builders.light(position=tuple(place), radius=0.1), key=str(index))
        for index, place in enumerate(generator.uniform((-3.0, -3.0, 0.5), (3.0, 3.0, 2.5), (4, 3)))
    )
    mesh = leaves(generator, 800)
    beside = [builders.translation(), builders.translation(x=5.0, z=0.3)]
    scene = builders.scene(
        builders.quad("floor", half=6.0),
        mesh,
        lights=lamps,
        batches=(builders.batch("floor"), builders.batch("leaves", beside)),
    )
    cut = []
    cluster = caster_clusters.cluster
    monkeypatch.setattr(caster_clusters, "cluster", lambda mesh: cut.append(mesh.key) or cluster(mesh))

    def picture(scene):
        view = render(scene, builders.camera(z=8.0, half_width=0.5), samples=3, width=64, height=64)
        return view.channels[Channel.COMBINED]

    parts = picture(scene)
    assert cut == ["leaves"]
    monkeypatch.setattr(caster_clusters, "WHOLE_VIEWS", 10**9)
    whole = picture(scene)
    assert cut == ["leaves"]
    assert np.array_equal(parts, whole)
    unshadowed = picture(replace(scene, lights=tuple(replace(lamp, casts_shadow=False) for lamp in lamps)))
    assert unshadowed.mean() > 1.1 * whole.mean()  # or there would be nothing to compare
