# SPDX-License-Identifier: GPL-3.0-or-later
from pathlib import Path

import pytest

from addon.render.layout import CHANNELS, DEPTH_BYTES, EXIT_CHANNELS, outputs_glsl
from tooling import readme_tables


def test_a_layer_takes_no_more_than_48_bytes_per_texel():
    channels = CHANNELS + EXIT_CHANNELS
    assert sum(channel.target(1).bytes_per_texel for channel in channels) + DEPTH_BYTES <= 48


def test_every_channel_has_a_target_of_its_own():
    targets = [channel.target(3) for channel in CHANNELS + EXIT_CHANNELS]
    assert len({target.name for target in targets}) == len(targets)
    assert {target.name.partition(".")[0] for target in targets} == {"gbuffer", "exit"}
    assert {target.layers for target in targets} == {3}


def test_outputs_are_declared_in_attachment_order():
    declared = outputs_glsl(EXIT_CHANNELS).splitlines()
    assert declared == [
        "layout(location = 0) out float out_view_depth;",
        "layout(location = 1) out vec2 out_normal;",
        "layout(location = 2) out vec4 out_base_color;",
    ]


def test_the_readme_has_the_tables_that_the_code_makes():
    readme = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    assert readme_tables.with_tables(readme) == readme, f"README.md is out of date: run `{readme_tables.COMMAND}`"


def test_a_readme_without_the_comments_around_the_table_is_refused():
    with pytest.raises(ValueError, match="end of channels"):
        readme_tables.with_tables(readme_tables.CHANNELS.begin)
