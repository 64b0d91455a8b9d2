# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report says to someone who has never seen one."""

TITLE = "Error against run time"
INTRODUCTION = (
    "Each scene below was rendered in many ways: by Deep G-Buffer with different settings, and by Blender's own "
    "engines Cycles, EEVEE and Workbench. Every picture is compared with a reference, a Cycles render of the same "
    "scene with many samples, and every render is timed. What counts is both together: which picture is closest to "
    "the reference after a given time. Deep G-Buffer does not render reflections of the scene or transparency yet: "
    "where a scene has them, its pictures differ however many samples it takes."
)
QUICK = (
    "This is a quick report: few points, each rendered in one process (smaller pictures and a reference of fewer "
    "samples unless told otherwise). It shows where things stand; leave out --quick for figures to rely on."
)
LEFT_OUT = "Work that Deep G-Buffer skipped, as the scene and the settings do not need it; no picture changes by that"
COMMANDS = "Commands that render each point again"
COMMANDS_NOTE = (
    "Times of the first render are cold only with an empty shader cache. The report switches compositing and the "
    "sequencer off, which these commands do not: a file that uses them gives another picture."
)
PEERS = "Plots: filled marks are Deep G-Buffer, hollow triangles and dashed lines the other engines."
FRONT = (
    "★ and the grey staircase in the plots mark the Pareto front: the points that no other beats in both time and "
    "error. The star in the tables is for FLIP."
)
TERMS = (
    (
        "FLIP",
        "lower is better",
        "How different two pictures look to a person who flips between them, by NVIDIA's FLIP: 0 is equal, 1 as "
        "different as can be. It judges pictures as displayed, with the view transform Standard whatever the file's. "
        "To judge a figure, look at the pictures below.",
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
        "99.9th percentile of how much brighter than the reference a pixel is: bright specks, but also areas that are "
        "too bright; a picture that is too dark hides its specks.",
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
        "file; warm are further renders of the same process with Persistent Data: for a single frame, the same "
        "unchanged frame again. Warm times are medians, with the least and the greatest beside them where there were "
        "several renders.",
    ),
    (
        "noise floor",
        "",
        "The reference is itself a render with some noise left, which was estimated from two independent halves of its "
        "samples or, where the reference was given with the file, from two further short renders by Cycles. Close to "
        "it, errors and differences between points mean little; far above it small differences can be real. It is "
        "known for FLIP and RMSE.",
    ),
    (
        "other engines",
        "",
        "Cycles renders without clamping and adaptive sampling; its denoiser is OpenImageDenoise with prefilter and "
        "quality Fast. EEVEE renders with ray tracing and without baked probes. Everything else is as in the file.",
    ),
    (
        "March + grid, deep march, radiosity, ambient occlusion, SSAO",
        "",
        "The ways in which Deep G-Buffer finds indirect light; where a series does not name one, it is march + grid. "
        "Exit surfaces tell its rays where objects end behind their visible side.",
    ),
    (
        "Resolution scale",
        "",
        "The picture is rendered smaller, at this part of its width and height, and enlarged bilinearly.",
    ),
)
