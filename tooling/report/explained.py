# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report says to someone who has never seen one."""

TITLE = "Error against run time"
INTRODUCTION = (
    "Each scene below was rendered in many ways: by Deep G-Buffer with different settings, and by Blender's own "
    "engines Cycles, EEVEE and Workbench. Every picture is compared with a reference, a very long Cycles render of "
    "the same scene, and every render is timed. What counts is both together: which picture is closest to the "
    "reference after a given time."
)
QUICK = (
    "This is a quick report: small pictures, few points, measured once, and a reference with more noise. It shows "
    "where things stand; leave out --quick for figures to rely on."
)
PEERS = "Plots: filled marks are Deep G-Buffer, hollow marks and dashed lines the other engines."
FRONT = (
    "★ and the grey staircase in the plots mark the Pareto front: the points that no other beats in both time and "
    "error. The star in the tables is for FLIP."
)
TERMS = (
    (
        "FLIP",
        "lower is better",
        "How different two pictures look to a person who flips between them, by NVIDIA's FLIP: 0 is equal, 1 as "
        "different as can be. It judges pictures as displayed, with the view transform Standard whatever the file's.",
    ),
    (
        "RMSE",
        "lower is better",
        "Root mean square error of the scene-linear colours. A few very bright pixels can decide it.",
    ),
    (
        "relative MSE",
        "lower is better",
        "Mean of error² / (reference² + 0.01): errors in dark places count as much as those in bright ones.",
    ),
    (
        "PSNR",
        "higher is better",
        "Peak signal-to-noise ratio of the pictures as displayed (Standard), in decibels; ∞ for equal pictures.",
    ),
    (
        "bias",
        "nearer to 0 is better",
        "Mean signed error of red, green and blue. Noise averages out in it, so it shows what is missing (negative, "
        "too dark) or too much (positive): it does not go away with more samples.",
    ),
    (
        "fireflies",
        "lower is better",
        "99.9th percentile of how much brighter than the reference a pixel is: single bright specks.",
    ),
    (
        "flicker",
        "lower is better",
        "For sequences: how much displayed colours change from frame to frame once motion is taken out. Some change is "
        "real (moving highlights, shadows); the reference's own is given for comparison.",
    ),
    (
        "warm and cold",
        "",
        "Seconds per frame. Cold is the first render of a new process with an empty shader cache, without loading the "
        "file; warm are further renders of the same process with Persistent Data. Warm times are medians, with the "
        "least and the greatest beside them.",
    ),
    (
        "noise floor",
        "",
        "The reference is itself a render with some noise left, which was estimated from two independent halves of its "
        "samples. Errors below it mean nothing, and differences between points that are smaller than it mean little.",
    ),
)
