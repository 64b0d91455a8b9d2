# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare with Cycles: the operators."""

import signal
import sys
import time
from typing import Any

import bpy

from ..engine import statistics
from ..report.comparison import ComparisonError
from . import compared_images, comparing, image_editors

TICK_SECONDS = 0.1
LINE_SECONDS = 1.0
"""Least time between two lines of status in background."""


class DEEP_GBUFFER_OT_compare_with_cycles(bpy.types.Operator):
    """Compare our picture of a scene with Cycles'."""

    bl_idname = "deep_gbuffer.compare_with_cycles"
    bl_label = "Compare with Cycles"
    bl_description = (
        "Render the current frame with this engine and with Cycles, in a Blender of its own, and show how far the "
        "pictures are apart. The scene, its settings and the last render stay as they are"
    )
    bl_options = {"REGISTER"}  # noqa: RUF012 - Blender's own attribute; keeps the last values

    samples: bpy.props.IntProperty(
        name="Cycles Samples",
        description="Samples per pixel of Cycles, rendered in two halves that tell how much noise is left",
        default=128,
        min=2,
        soft_max=4096,
    )
    percent: bpy.props.IntProperty(
        name="Resolution",
        description="Size of both pictures, relative to the scene's render resolution",
        subtype="PERCENTAGE",
        default=50,
        min=1,
        max=100,
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """One at a time, of scenes that our engine renders."""
        if context.scene.render.engine != statistics.ENGINE:
            cls.poll_message_set("The scene's render engine is not Deep G-Buffer")
            return False
        if comparing.running() is not None:
            cls.poll_message_set("A comparison with Cycles is running")
            return False
        return True

    def invoke(self, context: Any, event: Any) -> Any:
        """Ask for the properties first."""
        return context.window_manager.invoke_props_dialog(self, confirm_text="Compare")

    def draw(self, context: Any) -> None:
        """The properties, and the size that they give."""
        layout: Any = self.layout
        layout.use_property_split = True
        layout.prop(self, "samples")
        layout.prop(self, "percent")
        width, height = comparing.resolution(context.scene, self.percent)
        layout.label(text=f"{width} × {height} pixels", icon="INFO")

    def execute(self, context: Any) -> Any:
        """Start; in background go on to the end, in a window leave that to the operator that follows."""
        try:
            comparing.start(context.scene, self.samples, self.percent)
            if lost := comparing.lost_edits():
                self.report({"WARNING"}, f"Unsaved pixels are not compared, save or pack these: {', '.join(lost)}")
            if bpy.app.background:
                _run_to_the_end()
                self.report({"INFO"}, _result())
            else:
                _follow(context)
        except ComparisonError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class DEEP_GBUFFER_OT_follow_comparison(bpy.types.Operator):
    """Show how far the comparison with Cycles is, and its pictures in the end"""

    bl_idname = "deep_gbuffer.follow_comparison"
    bl_label = "Follow Comparison"
    bl_options = {"INTERNAL"}  # noqa: RUF012 - Blender's own attribute

    def invoke(self, context: Any, event: Any) -> Any:
        """Go on between Blender's other events."""
        self._comparison = comparing.running()
        self._timer = context.window_manager.event_timer_add(TICK_SECONDS, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> Any:
        """Escape cancels; everything else goes on as ever."""
        if event.type == "ESC" and event.value == "PRESS":
            comparing.cancel()
        elif event.type != "TIMER":
            return {"PASS_THROUGH"}
        goes_on = False
        try:
            if comparing.running() is not self._comparison:  # cancelled elsewhere, maybe followed by another
                raise comparing.CancelledError
            goes_on = comparing.step()
            if goes_on:
                _show_progress(context.window_manager)
            else:
                shown = image_editors.show(bpy.data.images[compared_images.DIFFERENCE], context)
                where = "" if shown else f"; see the image “{compared_images.DIFFERENCE}”"
                self.report({"INFO"}, f"{_result()}{where}")
        except comparing.CancelledError as cancelled:
            self.report({"INFO"}, str(cancelled))
        except RuntimeError as error:  # ComparisonError, or Blender's own where it cannot show the image
            self.report({"ERROR"}, str(error))
        finally:
            if not goes_on:
                self._end(context)
        return {"PASS_THROUGH"} if goes_on else {"FINISHED"}

    def cancel(self, context: Any) -> None:
        """Its window closes, another file is loaded, or Blender ends."""
        comparing.cancel()
        self._end(context)

    def _end(self, context: Any) -> None:
        context.window_manager.event_timer_remove(self._timer)
        _show_progress(context.window_manager)


class DEEP_GBUFFER_OT_cancel_comparison(bpy.types.Operator):
    """End the comparison with Cycles that is running; the images of an earlier one stay"""

    bl_idname = "deep_gbuffer.cancel_comparison"
    bl_label = "Cancel Comparison"
    bl_options = {"INTERNAL"}  # noqa: RUF012 - Blender's own attribute

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only where one runs."""
        return comparing.running() is not None

    def execute(self, context: Any) -> Any:
        """End it."""
        comparing.cancel()
        return {"FINISHED"}


class DEEP_GBUFFER_OT_show_compared(bpy.types.Operator):
    """Show this picture of the comparison in this editor"""

    bl_idname = "deep_gbuffer.show_compared"
    bl_label = "Show Compared Picture"
    bl_options = {"INTERNAL"}  # noqa: RUF012 - Blender's own attribute

    image: bpy.props.StringProperty(name="Image", description="Name of the picture's image", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only in Image Editors."""
        return context.area is not None and context.area.type == "IMAGE_EDITOR"

    def execute(self, context: Any) -> Any:
        """Switch to it, as near as before."""
        found = bpy.data.images.get(self.image)
        if found is None:
            self.report({"ERROR"}, f"There is no image “{self.image}” any more: compare again.")
            return {"CANCELLED"}
        compared_images.switch(context.space_data, found)
        return {"FINISHED"}


def _follow(context: Any) -> None:
    """Let an operator follow the comparison in a window, any one where the context, a timer's say, has none.

    Raises ComparisonError where there is none that it can run in; the comparison is cancelled then.
    """
    window = context.window or next(iter(context.window_manager.windows), None)
    operators: Any = bpy.ops
    try:
        if window is None:
            raise ComparisonError("There is no window that could show a comparison.")
        with context.temp_override(window=window):
            operators.deep_gbuffer.follow_comparison("INVOKE_DEFAULT")
    except RuntimeError as error:
        comparing.cancel()
        raise ComparisonError(str(error)) from error


def _run_to_the_end() -> None:
    """Wait for the comparison, with a line of status now and then, as Blender's own renders have in background.

    Raises ComparisonError where it fails, and where Ctrl+C ends it.
    """
    shown, last = "", 0.0
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)  # a real Blender would end at once
    try:
        while comparing.step():
            now, text = time.monotonic(), _status()
            if text != shown and now - last >= LINE_SECONDS:
                sys.stdout.write(f"{text}\n")
                sys.stdout.flush()
                shown, last = text, now
            time.sleep(TICK_SECONDS)
    except KeyboardInterrupt as interrupt:
        raise comparing.CancelledError from interrupt
    finally:
        comparing.cancel()
        signal.signal(signal.SIGINT, usual or signal.SIG_DFL)


def _result() -> str:
    """What the last comparison found, in one line."""
    numbers = comparing.numbers()
    return (
        f"Compared with Cycles: RMSE {numbers.errors.rmse:.4g}, noise of Cycles {numbers.noise_rmse:.2g}"
        if numbers
        else ""
    )


def _status() -> str:
    """How far the running comparison is, in one line; "" where none runs."""
    running = comparing.running()
    return f"Compare with Cycles: {running.progress.fraction:.0%} | {running.progress.text}" if running else ""


def _show_progress(manager: Any) -> None:
    """Bring status bars and panels up to date."""
    text = _status()
    for workspace in bpy.data.workspaces:
        workspace.status_text_set(f"{text} | Esc to cancel" if text else None)
    for window in manager.windows:
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()


CLASSES = (
    DEEP_GBUFFER_OT_compare_with_cycles,
    DEEP_GBUFFER_OT_follow_comparison,
    DEEP_GBUFFER_OT_cancel_comparison,
    DEEP_GBUFFER_OT_show_compared,
)
