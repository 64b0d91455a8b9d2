# SPDX-License-Identifier: GPL-3.0-or-later
"""Showing an image in an Image Editor."""

from typing import Any

import bpy

TAB = "Comparison"
"""Of the sidebar."""

_SETTLE_SECONDS = 0.1
"""A new editor has no size and no tabs before it was drawn."""


def show(image: Any, context: Any) -> bool:
    """Show `image`, with its tab of the sidebar, in an Image Editor; whether there is one.

    An editor that is open is taken, else a new window, unless the preferences want renders to open nothing. No other
    editor is turned into one, as they may want for renders: only of a render does Blender know what was there before.
    Raises RuntimeError where Blender cannot open a window.
    """
    area = _open_editor(context) or _new_editor(context)
    if area is None:
        return False
    space = area.spaces.active
    space.mode = "VIEW"
    space.image = image
    space.show_region_ui = True
    manager, pointer = context.window_manager, area.as_pointer()
    bpy.app.timers.register(lambda: _settle(manager, pointer), first_interval=_SETTLE_SECONDS)
    return True


def _settle(manager: Any, pointer: int) -> None:
    """Fit the image into its editor and open the tab, if the editor is still there."""
    for window in manager.windows:
        for area in window.screen.areas:
            if area.as_pointer() != pointer or area.type != "IMAGE_EDITOR":
                continue
            regions = {region.type: region for region in area.regions}
            regions["UI"].active_panel_category = TAB
            with bpy.context.temp_override(window=window, area=area, region=regions["WINDOW"]):
                bpy.ops.image.view_all(fit_view=True)


def _open_editor(context: Any) -> Any | None:
    """An Image Editor of the window, else of any."""
    others = [other for other in context.window_manager.windows if other != context.window]
    editors = (
        area for each in (context.window, *others) for area in each.screen.areas if area.ui_type == "IMAGE_EDITOR"
    )
    return next(editors, None)


def _new_editor(context: Any) -> Any | None:
    """An Image Editor in a window of its own; None where the preferences want renders to open nothing."""
    if context.preferences.view.render_display_type == "NONE":
        return None
    bpy.ops.wm.window_new()
    area = context.window_manager.windows[-1].screen.areas[0]
    area.ui_type = "IMAGE_EDITOR"
    return area
