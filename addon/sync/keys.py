# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of mirrored items: stable across frames and undo, and ordered by when Blender made the item.

All of them build on `session_uid` of the original data-block, which undo and re-evaluation keep. Zero padding
makes string order equal creation order, so draws are submitted in the same order however often a file is opened.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import bpy

DEFAULT_MATERIAL = "default"
"""Key of the material that empty slots show."""

_UNUSED_PERSISTENT_ID = 2**31 - 1


def id_key(prefix: str, data_block: Any) -> str:
    """Key of a data-block, original or evaluated: `prefix` and its original's session uid."""
    return f"{prefix}{data_block.original.session_uid:010d}"


class MeshKeys:
    """Keys of the evaluated meshes seen during one walk over the depsgraph.

    Objects that show the same evaluated mesh share its key. A mesh that no modifier changed has the key of its
    data-block; one that evaluation made has that of the object it was made for, and a number, since geometry nodes
    may make several.
    """

    def __init__(self) -> None:
        self._by_pointer: dict[int, str] = {}
        self._taken: set[str] = set()
        self._counts: dict[int, int] = {}

    def key(self, shown: Any) -> str:
        """Key of the mesh that an evaluated object shows."""
        pointer = shown.data.as_pointer()
        if pointer not in self._by_pointer:
            self._by_pointer[pointer] = self._new_key(shown.original)
        return self._by_pointer[pointer]

    def _new_key(self, original: Any) -> str:
        if not original.modifiers and original.data is not None:
            key = id_key("mesh", original.data)
            if key not in self._taken:
                self._taken.add(key)
                return key
        uid = original.session_uid
        count = self._counts.get(uid, 0)
        self._counts[uid] = count + 1
        return f"{id_key('object', original)}.{count}"


def instance_key(instance: bpy.types.DepsgraphObjectInstance) -> str:
    """Key of one placement of an object: the object, and for an instance who placed it and which one it is."""
    placed = instance.instance_object if instance.is_instance else instance.object
    key = id_key("object", placed)
    if not instance.is_instance:
        return key
    identifier = ".".join(str(number) for number in instance.persistent_id if number != _UNUSED_PERSISTENT_ID)
    return f"{key}/{id_key('object', instance.parent)}/{identifier}"
