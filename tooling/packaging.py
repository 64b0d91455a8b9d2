# SPDX-License-Identifier: GPL-3.0-or-later
"""`build.py package`: the extension's zips, built and validated with Blender's own tool."""

from __future__ import annotations

import platform
import shutil
import sys
import tempfile
from argparse import Namespace
from collections.abc import Iterable
from pathlib import Path

from tooling import environments, places
from tooling.console import ToolError, run_long, say

ADD_ON = places.REPOSITORY / "addon"
SHADERS = places.REPOSITORY / "shaders"
# Blender's name of a platform -> pip's tags for it.
PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_11_0_arm64",),
}
PYTHONS = ("3.11", "3.13", "3.14")  # Blender 4.5, 5.x, and 5.x as distributions build it
WHEEL_LIST = "wheels.txt"


def package(options: Namespace) -> int:
    """Run the verb: one zip per platform in `options.output`; the exit code."""
    zips = build(Path(options.output).resolve(), PLATFORMS, extension_tool())
    for path in zips:
        say(f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB)")
    return 0


def for_this_machine(folder: Path, tool: list[str]) -> Path:
    """The zip for the platform this runs on, like `build`. Raises ToolError on a platform without wheels."""
    name = {"linux": "linux", "win32": "windows", "darwin": "macos"}.get(sys.platform, sys.platform)
    machine = {"x86_64": "x64", "amd64": "x64"}.get(platform.machine().lower(), platform.machine().lower())
    if f"{name}-{machine}" not in PLATFORMS:
        raise ToolError(f"The extension is not built for {name}-{machine}, only for {', '.join(PLATFORMS)}.")
    return build(folder, [f"{name}-{machine}"], tool)[0]


def extension_tool() -> list[str]:
    """The command of Blender's extension tool, the one inside the newest bpy module."""
    python = environments.blender_python()
    found = sorted(python.parent.parent.glob("[lL]ib/**/bl_pkg/cli/blender_ext.py"))
    if not found:
        raise ToolError(f"{python.parent.parent} has no blender_ext.py: delete that folder, it is made again.")
    return [str(python), str(found[-1])]


def extension_tool_of(blender: str) -> list[str]:
    """The same tool as a command of a real Blender."""
    return [blender, "--command", "extension"]


def build(folder: Path, platforms: Iterable[str], tool: list[str]) -> list[Path]:
    """Build and validate the zips of `platforms` (keys of PLATFORMS) with `tool` into `folder`, made when missing.

    Raises ToolError with the output of Blender's tool where it refuses one.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="deep_gbuffer_package_") as scratch:
        staged = stage(Path(scratch) / "deep_gbuffer", list(platforms))
        built = Path(scratch) / "built"
        built.mkdir()
        arguments = ["build", "--source-dir", staged, "--output-dir", built, "--split-platforms"]
        run_long([*tool, *arguments], "Building the extension")
        zips = sorted(built.glob("*.zip"))
        for path in zips:
            run_long([*tool, "validate", path], f"Validating {path.name}")
        return [Path(shutil.move(str(path), str(folder / path.name))) for path in zips]


def stage(folder: Path, platforms: list[str]) -> Path:
    """Lay out the extension for `platforms` in `folder`: the add-on, the shaders, the wheels and the full manifest."""
    shutil.copytree(ADD_ON, folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(SHADERS, folder / "shaders")
    (folder / "wheels").mkdir()
    names: list[str] = []
    for name in platforms:
        for wheel in sorted(wheels(name).glob("*.whl")):
            shutil.copy(wheel, folder / "wheels")
            names.append(wheel.name)
    manifest = folder / "blender_manifest.toml"
    manifest.write_text(complete_manifest(manifest.read_text(encoding="utf-8"), platforms, names), encoding="utf-8")
    return folder


def complete_manifest(manifest: str, platforms: list[str], names: list[str]) -> str:
    """The manifest's text for `platforms` only, with the list of wheel files `names` before its first table."""
    lines = manifest.splitlines()
    wanted = "platforms = [" + ", ".join(f'"{name}"' for name in platforms) + "]"
    lines = [wanted if line.startswith("platforms = ") else line for line in lines]
    first_table = next((row for row, line in enumerate(lines) if line.startswith("[")), len(lines))
    wheel_list = ["wheels = [", *(f'  "./wheels/{name}",' for name in sorted(names)), "]", ""]
    return "\n".join([*lines[:first_table], *wheel_list, *lines[first_table:]]) + "\n"


def wheels(name: str) -> Path:
    """A folder with the wheels of platform `name` for every Python in PYTHONS, downloaded once, checked by hash."""
    lock_file = places.REQUIREMENTS / "runtime.txt"
    identity = places.key(lock_file.read_bytes(), *PYTHONS, *PLATFORMS[name])

    def download(folder: Path) -> None:
        python = environments.runtime_python()
        common = ["download", "--disable-pip-version-check", "--no-input", "--no-deps", "--only-binary", ":all:"]
        tags = [part for tag in PLATFORMS[name] for part in ("--platform", tag)]
        for version in PYTHONS:
            abi = "cp" + version.replace(".", "")
            target = ["--implementation", "cp", "--python-version", version, "--abi", abi, "--dest", folder]
            pinned = ["--require-hashes", "-r", lock_file]
            run_long([python, "-m", "pip", *common, *tags, *target, *pinned], f"Downloading {name} {abi} wheels")

        names = sorted(path.name for path in folder.glob("*.whl"))
        (folder / WHEEL_LIST).write_text("\n".join(names), encoding="utf-8")

    return places.cached(f"wheels/{name}-{identity}", has_all_wheels, download)


def has_all_wheels(folder: Path) -> bool:
    """Whether every wheel that was downloaded into `folder` is still there."""
    listed = folder / WHEEL_LIST
    return listed.is_file() and all(
        (folder / name).is_file() for name in listed.read_text(encoding="utf-8").splitlines()
    )
