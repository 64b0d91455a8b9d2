# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the README's tables that come from code; runs in the development environment."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parent.parent))

from addon.render.layout import channels_table
from tooling import places

COMMAND = "python tooling/readme_tables.py"
BEGIN = "<!-- channels: made by tooling/readme_tables.py from addon/render/layout.py -->\n"
END = "<!-- end of channels -->\n"


def with_tables(readme: str) -> str:
    """The README's text with its tables as the code has them.

    Raises ValueError where the comments around them are missing.
    """
    before, begin, rest = readme.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"README.md needs the lines {BEGIN!r} and {END!r} around its table of channels")
    return f"{before}{BEGIN}\n{channels_table()}\n{END}{after}"


def main() -> None:
    """Write README.md."""
    path = places.REPOSITORY / "README.md"
    path.write_text(with_tables(path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
