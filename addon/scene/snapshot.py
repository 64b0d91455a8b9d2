# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes as `.npz` files: arrays beside a JSON description, nothing that could run code when it is opened.

A snapshot saved on a machine with Blender renders on one without. It may hold the frames before its own too; what they
share is stored once and comes back shared, with equal versions, so that nothing seems to move that did not.
"""

import json
import os
import types
import typing
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from .geometry import InstanceBatch, Mesh
from .materials import Image, Material
from .scene import EnvironmentMap, Scene, Versions
from .versions import new_version

FORMAT_VERSION = 3
_HEADER = "header"
_SHARED = (Mesh, Material, Image, InstanceBatch, EnvironmentMap)
"""Types of which several scenes may hold the same object."""


class SnapshotError(ValueError):
    """The file is not a scene snapshot that this version reads; the message names the file."""


@dataclass(frozen=True)
class Snapshot:
    """A scene, and the frames before it that were saved with it; each camera is in its `Scene.camera`.

    `previous`: one frame before `scene`. `earlier`: two frames before it.
    """

    scene: Scene
    previous: Scene | None = None
    earlier: Scene | None = None


def save(path: str | Path, scene: Scene, previous: Scene | None = None, earlier: Scene | None = None) -> None:
    """Write a scene to `path`, with the frames before it that are given; see `Snapshot`.

    Never writes half a file; makes the folder. Raises OSError naming the file where that fails.
    """
    writer = _Writer()
    content = writer.describe(Snapshot(scene, previous, earlier))
    description = {"format": FORMAT_VERSION, "snapshot": content, "items": writer.items}
    header = np.frombuffer(json.dumps(description).encode(), np.uint8)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with draft.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **{_HEADER: header}, **writer.arrays)
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)


def load(path: str | Path) -> Snapshot:
    """Read a snapshot; its items get version numbers of this process.

    Raises OSError where the file cannot be read, SnapshotError where it is something else.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        description = json.loads(arrays[_HEADER].tobytes())
        if description["format"] != FORMAT_VERSION:
            raise SnapshotError(f"{path}: snapshot format {description['format']}, expected {FORMAT_VERSION}")
        return _Reader(arrays, description["items"]).restore(Snapshot, description["snapshot"])
    except (OSError, SnapshotError):
        raise
    except Exception as error:  # whatever a damaged archive makes numpy, zipfile or json raise
        raise SnapshotError(f"{path}: not a scene snapshot ({error})") from error


class _Writer:
    """JSON for a snapshot; every array and every shared item is described once, whoever holds it."""

    def __init__(self) -> None:
        self.arrays: dict[str, np.ndarray[Any, Any]] = {}
        self.items: list[Any] = []
        self._references: dict[int, dict[str, Any]] = {}

    def describe(self, value: Any) -> Any:
        """JSON for a value; arrays and shared items are moved aside and referred to."""
        if isinstance(value, (np.ndarray, *_SHARED)):
            if id(value) not in self._references:
                self._references[id(value)] = self._move_aside(value)
            return self._references[id(value)]
        if is_dataclass(value):
            return self._describe_fields(value)
        if isinstance(value, Mapping):
            return {key: self.describe(item) for key, item in value.items()}
        if isinstance(value, tuple):
            return [self.describe(item) for item in value]
        return value.value if isinstance(value, Enum) else value

    def _move_aside(self, value: Any) -> dict[str, Any]:
        if isinstance(value, np.ndarray):
            name = f"array{len(self.arrays)}"
            self.arrays[name] = value
            return {"array": name}
        self.items.append(self._describe_fields(value))
        return {"item": len(self.items) - 1}

    def _describe_fields(self, value: Any) -> dict[str, Any]:
        return {field.name: self.describe(getattr(value, field.name)) for field in fields(value)}


class _Reader:
    """Values of declared types from their JSON."""

    def __init__(self, arrays: Mapping[str, np.ndarray[Any, Any]], items: list[Any]) -> None:
        self._arrays = arrays
        self._items = items
        self._restored: dict[int, Any] = {}
        self._versions: dict[int, int] = {}

    def restore(self, kind: Any, value: Any) -> Any:
        """The value of type `kind` from its JSON."""
        if value is None:
            return None
        if typing.get_origin(kind) in (types.UnionType, typing.Union):  # Optional: the alternative that is not None
            kind = next(item for item in typing.get_args(kind) if item is not types.NoneType)
        if isinstance(value, dict) and isinstance(value.get("array"), str):
            return self._arrays[value["array"]]
        if isinstance(value, dict) and isinstance(value.get("item"), int):
            return self._item(kind, value["item"])
        if is_dataclass(kind):
            return self._restore_fields(kind, value)
        if isinstance(kind, type) and issubclass(kind, Enum):
            return kind(value)
        return self._restore_generic(kind, value)

    def _item(self, kind: Any, number: int) -> Any:
        """A shared item, the same one each time."""
        if number not in self._restored:
            item = self._restore_fields(kind, self._items[number])
            self._restored[number] = replace(item, version=self._version(item.version))
        return self._restored[number]

    def _restore_fields(self, kind: Any, value: dict[str, Any]) -> Any:
        hints = typing.get_type_hints(kind)
        restored = kind(**{name: self.restore(hints[name], item) for name, item in value.items()})
        if isinstance(restored, Versions):
            return Versions(*(self._version(getattr(restored, field.name)) for field in fields(Versions)))
        return restored

    def _version(self, saved: int) -> int:
        """A number that nothing else in this process has, the same for equal ones of the file: that one belongs to
        another process."""
        if saved not in self._versions:
            self._versions[saved] = new_version()
        return self._versions[saved]

    def _restore_generic(self, kind: Any, value: Any) -> Any:
        """The value of a parametrised or basic type from its JSON."""
        origin, arguments = typing.get_origin(kind), typing.get_args(kind)
        if origin is tuple:
            item_types = [arguments[0]] * len(value) if arguments[-1] is Ellipsis else arguments
            return tuple(self.restore(item, part) for item, part in zip(item_types, value, strict=True))
        if isinstance(value, dict):
            return {key: self.restore(arguments[1], item) for key, item in value.items()}
        return value
