# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare with Cycles: its panels in the render tab and in Image Editors."""

from typing import Any

import bpy

from ..report.compared import Numbers
from . import compared_images, comparing
from .compare import (
    DEEP_GBUFFER_OT_cancel_comparison,
    DEEP_GBUFFER_OT_compare_with_cycles,
    DEEP_GBUFFER_OT_show_compared,
)
from .image_editors import TAB
from .panels import CLOSED, EnginePanel, table


class DEEP_GBUFFER_PT_compare(EnginePanel, bpy.types.Panel):
    """How far the engine's pictures of this scene are from Cycles'."""

    bl_label = "Compare with Cycles"
    bl_options = CLOSED

    def draw(self, context: Any) -> None:
        """The button; while it runs, how far it is."""
        running = comparing.running()
        if running is None:
            self.layout.operator(DEEP_GBUFFER_OT_compare_with_cycles.bl_idname, icon="IMAGE_RGB")
            return
        progress = running.progress
        self.layout.progress(factor=progress.fraction, text=f"{progress.fraction:.0%}  {progress.text}")
        self.layout.operator(DEEP_GBUFFER_OT_cancel_comparison.bl_idname, text="Cancel", icon="CANCEL")


class DEEP_GBUFFER_PT_compared(bpy.types.Panel):
    """What a comparison found, beside its pictures."""

    bl_label = "Comparison with Cycles"
    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = TAB
    layout: Any

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Where a picture of the last comparison is shown."""
        image = context.space_data.image
        return image is not None and image.name in compared_images.IMAGES.values() and comparing.numbers() is not None

    def draw(self, context: Any) -> None:
        """The three pictures to choose from, and the numbers."""
        shown = context.space_data.image.name
        column = self.layout.column(align=True)
        for name in compared_images.IMAGES.values():
            title = name.removeprefix("Comparison: ")
            button = column.operator(DEEP_GBUFFER_OT_show_compared.bl_idname, text=title, depress=name == shown)
            button.image = name
        if shown == compared_images.DIFFERENCE:
            self.layout.label(text="Black where the two are equal")
        numbers = comparing.numbers()
        assert numbers is not None  # by poll
        for title, rows in tables(numbers):
            table(self.layout, title, rows)
        if numbers.noise_counts:
            hint = self.layout.column(align=True)
            hint.label(text="Much of this is Cycles' own noise:", icon="INFO")
            hint.label(text="compare with more samples", icon="BLANK1")


def tables(numbers: Numbers) -> list[tuple[str, list[tuple[str, str]]]]:
    """What the panel lists: titles, and rows of name and value."""
    errors = numbers.errors
    width, height = numbers.resolution
    psnr = "equal" if errors.psnr == float("inf") else f"{errors.psnr:.2f} dB"
    bias = [
        (f"Bias, {name}", f"{value:+.5f}") for name, value in zip(("red", "green", "blue"), errors.bias, strict=True)
    ]
    return [
        (
            "Renders",
            [
                ("Size", f"{width} × {height}"),
                ("Cycles samples", f"{numbers.samples:,}"),
            ],
        ),
        (
            "Time (ours with start-up)",
            [
                ("Deep G-Buffer", f"{numbers.our_seconds:.2f} s"),
                ("Cycles", f"{numbers.cycles_seconds:.2f} s"),
            ],
        ),
        (
            "Error",
            [
                ("RMSE", f"{errors.rmse:.5f}"),
                ("Noise of Cycles", f"{numbers.noise_rmse:.5f}"),
                ("Relative MSE", f"{errors.relative_mse:.5f}"),
                ("PSNR, Standard", psnr),
                *bias,
                ("Fireflies", f"{errors.fireflies:.4f}"),
                ("Invalid pixels", f"{errors.invalid:,}"),
            ],
        ),
    ]


CLASSES = (DEEP_GBUFFER_PT_compare, DEEP_GBUFFER_PT_compared)
