# SPDX-License-Identifier: GPL-3.0-or-later
"""What happens when a setting changes."""

from typing import Any

from ..engine import viewport


def changed(_settings: Any, _context: Any) -> None:
    """Scripts that set a property cause no redraw by themselves."""
    viewport.redraw()
