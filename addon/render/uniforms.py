# SPDX-License-Identifier: GPL-3.0-or-later
"""Uniform blocks, defined once in Python: the GLSL declaration and the bytes come from the same list of fields."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

# GLSL type -> (numpy base type, shape, std140 alignment in bytes). OpenGL 4.1 core specification, section 2.11.7.
_TYPES: dict[str, tuple[str, tuple[int, ...], int]] = {
    "float": ("f4", (), 4),
    "int": ("i4", (), 4),
    "vec2": ("f4", (2,), 8),
    "vec4": ("f4", (4,), 16),
    "vec4[6]": ("f4", (6, 4), 16),
    "mat4": ("f4", (4, 4), 16),
}


@dataclass(frozen=True)
class UniformBlock:
    """A std140 uniform block called `name`; `fields` are (name, GLSL type) pairs."""

    name: str
    fields: tuple[tuple[str, str], ...]

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """The block's memory layout as a numpy structured type, padded to 16 bytes."""
        offsets: list[int] = []
        end = 0
        for _, glsl_type in self.fields:
            base, shape, alignment = _TYPES[glsl_type]
            offset = -(-end // alignment) * alignment
            offsets.append(offset)
            end = offset + np.dtype((base, shape)).itemsize
        return np.dtype(
            {
                "names": [name for name, _ in self.fields],
                "formats": [(_TYPES[glsl_type][0], _TYPES[glsl_type][1]) for _, glsl_type in self.fields],
                "offsets": offsets,
                "itemsize": -(-end // 16) * 16,
            }
        )

    @property
    def glsl(self) -> str:
        """The block's GLSL declaration; its fields are global names in the shader."""
        members = "".join(f"    {glsl_type} {name};\n" for name, glsl_type in self.fields)
        return f"layout(std140) uniform {self.name}\n{{\n{members}}};\n"

    def pack(self, **values: Any) -> bytes:
        """The block's bytes. Matrices are given row-major (numpy) and stored column-major.

        Raises ValueError where a field is missing or unknown.
        """
        if set(values) != {name for name, _ in self.fields}:
            raise ValueError(f"{self.name} takes exactly {[name for name, _ in self.fields]}, got {sorted(values)}")
        block = np.zeros((), self.dtype)
        for name, glsl_type in self.fields:
            value = np.asarray(values[name])
            block[name] = value.T if glsl_type == "mat4" else value
        return block.tobytes()
