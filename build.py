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
TEST_KINDS = ("unit", "gl", "blender", "gui", "stability")


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
    from tooling.console import INTERRUPTED, ToolError, warn

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
