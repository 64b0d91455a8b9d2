# SPDX-License-Identifier: GPL-3.0-or-later
"""Versions of what is mirrored, and the texts that tell the user what could not be mirrored."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np

from ..scene import EnvironmentMap, InstanceBatch, Light, Scene
from ..scene.arrays import same_array
from ..scene.versions import new_version

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def same_fields(first: DataclassInstance | None, second: DataclassInstance | None) -> bool:
    """Whether two dataclass values are equal, those of their fields that are arrays included."""
    if first is None or second is None:
        return first is second
    return all(_same(getattr(first, field.name), getattr(second, field.name)) for field in fields(first))


def _same(first: object, second: object) -> bool:
    if isinstance(first, np.ndarray):
        return isinstance(second, np.ndarray) and same_array(first, second)
    if isinstance(first, EnvironmentMap) and isinstance(second, EnvironmentMap):
        return first is second or (first.key, first.name, first.version) == (second.key, second.name, second.version)
    return first == second


def with_versions(scene: Scene, previous: Scene) -> Scene:
    """`scene` with versions raised where it differs from `previous`, or `previous` itself. What is equal is shared."""
    changed = {
        "geometry": not _same_items(scene.meshes, previous.meshes),
        "transforms": not _same_batches(scene.batches, previous.batches),
        "materials": not (
            _same_items(scene.materials, previous.materials) and _same_items(scene.images, previous.images)
        ),
        "lights": not _same_lights(scene.lights, previous.lights),
        "camera": not same_fields(scene.camera, previous.camera),
        "world": not same_fields(scene.world, previous.world),
    }
    raised = {name: new_version() for name, differs in changed.items() if differs}
    if not raised:
        return previous
    shared = {name: getattr(previous, name) for name in ("lights", "camera", "world") if not changed[name]}
    return replace(scene, versions=replace(previous.versions, **raised), **shared)


def _same_items(first: Mapping[str, object], second: Mapping[str, object]) -> bool:
    return first.keys() == second.keys() and all(first[key] is second[key] for key in first)


def _same_batches(first: tuple[InstanceBatch, ...], second: tuple[InstanceBatch, ...]) -> bool:
    return len(first) == len(second) and all(a is b for a, b in zip(first, second, strict=True))


def _same_lights(first: tuple[Light, ...], second: tuple[Light, ...]) -> bool:
    return len(first) == len(second) and all(same_fields(a, b) for a, b in zip(first, second, strict=True))


class Messages:
    """Texts for the user, one per item and cause, in the order in which they were first seen."""

    def __init__(self) -> None:
        self._texts: dict[tuple[str, str], str] = {}
        self._named: dict[str, list[str]] = {}

    def add(self, item: str, cause: str, text: str) -> None:
        """Keep `text` unless this `item` already has one for this `cause`."""
        self._texts.setdefault((item, cause), text)

    def add_named(self, cause: str, name: str) -> None:
        """Count `name` among those for which `cause`, a sentence ending in a colon, is told once for all."""
        names = self._named.setdefault(cause, [])
        if name not in names:
            names.append(name)

    def extend(self, item: str, texts: Iterable[str]) -> None:
        """Add texts that were already collected for `item`; each is its own cause."""
        for text in texts:
            self.add(item, text, text)

    def texts(self) -> tuple[str, ...]:
        """All texts; a list of names longer than five is cut and counted."""
        return (*self._texts.values(), *(f"{cause} {_listed(names)}." for cause, names in self._named.items()))


def _listed(names: list[str]) -> str:
    shown = ", ".join(f"“{name}”" for name in names[:5])
    return shown if len(names) <= 5 else f"{shown} and {len(names) - 5} more"
