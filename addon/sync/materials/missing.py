# SPDX-License-Identifier: GPL-3.0-or-later
"""UV maps and colour attributes that materials read and meshes do not have."""

from __future__ import annotations

from ...scene import BaseColorSource, Material, Mesh, Scene
from ..changes import Messages


def missing_attribute_messages(scene: Scene, messages: Messages) -> None:
    """Report, per material, the meshes of `scene` that lack what it reads; as in Cycles, zeros are read there."""
    for batch in scene.batches:
        mesh = scene.meshes[batch.mesh]
        for slot in mesh.slots:
            material = scene.materials[batch.materials[min(slot.slot, len(batch.materials) - 1)]]
            cause = _cause(material, mesh)
            if cause is not None and (batch.seen_by_camera or material.is_alpha_tested):
                messages.add_named(cause, mesh.name)


def _cause(material: Material, mesh: Mesh) -> str | None:
    if material.source is BaseColorSource.TEXTURE and mesh.uvs is None:
        return f"Material “{material.name}” shows the corner of its image on these, which have no UV map:"
    if material.source is BaseColorSource.ATTRIBUTE and mesh.colors is None:
        return f"Material “{material.name}” is black on these, which have no colour attribute:"
    return None
