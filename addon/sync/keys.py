# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of mirrored items, stable across frames and undo.

All of them build on `session_uid` of the original data-block, which undo and re-evaluation keep but opening the file
again does not. Keys that order something which the picture depends on (batches, lights) therefore begin with names;
uids only tell apart what has the same names. Draws then have the same order however often a file is opened.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import bpy

DEFAULT_MATERIAL = "default"
"""Key of the material that empty slots show."""

_UNUSED_PERSISTENT_ID = 2**31 - 1
_SEPARATOR = "\0"
"""Between the parts of a key: no name in Blender holds it, and it sorts before all that names do."""


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
        self._by_pointer: dict[int, tuple[str, str]] = {}
        self._taken: set[str] = set()
        self._counts: dict[int, int] = {}

    def key(self, shown: Any) -> tuple[str, str]:
        """Key of the mesh that an evaluated object shows, and the name that tells it apart within the file."""
        pointer = shown.data.as_pointer()
        if pointer not in self._by_pointer:
            self._by_pointer[pointer] = self._new_key(shown.original)
        return self._by_pointer[pointer]

    def _new_key(self, original: Any) -> tuple[str, str]:
        if not original.modifiers and original.data is not None:
            key = id_key("mesh", original.data)
            if key not in self._taken:
                self._taken.add(key)
                return key, original.data.name_full
        uid = original.session_uid
        count = self._counts.get(uid, 0)
        self._counts[uid] = count + 1
        return f"{id_key('object', original)}.{count}", f"{original.name_full}{_SEPARATOR}{count:06d}"


def batch_key(names: tuple[str, ...], mesh: str, materials: tuple[str, ...], differences: tuple[str, ...]) -> str:
    """Key of the batch of a mesh with materials, given by key; `names` are those of the mesh and of each material.

    `differences` tell its instances from the usual ones of that mesh with those materials.
    """
    return _SEPARATOR.join((*names, mesh, *materials, *differences))


def instance_key(instance: bpy.types.DepsgraphObjectInstance) -> str:
    """Key of one placement of an object: the object, and for an instance who placed it and which one it is."""
    placed: Any = instance.instance_object if instance.is_instance else instance.object
    if not instance.is_instance:
        return _SEPARATOR.join((placed.name_full, id_key("object", placed)))
    parent: Any = instance.parent
    identifier = ".".join(f"{number:d}" for number in instance.persistent_id if number != _UNUSED_PERSISTENT_ID)
    uids = id_key("object", placed), id_key("object", parent)
    return _SEPARATOR.join((placed.name_full, parent.name_full, identifier, *uids))


def instance_id(instance: Any, placer: int) -> int:
    """Which placement this is, for `InstanceBatch.ids`; `placer` is the session uid of the object that placed it.

    Blender's random id stands for the placed object and for what lies between the two, its persistent id for the
    place: geometry nodes' `id` attribute, a particle's, a vertex's or a collection's object's number.
    """
    return hash((placer, instance.random_id, *instance.persistent_id)) if instance.is_instance else placer
