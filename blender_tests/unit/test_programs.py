# SPDX-License-Identifier: GPL-3.0-or-later
import pytest

from addon.render import programs
from addon.render.programs import ProgramSpec, ShaderError, all_variants, expand, name_files


@pytest.fixture
def shaders(tmp_path, monkeypatch):
    monkeypatch.setattr(programs, "shader_root", lambda: tmp_path)
    (tmp_path / "a.frag").write_text('first\n#include "b.glsl"\nthird\n#include "b.glsl"\n#include "generated/G.glsl"')
    (tmp_path / "b.glsl").write_text("inside A")
    return tmp_path


def spec(**arguments):
    return ProgramSpec("a.vert", "a.frag", generated=(("G", "generated text"),), **arguments)


def test_includes_are_expanded_once_with_line_numbers_of_their_own_file(shaders):
    text, files = expand("a.frag", spec(defines=frozenset({"first", "A 1"})))
    assert files == ("a.frag", "b.glsl", "generated/G.glsl")
    assert text.splitlines() == [
        "#version 410 core",
        "#define A 1",
        "#define first",
        "#line 1 0",
        "first",
        "#line 1 1",
        "inside A",
        "#line 3 0",
        "third",
        "#line 5 0",
        "#line 1 2",
        "generated text",
        "#line 6 0",
    ]


def test_a_stage_gets_the_defines_that_it_mentions_and_no_others(shaders):
    text, _ = expand("a.frag", spec(defines=frozenset({"A", "ELSEWHERE 2"})))
    assert "#define A\n" in text
    assert "ELSEWHERE" not in text


def test_missing_files_are_named(shaders):
    (shaders / "a.frag").write_text('#include "nowhere.glsl"')
    with pytest.raises(ShaderError, match="nowhere.glsl"):
        expand("a.frag", spec())
    (shaders / "a.frag").write_text('#include "generated/H.glsl"')
    with pytest.raises(ShaderError, match="nothing generates generated/H"):
        expand("a.frag", spec())


@pytest.mark.parametrize("log", ["1:12(5): error: no", "1(12) : error C0000: no", "ERROR: 1:12: no"])
def test_driver_logs_name_our_files(log):
    assert "shaders/common/b.glsl:12" in name_files(log, ("a.frag", "common/b.glsl"))


def test_every_declared_variant_expands():
    names = {name.split()[0] for name, _, _ in all_variants()}
    assert names >= {
        "gbuffer/gbuffer.vert",
        "gbuffer/gbuffer.geom",
        "gbuffer/gbuffer.frag",
        "direct/direct.frag",
        "composite/composite.frag",
    }
