# SPDX-License-Identifier: GPL-3.0-or-later
"""Deep G-Buffer, a render engine for Blender.

Nothing of Blender is imported before `register()`, so that `addon.scene` and `addon.render` work without it.
"""


def register() -> None:
    """Register the engine, its settings and its panels with Blender."""
    from . import engine, ui

    ui.register()
    engine.register()


def unregister() -> None:
    """Take back everything `register` added, and stop the GL thread."""
    from . import engine, ui

    engine.unregister()
    ui.unregister()
