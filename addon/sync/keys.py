# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of mirrored items: stable across frames and undo, and ordered by when Blender made the item.

All of them build on `session_uid` of the original data-block, which undo and re-evaluation keep. Zero padding
makes string order equal creation order, so draws are submitted in the same order however often a file is opened.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import bpy

DEFAULT_MATERIAL = "default"
"""Key of the material that empty slots show."""

_UNUSED_PERSISTENT_ID = 2**31 - 1


def id_key(prefix: str, data_block: bpy.types.ID) -> str:
    """Key of a data-block, original or evaluated: `prefix` and its original's session uid."""
    return f"{prefix}{data_block.original.session_uid:010d}"


def mesh_key(instanced: bpy.types.Object, mesh: bpy.types.Mesh, ordinal: int) -> str:
    """Key of an evaluated mesh.

    Objects whose modifiers leave the mesh alone share their mesh data-block's key. A mesh that evaluation made
    belongs to the object, and `ordinal` tells several of one object apart (geometry nodes).
    """
    if mesh.original.as_pointer() != mesh.as_pointer():
        return id_key("mesh", mesh)
    return f"{id_key('object', instanced)}.{ordinal}"


def instance_key(instance: bpy.types.DepsgraphObjectInstance) -> str:
    """Key of one placement of an object: the object, and for an instance who placed it and which one it is."""
    placed = instance.instance_object if instance.is_instance else instance.object
    key = id_key("object", placed)
    if not instance.is_instance:
        return key
    identifier = ".".join(str(number) for number in instance.persistent_id if number != _UNUSED_PERSISTENT_ID)
    return f"{key}/{id_key('object', instance.parent)}/{identifier}"
