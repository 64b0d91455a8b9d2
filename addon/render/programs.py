# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader programs from `shaders/`: includes, defines, generated declarations and error messages that name our files."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import moderngl

from .uniforms import UniformBlock

GLSL_VERSION = "#version 410 core"

_MODERNGL_STAGES = {"vert": "vertex_shader", "geom": "geometry_shader", "frag": "fragment_shader"}

_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')
_IDENTIFIER = re.compile(r"[A-Za-z_]\w*")
# Mesa and Apple write "source:line", NVIDIA "source(line)".
_LOCATION = re.compile(r"(?<![\w.])(\d+):(\d+)|(?<![\w.])(\d+)\((\d+)\)")


class ShaderError(RuntimeError):
    """A shader does not compile or link; the message names our file and line."""


def shader_root() -> Path:
    """The folder of the shaders: inside the installed extension, or beside `addon/` in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "shaders"
    return inside if inside.is_dir() else package.parent / "shaders"


@dataclass(frozen=True)
class ProgramSpec:
    """A program variant: equal values compile once.

    `vertex`, `geometry` (None for no such stage), `fragment`: paths below `shaders/`. `defines`: names, or
    "NAME value" pairs. `blocks`: uniform blocks, bound to binding points 0, 1, … in order. `samplers`: sampler uniform
    names, bound to units 0, 1, … in order.
    `generated`: (include name, GLSL text) pairs for `#include "generated/NAME.glsl"`; every block is one as well.
    """

    vertex: str
    fragment: str
    defines: frozenset[str] = frozenset()
    geometry: str | None = None
    blocks: tuple[UniformBlock, ...] = ()
    samplers: tuple[str, ...] = ()
    generated: tuple[tuple[str, str], ...] = ()

    @property
    def stages(self) -> tuple[tuple[str, str], ...]:
        """(stage, path) of every stage; stages are named as glslangValidator names them."""
        geometry = (("geom", self.geometry),) if self.geometry else ()
        return (("vert", self.vertex), *geometry, ("frag", self.fragment))

    @property
    def name(self) -> str:
        """Readable name of the variant: the fragment shader and its defines."""
        return " ".join([self.fragment, *sorted(self.defines)])


class ExpandedSource(NamedTuple):
    """GLSL ready to compile, and the file names that its `#line` source numbers stand for."""

    text: str
    files: tuple[str, ...]


@dataclass
class _Expansion:
    generated: Mapping[str, str]
    files: list[str] = field(default_factory=list[str])
    lines: list[str] = field(default_factory=list[str])

    def add(self, path: str) -> None:
        """Append one file, following includes; each file is included once."""
        if path in self.files:
            return
        source_id = len(self.files)
        self.files.append(path)
        self.lines.append(f"#line 1 {source_id}")
        for number, line in enumerate(self._read(path).splitlines(), start=1):
            if match := _INCLUDE.match(line):
                self.add(match[1])
                self.lines.append(f"#line {number + 1} {source_id}")
            else:
                self.lines.append(line)

    def _read(self, path: str) -> str:
        if path.startswith("generated/"):
            name = path.removeprefix("generated/").removesuffix(".glsl")
            if name not in self.generated:
                raise ShaderError(f"{self.files[0]}: nothing generates {path}")
            return self.generated[name]
        try:
            return (shader_root() / path).read_text(encoding="utf-8")
        except OSError as error:
            raise ShaderError(f"shader file {path} cannot be read: {error}") from error


class _Joined(NamedTuple):
    """A file with its includes, before anything is defined: its text, their names, and all identifiers in it."""

    text: str
    files: tuple[str, ...]
    identifiers: frozenset[str]


def _join(path: str, blocks: tuple[UniformBlock, ...], generated: tuple[tuple[str, str], ...]) -> _Joined:
    """The file and all that it includes, which is the same for many variants. Raises ShaderError."""
    expansion = _Expansion({block.name: block.glsl for block in blocks} | dict(generated))
    expansion.add(path)
    text = "\n".join([*expansion.lines, ""])
    return _Joined(text, tuple(expansion.files), frozenset(_IDENTIFIER.findall(text)))


def _define(joined: _Joined, defines: frozenset[str]) -> ExpandedSource:
    """The source with those of the defines that it mentions."""
    mentioned = [f"#define {define}\n" for define in sorted(defines) if define.split()[0] in joined.identifiers]
    return ExpandedSource("".join([GLSL_VERSION, "\n", *mentioned, joined.text]), joined.files)


def expand(path: str, spec: ProgramSpec) -> ExpandedSource:
    """One stage's full source: version, the defines that it mentions, then the file with its includes.

    Raises ShaderError.
    """
    return _define(_join(path, spec.blocks, spec.generated), spec.defines)


def name_files(log: str, files: tuple[str, ...]) -> str:
    """A compiler log with `#line` source numbers replaced by our file names."""

    def replace(match: re.Match[str]) -> str:
        source, line = (match[1], match[2]) if match[1] is not None else (match[3], match[4])
        index = int(source)
        return f"shaders/{files[index]}:{line}" if index < len(files) else match[0]

    return _LOCATION.sub(replace, log)


class ProgramLibrary:
    """Compiled programs of one context, by variant."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._programs: dict[ProgramSpec, moderngl.Program] = {}

    def get(self, spec: ProgramSpec) -> moderngl.Program:
        """The program of a variant, compiled on first use. Raises ShaderError."""
        if spec not in self._programs:
            self._programs[spec] = self._compile(spec)
        return self._programs[spec]

    def release(self) -> None:
        """Free every program."""
        for program in self._programs.values():
            program.release()
        self._programs.clear()

    def _compile(self, spec: ProgramSpec) -> moderngl.Program:
        sources = {_MODERNGL_STAGES[stage]: expand(path, spec) for stage, path in spec.stages}
        try:
            program = self._context.program(
                vertex_shader=sources["vertex_shader"].text,
                geometry_shader=sources["geometry_shader"].text if spec.geometry else None,
                fragment_shader=sources["fragment_shader"].text,
            )
        except moderngl.Error as error:
            failed = next((stage for stage in sources if stage in str(error)), "fragment_shader")
            raise ShaderError(f"{spec.name}: {name_files(str(error), sources[failed].files)}") from error
        for binding, block in enumerate(spec.blocks):
            if block.name in program:  # the compiler drops blocks that a variant does not read
                program[block.name].binding = binding  # pyright: ignore[reportAttributeAccessIssue]
        for unit, sampler in enumerate(spec.samplers):
            if sampler in program:
                program[sampler].value = unit  # pyright: ignore[reportAttributeAccessIssue]
        return program


def all_variants() -> Iterator[tuple[str, str, ExpandedSource]]:
    """Every variant that any plan can ask for, as (name, stage, source), equal sources once: for offline validators."""
    from .passes import PASSES

    seen: set[str] = set()
    join = lru_cache(maxsize=None)(_join)
    for spec in (spec for render_pass in PASSES for spec in render_pass.variants()):
        for stage, path in spec.stages:
            source = _define(join(path, spec.blocks, spec.generated), spec.defines)
            if source.text not in seen:
                seen.add(source.text)
                yield f"{path} {' '.join(sorted(spec.defines))}".strip(), stage, source
