# SPDX-License-Identifier: GPL-3.0-or-later
"""Libraries and programs that only the operating system's package manager can provide."""

from __future__ import annotations

import ctypes
import os
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from tooling.console import ToolError, run_long


class Need(NamedTuple):
    """One thing the system must have.

    `libraries`: shared libraries of which one must load. `program`: an executable that must be on PATH.
    `package`: the Debian package with it.
    """

    package: str
    libraries: tuple[str, ...] = ()
    program: str = ""

    def is_met(self) -> bool:
        """Whether the system has it; libraries are tried by loading them and count only on Linux."""
        if self.program:
            return shutil.which(self.program) is not None
        return not sys.platform.startswith("linux") or any(loads(name) for name in self.libraries)


BLENDER_LIBRARIES = (
    Need("libegl1", libraries=("libEGL.so.1",)),
    Need("libegl-mesa0", libraries=("libEGL_mesa.so.0", "libEGL_nvidia.so.0")),
    Need("libgl1", libraries=("libGL.so.1",)),
    Need("libx11-6", libraries=("libX11.so.6",)),
    Need("libxext6", libraries=("libXext.so.6",)),
    Need("libxxf86vm1", libraries=("libXxf86vm.so.1",)),
    Need("libxfixes3", libraries=("libXfixes.so.3",)),
    Need("libxi6", libraries=("libXi.so.6",)),
    Need("libxrender1", libraries=("libXrender.so.1",)),
    Need("libxkbcommon0", libraries=("libxkbcommon.so.0",)),
    Need("libsm6", libraries=("libSM.so.6",)),
    Need("libice6", libraries=("libICE.so.6",)),
)
SHADER_COMPILER = (Need("glslang-tools", program="glslangValidator"),)
DEBOOTSTRAP = (Need("debootstrap", program="debootstrap"),)


def loads(library: str) -> bool:
    """Whether the dynamic linker finds and loads `library`."""
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def can_install() -> bool:
    """Whether packages can be installed without asking: root on a machine with apt-get."""
    return sys.platform.startswith("linux") and os.geteuid() == 0 and shutil.which("apt-get") is not None


def install(packages: Iterable[str]) -> None:
    """Install Debian packages. Raises ToolError when apt-get fails."""
    names = sorted(set(packages))
    quiet = {"DEBIAN_FRONTEND": "noninteractive"}
    lists = Path("/var/lib/apt/lists")
    try:
        run_long(["apt-get", "update", "-q"], "Reading the package lists", quiet)
    except ToolError:
        if not any(lists.glob("*_Packages*")):  # one unreachable source does not matter while others answered
            raise
    command = ["apt-get", "install", "-y", "-q", "--no-install-recommends", *names]
    run_long(command, f"Installing {' '.join(names)}", quiet)


def provide(needs: Iterable[Need]) -> None:
    """Install what is missing of `needs`.

    Raises ToolError, saying what to install, where that cannot be done here or did not help.
    """
    missing = [need for need in needs if not need.is_met()]
    if not missing:
        return
    if can_install():
        install(need.package for need in missing)
        missing = [need for need in missing if not need.is_met()]
    if missing:
        things = ", ".join(need.program or need.libraries[0] for need in missing)
        packages = " ".join(need.package for need in missing)
        raise ToolError(
            f"This machine lacks {things}: install with `sudo apt-get install {packages}`, "
            "or what your system calls these packages."
        )
