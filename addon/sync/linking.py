# SPDX-License-Identifier: GPL-3.0-or-later
"""Light linking and shadow linking: which objects a light reaches, and which of them cast its shadows.

A collection of receivers (blockers) holds objects and collections that are included or excluded; what the first level
says of a collection holds for everything in it. Where anything is included, nothing else is linked; otherwise
everything but the excluded is. That is what Blender's dependency graph tells Cycles (`light_linking.cc`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import bpy

from ..scene import ALL_GROUPS, LINK_GROUPS, Light
from .changes import Messages

if TYPE_CHECKING:
    from .visibility import Placer

_TOO_MANY = (
    f"Light linking tells at most {LINK_GROUPS - 1} kinds of objects apart; these are lit as if nothing linked them:"
)


class LinkGroup(NamedTuple):
    """Objects that all lights treat alike: a number 0…63, and what links them, which orders batches; "" for nothing."""

    number: int = 0
    label: str = ""


class _Links:
    """What the receivers', or the blockers', collections of all lights say of each object."""

    def __init__(self, collections: Iterable[Any]) -> None:
        self._by_object: dict[int, dict[str, bool]] = {}
        for name, collection in {_name(collection): collection for collection in collections}.items():
            for item, included in _linked_objects(collection):
                self._by_object.setdefault(item.session_uid, {})[name] = included

    def __bool__(self) -> bool:
        return bool(self._by_object)

    def of(self, placer: int, placed: int) -> frozenset[tuple[str, bool]]:
        """Which collections include (True) or exclude an object; what says so of its instancer counts first."""
        links = self._by_object.get(placer) or self._by_object.get(placed) or {}
        return frozenset(links.items())


Membership = tuple[frozenset[tuple[str, bool]], frozenset[tuple[str, bool]]]
"""As a receiver and as a blocker."""

_NOWHERE: Membership = (frozenset(), frozenset())
_UNLINKED = LinkGroup()


class LightLinks:
    """Groups of objects, numbered as they are asked for during one walk over a depsgraph, and lights' bits of them."""

    def __init__(self, messages: Messages) -> None:
        linkings = [light.light_linking for light in _lights()]
        self._receivers = _Links(item.receiver_collection for item in linkings if item.receiver_collection)
        self._blockers = _Links(item.blocker_collection for item in linkings if item.blocker_collection)
        self._groups: dict[Membership, LinkGroup] = {_NOWHERE: _UNLINKED}
        self._messages = messages

    def group(self, placed: Any, placer: Placer) -> LinkGroup:
        """The group of the placements of an evaluated object `placed` by `placer`."""
        if not (self._receivers or self._blockers):
            return _UNLINKED
        uid = placed.original.session_uid
        membership = self._receivers.of(placer.uid, uid), self._blockers.of(placer.uid, uid)
        if membership not in self._groups:
            if len(self._groups) == LINK_GROUPS:
                self._messages.add_named(_TOO_MANY, placed.name)
                return _UNLINKED
            self._groups[membership] = LinkGroup(len(self._groups), _label(membership))
        return self._groups[membership]

    def linked(self, light: Light, emitter: Any) -> Light:
        """`light`, of the object `emitter`, with its bits of all groups that were asked for so far."""
        linking = emitter.original.light_linking
        receivers, blockers = linking.receiver_collection, linking.blocker_collection
        if receivers is None and blockers is None:
            return light
        return replace(
            light, receiver_groups=self._bits(receivers, side=0), blocker_groups=self._bits(blockers, side=1)
        )

    def _bits(self, collection: Any, side: int) -> int:
        """The bits of the groups that a collection links; `side` of the membership is meant."""
        if collection is None:
            return ALL_GROUPS
        name = _name(collection)
        included = excluded = 0
        for membership, group in self._groups.items():
            included |= ((name, True) in membership[side]) << group.number
            excluded |= ((name, False) in membership[side]) << group.number
        return (included or ALL_GROUPS) & ~excluded


def _lights() -> list[Any]:
    """Every object of the file that is a light.

    A depsgraph could tell which of them it evaluates, but asking `Depsgraph.ids` has instances hidden in viewports.
    """
    return [item for item in bpy.data.objects if item.type == "LIGHT"] if bpy.data.lights else []


def _linked_objects(collection: Any) -> Iterator[tuple[Any, bool]]:
    """The objects that `collection` links and whether it includes them; of one that comes repeatedly the last holds."""
    for child, link in zip(collection.children, collection.collection_children, strict=True):
        included = link.light_linking.link_state == "INCLUDE"
        yield from ((item, included) for item in child.all_objects)
    for item, link in zip(collection.objects, collection.collection_objects, strict=True):
        yield item, link.light_linking.link_state == "INCLUDE"


def _name(collection: Any) -> str:
    """Tells a collection from all others of the file; the same when the file is opened again."""
    return collection.name_full


def _label(membership: Membership) -> str:
    """Text that tells a membership from all others."""
    sides = (sorted(f"{'+' if included else '-'}{name}" for name, included in links) for links in membership)
    return "\n".join("\t".join(links) for links in sides)
