# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the README's tables that come from code; runs in the development environment."""

import sys
from pathlib import Path
from typing import NamedTuple

sys.path.append(str(Path(__file__).resolve().parent.parent))

from addon.render.layout import channels_table
from tooling import places

COMMAND = "python tooling/readme_tables.py"


class Block(NamedTuple):
    """A part of the README that is not written by hand: the lines, comments, around it."""

    begin: str
    end: str


CHANNELS = Block(
    "<!-- channels: made by tooling/readme_tables.py from addon/render/layout.py -->\n", "<!-- end of channels -->\n"
)
REPORT = Block("<!-- report: made by build.py bench report -->\n", "<!-- end of report -->\n")


def filled(readme: str, block: Block, content: str) -> str:
    """The README's text with `content`, which ends with a line break, in `block`.

    Raises ValueError where the comments around it are missing.
    """
    before, begin, rest = readme.partition(block.begin)
    _, end, after = rest.partition(block.end)
    if not begin or not end:
        raise ValueError(f"README.md needs the lines {block.begin!r} and {block.end!r} around what is made")
    return f"{before}{begin}\n{content}\n{end}{after}"


def with_tables(readme: str) -> str:
    """The README's text with its tables as the code has them. Raises ValueError as `filled`."""
    return filled(readme, CHANNELS, channels_table())


def main() -> None:
    """Write README.md."""
    path = places.REPOSITORY / "README.md"
    path.write_text(with_tables(path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
