# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from addon.render.uniforms import UniformBlock

BLOCK = UniformBlock(
    "Example", (("a", "float"), ("b", "vec2"), ("c", "int"), ("d", "vec4"), ("e", "float"), ("f", "mat4"))
)


def test_offsets_follow_std140():
    """OpenGL 4.1 core, 2.11.7: vec2 aligns to 8, vec4 and mat4 columns to 16 bytes; the block to 16."""
    fields = BLOCK.dtype.fields
    assert fields is not None
    assert [fields[name][1] for name in "abcdef"] == [0, 8, 16, 32, 48, 64]
    assert BLOCK.dtype.itemsize == 128


def test_matrices_are_stored_by_column():
    matrix = np.arange(16.0).reshape(4, 4)
    data = np.frombuffer(BLOCK.pack(a=1, b=(2, 3), c=4, d=(5, 6, 7, 8), e=9, f=matrix), np.float32)
    np.testing.assert_array_equal(data[16:32], matrix.T.ravel())


def test_the_declaration_lists_every_field_in_order():
    assert BLOCK.glsl.split() == (
        "layout(std140) uniform Example { float a; vec2 b; int c; vec4 d; float e; mat4 f; };".split()
    )


@pytest.mark.parametrize("names", ["abcde", "abcdefg"])
def test_missing_and_unknown_fields_are_refused(names):
    with pytest.raises(ValueError, match="Example takes exactly"):
        BLOCK.pack(**dict.fromkeys(names, 0))
