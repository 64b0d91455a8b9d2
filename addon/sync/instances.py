# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything the depsgraph places in the world, sorted into groups that can be drawn together.

Matrices come in one call for all instances; Python only looks at which object each of them shows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..scene import InstanceBatch
from ..scene.arrays import BoolArray, Float64Array
from .changes import Messages, new_version
from .linking import LinkGroup
from .visibility import same_batch

_FLATTEST = 1e-5


class Traits(NamedTuple):
    """How the instances of one batch take part; see `InstanceBatch`."""

    seen_by_camera: bool = True
    casts_shadow: bool = True
    link_group: LinkGroup = LinkGroup()

    @property
    def differences(self) -> tuple[str, ...]:
        """What tells them from instances that are seen, cast shadows and are not linked."""
        unusual = (not self.seen_by_camera, "unseen"), (not self.casts_shadow, "shadowless")
        linked = (f"linked {self.link_group.label}",) if self.link_group.number else ()
        return (*(word for holds, word in unusual if holds), *linked)


@dataclass
class Placements:
    """The instances of one mesh with one assignment of materials, alike in their traits: rows of the depsgraph's list,
    in its order."""

    key: str
    mesh: str
    materials: tuple[str, ...]
    traits: Traits
    rows: list[int] = field(default_factory=list)
    object_index: list[int] = field(default_factory=list)
    ids: list[int] = field(default_factory=list)
    hidden: list[bool] = field(default_factory=list)
    names: set[str] = field(default_factory=set)

    def add(self, row: int, object_index: int, identifier: int, *, hidden: bool) -> None:
        """One more instance; see `InstanceBatch`. `hidden`: the viewport does not show it."""
        self.rows.append(row)
        self.object_index.append(object_index)
        self.ids.append(identifier)
        self.hidden.append(hidden)


def read_matrices(depsgraph: bpy.types.Depsgraph) -> Float64Array:
    """(N, 4, 4) float64 world matrices of all instances, row-major.

    From 5.0 on one call reads them all (column-major). In 4.5 that call never frees the depsgraph's instances, about
    220 bytes each, so there they are read one by one.
    """
    instances = depsgraph.object_instances
    if bpy.app.version < (5, 0, 0):
        values: list[float] = []
        for instance in instances:
            matrix: Any = instance.matrix_world
            for row in matrix:
                values.extend(row)
        return np.array(values, np.float64).reshape(-1, 4, 4)
    matrices = np.empty(len(instances) * 16, np.float32)
    instances.foreach_get("matrix_world", matrices)
    return matrices.reshape(-1, 4, 4).transpose(0, 2, 1).astype(np.float64)


def shown_instances(depsgraph: bpy.types.Depsgraph) -> Iterator[tuple[int, Any, Any]]:
    """Row, instance and object of all that are themselves visible; each is valid only until the next is asked for.

    Viewports do not show objects that are drawn as wires or bounds, as EEVEE does not.
    """
    in_viewport = depsgraph.mode == "VIEWPORT"
    for row, instance in enumerate(depsgraph.object_instances):
        if not instance.show_self:
            continue
        shown: Any = instance.object
        if not (in_viewport and shown.display_type in {"WIRE", "BOUNDS"}):
            yield row, instance, shown


def build_batch(
    placements: Placements, matrices: Float64Array, previous: InstanceBatch | None, messages: Messages
) -> tuple[InstanceBatch, BoolArray]:
    """The batch of a group, `previous` itself where nothing changed, and which rows (N,) the viewport does not show.

    Instances that cannot be drawn are not in it, so there may be none.
    """
    own = matrices[np.array(placements.rows, np.intp)]
    usable = _repair(own, placements, messages)
    kept = slice(None) if usable.all() else usable
    batch = InstanceBatch(
        key=placements.key,
        mesh=placements.mesh,
        materials=placements.materials,
        version=new_version(),
        matrices=own[kept],
        object_index=np.array(placements.object_index, np.int32)[kept],
        ids=np.array(placements.ids, np.int64)[kept],
        seen_by_camera=placements.traits.seen_by_camera,
        casts_shadow=placements.traits.casts_shadow,
        link_group=placements.traits.link_group.number,
    )
    hidden = np.array(placements.hidden, np.bool_)[kept]
    return (previous if previous is not None and same_batch(previous, batch) else batch), hidden


def _repair(matrices: Float64Array, placements: Placements, messages: Messages) -> BoolArray:
    """(N,) which matrices can be used. One that is flat along a single direction (scale 0 on one axis) is made
    very thin instead, in place, so that its normals stay defined."""
    usable = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    linear = np.where(usable[:, None, None], matrices[:, :3, :3], 0.0)
    size = np.abs(linear).max(axis=(1, 2))
    normalized = linear / np.maximum(size, 1e-30)[:, None, None]
    suspicious = usable & (np.abs(np.linalg.det(normalized)) < _FLATTEST)
    for row in np.flatnonzero(suspicious):
        left, stretch, right = np.linalg.svd(normalized[row])
        if size[row] == 0.0 or stretch[1] < _FLATTEST * stretch[0]:
            usable[row] = False
        elif stretch[2] < _FLATTEST * stretch[0]:
            stretch[2] = _FLATTEST * stretch[0]
            matrices[row, :3, :3] = (left * stretch) @ right * size[row]
    if not usable.all():
        name = ", ".join(f"“{name}”" for name in sorted(placements.names))
        count = int((~usable).sum())
        text = (
            f"{count} instance{'s' if count > 1 else ''} of {name} with a scale of zero or a broken transform left out."
        )
        messages.add(placements.key, "matrix", text)
    return usable
