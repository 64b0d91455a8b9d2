#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Render, test, check, package and bench Deep G-Buffer. What a verb needs is set up on its first use."""

from __future__ import annotations

import argparse
import importlib
import re
import signal
import sys
from types import FrameType

MINIMUM_PYTHON = (3, 9)
TEST_KINDS = ("unit", "gl", "blender", "gui", "stability", "report")


def resolution(text: str) -> tuple[int, int]:
    """`640x360` as (640, 360)."""
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if not match or not int(match[1]) or not int(match[2]):
        raise argparse.ArgumentTypeError(f"{text!r} is not a resolution like 640x360")
    return int(match[1]), int(match[2])


def frame_range(text: str) -> list[int]:
    """`1-24` as the list of frames, both ends included; a frame may be negative."""
    match = re.fullmatch(r"(-?\d+)-(-?\d+)", text)
    if not match or int(match[1]) > int(match[2]):
        raise argparse.ArgumentTypeError(f"{text!r} is not a range of frames like 1-24")
    return list(range(int(match[1]), int(match[2]) + 1))


def scene_file(text: str) -> tuple[str, tuple[int, int] | None]:
    """`room.blend@360x360` as ("room.blend", (360, 360)); without `@…` as (text, None)."""
    match = re.fullmatch(r"(.+\.blend)@([^/\\]*)", text)
    return (match[1], resolution(match[2])) if match else (text, None)


def assignment(text: str) -> tuple[str, str]:
    """`layers=4` as (name, text)."""
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise argparse.ArgumentTypeError(f"{text!r} is not name=value")
    return name, value


def positive(text: str) -> int:
    """A whole number of at least 1."""
    if not text.isdigit() or not int(text):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number above 0")
    return int(text)


def seconds(text: str) -> float:
    """A duration of at least 0 seconds."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds")
    return value


def add_report(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb `report` with its options to `verbs`."""
    report = verbs.add_parser(
        "report",
        help="measure error against run time, with Cycles as the reference",
        description="""Render scenes with everything this engine offers and with Cycles, EEVEE and Workbench, and write
            a page that shows how far each picture is from a Cycles reference and how long it took. A report that was
            interrupted goes on where it stopped when the same command is given again.""",
    )
    report.set_defaults(verb=("tooling.reporting", "report"))
    report.add_argument(
        "scenes",
        nargs="+",
        type=scene_file,
        metavar="SCENE.blend[@WxH]",
        help="a file to render; with @WxH only the rectangle of that size in the picture's centre is judged",
    )
    report.add_argument(
        "-o",
        "--output",
        default="report",
        metavar="FOLDER",
        help="gets index.html, report.csv, report.json, report.md and what is measured; default: %(default)s",
    )
    report.add_argument("--quick", action="store_true", help="few points, small pictures, one round: some minutes")
    report.add_argument(
        "--resolution", type=resolution, metavar="WxH", help="in pixels; default: the file's, with --quick 320x180"
    )
    frames = report.add_mutually_exclusive_group()
    frames.add_argument("--frame", type=int, metavar="N", help="one frame; default: the file's current frame")
    frames.add_argument("--frames", type=frame_range, metavar="A-B", help="a sequence, whose flicker is measured too")
    report.add_argument(
        "--rounds", type=positive, metavar="N", help="processes that render each point; default: 3, with --quick 1"
    )
    report.add_argument(
        "--reference-samples",
        type=positive,
        metavar="N",
        help="per pixel of the Cycles reference, unless a reference.exr of the right size is beside the file; "
        "default: 1024, with --quick 256",
    )
    report.add_argument("--blender", choices=("4.5", "5.2"), help="default: the newest that can be set up here")


def command_line() -> argparse.ArgumentParser:
    """The parser of all verbs; each sets `verb` to the module and name of its function, imported only when it runs."""
    versions = "4.5 or 5.2"
    parser = argparse.ArgumentParser(prog="build.py", description=__doc__)
    verbs = parser.add_subparsers(required=True, metavar="VERB")

    render = verbs.add_parser(
        "render", help="render a .blend", description="Render a .blend with any engine, or a scene snapshot (.npz)."
    )
    render.set_defaults(verb=("tooling.rendering", "render"))
    render.add_argument("file", metavar="FILE.blend")
    render.add_argument(
        "-o", "--output", metavar="OUT", help=".png (view transform) or .exr (all passes); default: beside the .blend"
    )
    engines = ("DEEP_GBUFFER", "CYCLES", "EEVEE", "WORKBENCH")
    render.add_argument("--engine", choices=engines, default="DEEP_GBUFFER", help="default: %(default)s")
    frames = render.add_mutually_exclusive_group()
    frames.add_argument("--frame", type=int, metavar="N", help="one frame; default: the file's current frame")
    frames.add_argument("--frames", type=frame_range, metavar="A-B", help="an animation, numbers in the file names")
    render.add_argument("--resolution", type=resolution, metavar="WxH", help="in pixels; default: the file's")
    render.add_argument("--samples", type=positive, metavar="N", help="per pixel; default: the file's")
    render.add_argument("--time-limit", type=seconds, metavar="S", help="stop sampling after this; 0: no limit")
    render.add_argument(
        "--set", type=assignment, action="append", default=[], metavar="NAME=VALUE", help="a setting of the engine"
    )
    render.add_argument("--stats", metavar="FILE.json", help="write timings and counts, one object per repeat")
    render.add_argument(
        "--repeat",
        type=positive,
        default=1,
        metavar="N",
        help="render N times in one process, with Persistent Data: cold, then warm",
    )
    render.add_argument(
        "--blender", metavar="4.5|5.2|PATH", help="version, or a Blender program that gets the built extension"
    )

    add_report(verbs)

    test = verbs.add_parser("test", help="run the tests", description="Run the tests in every Blender version found.")
    test.set_defaults(verb=("tooling.testing", "test"), kinds=TEST_KINDS)
    test.add_argument("--blender", choices=("4.5", "5.2"), help=f"only in {versions}; default: both")
    test.add_argument("--only", choices=TEST_KINDS, action="append", help="only these; may be given again")
    test.add_argument("arguments", nargs="*", metavar="-- ARGUMENTS", help="passed on to pytest")

    check = verbs.add_parser("check", help="formatting, lint, types, import contracts, shaders")
    check.set_defaults(verb=("tooling.checks", "check"))

    package = verbs.add_parser("package", help="build and validate the extension's zips, one per platform")
    package.set_defaults(verb=("tooling.packaging", "package"))
    package.add_argument("-o", "--output", default="dist", metavar="FOLDER", help="default: %(default)s")

    bench = verbs.add_parser("bench", help="run the benches and print their tables")
    bench.set_defaults(verb=("tooling.testing", "bench"))
    bench.add_argument("name", nargs="?", metavar="NAME", help="only this one; default: all")
    return parser


def main() -> int:
    """Run the verb on the command line; the exit code."""

    def terminate(number: int, _frame: FrameType | None) -> None:
        sys.exit(128 + number)

    signal.signal(signal.SIGTERM, terminate)
    options = command_line().parse_args()
    from addon.report.messages import INTERRUPTED
    from tooling.console import ToolError, warn

    try:
        module, name = options.verb
        return getattr(importlib.import_module(module), name)(options)
    except ToolError as error:
        warn(f"error: {error}")
        return 1
    except KeyboardInterrupt:
        warn("interrupted")
        return INTERRUPTED


if __name__ == "__main__":
    if sys.version_info < MINIMUM_PYTHON:
        sys.exit("build.py needs Python 3.9 or newer.")
    sys.exit(main())
