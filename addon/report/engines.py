# SPDX-License-Identifier: GPL-3.0-or-later
"""The engines that are driven, and text as values of their properties.

Used inside Blender but imports nothing of it; what it reads is duck-typed.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

TRUE = {"true", "1", "on", "yes"}
FALSE = {"false", "0", "off", "no"}
NOT_SETTABLE = {"POINTER", "COLLECTION"}


@dataclass(frozen=True)
class Engine:
    """How to drive one engine.

    `identifiers`: Blender's names for it, the newest first. `settings`: attribute of the scene with its own settings.
    `samples`, `time_limit`, `layers_path` (of files beside the picture): its properties, "" where it has none.
    """

    identifiers: tuple[str, ...]
    settings: str
    samples: str
    time_limit: str = ""
    layers_path: str = ""


ENGINES = {
    "DEEP_GBUFFER": Engine(("DEEP_GBUFFER",), "deep_gbuffer", "samples", "time_limit", "layers_path"),
    "CYCLES": Engine(("CYCLES",), "cycles", "samples", "time_limit"),
    "EEVEE": Engine(("BLENDER_EEVEE", "BLENDER_EEVEE_NEXT"), "eevee", "taa_render_samples"),
    "WORKBENCH": Engine(("BLENDER_WORKBENCH",), "display", "render_aa"),
}


def settable(group: Any) -> dict[str, Any]:
    """The properties of a Blender settings group that text can set, by name."""
    return {
        prop.identifier: prop
        for prop in group.bl_rna.properties
        if not prop.is_readonly and prop.type not in NOT_SETTABLE and prop.identifier != "name"
    }


def assign(group: Any, name: str, text: str) -> None:
    """Set property `name` of `group` from `text`; dots lead to groups within it, as in `indirect.method`.

    Raises ValueError, naming the known properties or values, where there is no such property or the text is no value
    of it.
    """
    inner, dot, rest = name.partition(".")
    if dot:
        assign(_group_in(group, inner), rest, text)
        return
    known = settable(group)
    if name not in known:
        raise ValueError(f"{group.bl_rna.identifier} has no property {name!r}; {_hint(name, known)}")
    try:
        setattr(group, name, parse(known[name], text))
    except TypeError as error:  # an enumeration whose values depend on the scene
        raise ValueError(f"{name}: {error}") from error


def _group_in(group: Any, name: str) -> Any:
    """The group of settings `name` within `group`. Raises ValueError naming those there are."""
    known = {prop.identifier for prop in group.bl_rna.properties if prop.type == "POINTER"} - {"rna_type"}
    if name not in known:
        raise ValueError(f"{group.bl_rna.identifier} has no settings {name!r}; {_hint(name, known)}")
    return getattr(group, name)


def _hint(name: str, known: Collection[str]) -> str:
    """What may have been meant by an unknown name."""
    near = get_close_matches(name, known, n=5)
    if near:
        return f"did you mean {' or '.join(near)}?"
    return f"it has {', '.join(sorted(known)) or 'none'}."


def parse(prop: Any, text: str) -> object:
    """The value that `text` means for the Blender property `prop`; vectors and sets are separated by commas.

    Raises ValueError, saying what is allowed, where it means none.
    """
    if prop.type == "ENUM" and prop.is_enum_flag:
        return {_one(prop, part) for part in text.split(",") if part}
    if getattr(prop, "is_array", False):
        parts = text.split(",")
        if len(parts) != prop.array_length:
            raise ValueError(f"{prop.identifier} takes {prop.array_length} values separated by commas, not {text!r}.")
        return [_one(prop, part) for part in parts]
    return _one(prop, text)


def _one(prop: Any, text: str) -> object:
    """One value of `prop`, like `parse`."""
    if prop.type == "STRING":
        return text
    text = text.strip()
    if prop.type == "BOOLEAN":
        if text.lower() not in TRUE | FALSE:
            raise ValueError(f"{prop.identifier} is true or false, not {text!r}.")
        return text.lower() in TRUE
    if prop.type == "ENUM":
        items = [item.identifier for item in prop.enum_items]
        if items and text not in items:
            raise ValueError(f"{prop.identifier} is one of {', '.join(items)}, not {text!r}.")
        return text
    return _number(prop, text)


def _number(prop: Any, text: str) -> float:
    """A number within the hard limits of `prop`, which Blender would clamp to silently."""
    kind = int if prop.type == "INT" else float
    try:
        number = kind(text)
    except ValueError as error:
        noun = "a whole number" if kind is int else "a number"
        raise ValueError(f"{prop.identifier} is {noun}, not {text!r}.") from error
    if not prop.hard_min <= number <= prop.hard_max:
        raise ValueError(f"{prop.identifier} is from {prop.hard_min:g} to {prop.hard_max:g}, not {text}.")
    return number
