# SPDX-License-Identifier: GPL-3.0-or-later
"""Version numbers of scene items."""

import itertools

_versions = itertools.count(1)


def new_version() -> int:
    """A version number that this process has never used.

    An item that vanishes and returns (undo), is mirrored twice or comes from a file never shows an old number with
    new data.
    """
    return next(_versions)
