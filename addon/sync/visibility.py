# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a scene is seen: by camera rays, and in one viewport of those that share a mirror."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from ..scene import InstanceBatch, Scene
from ..scene.arrays import BoolArray, same_array
from .changes import Messages, new_version, with_versions

if TYPE_CHECKING:
    import bpy

_HOLDOUT = "Holdouts are not rendered yet; shown as if they were none:"
_SHADOW_CATCHER = "Shadow catchers are not rendered yet; shown as if they were none:"
_INDIRECT_ONLY = "Indirect light is not rendered yet; only the shadows of these are seen:"


@dataclass(frozen=True)
class Hidden:
    """What one viewport does not show: by key of a batch which of its rows (N,) bool, and the keys of lights."""

    rows: Mapping[str, BoolArray] = field(default_factory=dict[str, Any])
    lights: frozenset[str] = frozenset()


class Placer(NamedTuple):
    """Who places an object: itself, or the instancer. `uid` is its original's session uid."""

    uid: int
    seen_by_camera: bool
    casts_shadow: bool
    shown_in_viewport: bool


class Visibility:
    """Answers for one walk over the depsgraph's instances; `space` is the viewport that shows it, or None."""

    def __init__(self, depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D | None, messages: Messages) -> None:
        self._view_layer: Any = depsgraph.view_layer_eval
        self._special_collections = _has_special_collections(self._view_layer.layer_collection)
        self._space = space
        self._messages = messages
        self._instancers: dict[int, Placer] = {}

    def shows(self, shown: Any) -> bool:
        """Whether the viewport's local view, collections and filter of object types show an object or instance."""
        return self._space is None or shown.visible_in_viewport_get(self._space)

    def placer(self, instance: Any, shown: Any) -> Placer:
        """Who places the mesh `shown`, and what holds for all meshes that it places."""
        if not instance.is_instance:
            return self._read(shown, shown)
        instancer = instance.parent
        pointer = instancer.as_pointer()
        if pointer not in self._instancers:
            self._instancers[pointer] = self._read(instancer, shown)
        return self._instancers[pointer]

    def _read(self, owner: Any, shown: Any) -> Placer:
        holdout, indirect_only = owner.is_holdout, False
        if self._special_collections:
            holdout = owner.holdout_get(view_layer=self._view_layer)
            indirect_only = not holdout and owner.indirect_only_get(view_layer=self._view_layer)
        seen_by_camera = owner.visible_camera and not indirect_only
        if indirect_only:
            self._messages.add_named(_INDIRECT_ONLY, owner.name)
        elif seen_by_camera and holdout:
            self._messages.add_named(_HOLDOUT, owner.name)
        elif seen_by_camera and owner.is_shadow_catcher:
            self._messages.add_named(_SHADOW_CATCHER, owner.name)
        return Placer(owner.original.session_uid, seen_by_camera, owner.visible_shadow, self.shows(shown))


def _has_special_collections(collection: Any) -> bool:
    """Whether a view layer makes any collection a holdout or indirect only: cheaper than asking every object."""
    return collection.holdout or collection.indirect_only or any(map(_has_special_collections, collection.children))


def without_hidden(scene: Scene, hidden: Hidden, previous: Scene) -> Scene:
    """What a viewport shows of `scene`. Meshes, materials and whatever is shown whole stay the very same objects.

    `previous` is what it showed before, of which everything that is still the same is kept.
    """
    if not hidden.rows and not hidden.lights:
        return scene
    before = {batch.key: batch for batch in previous.batches}
    batches = (
        batch if batch.key not in hidden.rows else _shown_rows(batch, ~hidden.rows[batch.key], before.get(batch.key))
        for batch in scene.batches
    )
    shown = replace(
        scene,
        batches=tuple(batch for batch in batches if batch.count),
        lights=tuple(light for light in scene.lights if light.key not in hidden.lights),
    )
    return with_versions(shown, previous)


def _shown_rows(batch: InstanceBatch, shown: BoolArray, previous: InstanceBatch | None) -> InstanceBatch:
    """The `shown` rows of a batch; `previous` itself where it is the same."""
    rows = replace(
        batch,
        version=new_version(),
        matrices=batch.matrices[shown],
        object_index=batch.object_index[shown],
        ids=batch.ids[shown],
    )
    return previous if previous is not None and same_batch(previous, rows) else rows


def same_batch(first: InstanceBatch, second: InstanceBatch) -> bool:
    """Whether two batches with the same key place the same instances in the same group."""
    return first.link_group == second.link_group and all(
        same_array(getattr(first, name), getattr(second, name)) for name in ("matrices", "object_index", "ids")
    )
