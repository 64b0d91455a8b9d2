# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes as `.npz` files: arrays beside a JSON description, nothing that could run code when it is opened.

A snapshot saved on a machine with Blender renders on one without.
"""

import json
import os
import types
import typing
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from .scene import Scene, Versions
from .versions import new_version

FORMAT_VERSION = 2
_HEADER = "header"


class SnapshotError(ValueError):
    """The file is not a scene snapshot that this version reads; the message names the file."""


def save(path: str | Path, scene: Scene) -> None:
    """Write a scene to `path`, never half of it; makes the folder. Raises OSError naming the file where that fails."""
    arrays: dict[str, np.ndarray[Any, Any]] = {}
    description = {"format": FORMAT_VERSION, "scene": _describe(scene, arrays)}
    arrays[_HEADER] = np.frombuffer(json.dumps(description).encode(), np.uint8)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with draft.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)


def load(path: str | Path) -> Scene:
    """Read a scene; its items get version numbers of this process.

    Raises OSError where the file cannot be read, SnapshotError where it is something else.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        description = json.loads(arrays[_HEADER].tobytes())
        if description["format"] != FORMAT_VERSION:
            raise SnapshotError(f"{path}: snapshot format {description['format']}, expected {FORMAT_VERSION}")
        return _with_own_versions(_restore(Scene, description["scene"], arrays))
    except (OSError, SnapshotError):
        raise
    except Exception as error:  # whatever a damaged archive makes numpy, zipfile or json raise
        raise SnapshotError(f"{path}: not a scene snapshot ({error})") from error


def _with_own_versions(scene: Scene) -> Scene:
    """The scene with numbers that nothing else in this process has: those in the file belong to another process."""
    return replace(
        scene,
        meshes={key: replace(item, version=new_version()) for key, item in scene.meshes.items()},
        materials={key: replace(item, version=new_version()) for key, item in scene.materials.items()},
        images={key: replace(item, version=new_version()) for key, item in scene.images.items()},
        batches=tuple(replace(item, version=new_version()) for item in scene.batches),
        versions=Versions(*(new_version() for _ in fields(Versions))),
    )


def _describe(value: Any, arrays: dict[str, np.ndarray[Any, Any]]) -> Any:
    """JSON for a value; arrays are moved into `arrays` and named."""
    if isinstance(value, np.ndarray):
        name = f"array{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if is_dataclass(value):
        return {item.name: _describe(getattr(value, item.name), arrays) for item in fields(value)}
    if isinstance(value, Mapping):
        return {key: _describe(item, arrays) for key, item in value.items()}
    if isinstance(value, tuple):
        return [_describe(item, arrays) for item in value]
    return value.value if isinstance(value, Enum) else value


def _restore(kind: Any, value: Any, arrays: Mapping[str, np.ndarray[Any, Any]]) -> Any:
    """The value of a declared type from its JSON."""
    if isinstance(value, dict) and set(value) == {"array"}:
        return arrays[value["array"]]
    if value is None:
        return None
    if is_dataclass(kind):
        hints = typing.get_type_hints(kind)
        return kind(**{name: _restore(hints[name], item, arrays) for name, item in value.items()})  # pyright: ignore
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(value)
    return _restore_generic(kind, value, arrays)


def _restore_generic(kind: Any, value: Any, arrays: Mapping[str, np.ndarray[Any, Any]]) -> Any:
    """The value of a parametrised or basic type from its JSON."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        # Optional: the one alternative that is not None. Arrays and None were restored before.
        return _restore(next(item for item in arguments if item is not type(None)), value, arrays)
    if origin is tuple:
        item_types = [arguments[0]] * len(value) if arguments[-1] is Ellipsis else arguments
        return tuple(_restore(item, part, arrays) for item, part in zip(item_types, value, strict=True))
    if isinstance(value, dict):
        return {key: _restore(arguments[1], item, arrays) for key, item in value.items()}
    return value
