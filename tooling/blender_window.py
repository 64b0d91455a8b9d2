# SPDX-License-Identifier: GPL-3.0-or-later
"""A modern Blender with a window on Debian: a chroot of the current development release, made once and cached.

Everything in it comes from the Debian mirror that this machine's own apt uses.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from tooling import places, system_packages
from tooling.console import ToolError, run_long, warn

SUITE = "sid"
PACKAGES = (
    *("blender", "libgl1-mesa-dri", "libegl1", "libegl-mesa0", "libglx-mesa0", "libgl1"),
    *("xvfb", "imagemagick", "xdotool"),
    *("python3-numpy", "python3-requests", "python3-zstandard", "python3-cattr"),
)
NO_EXPIRY = 'Acquire::Check-Valid-Until "false";\n'  # a mirror of this machine may be a snapshot
NO_SERVICES = "#!/bin/sh\nexit 101\n"  # policy-rc.d: start nothing inside the chroot
APT = Path("/etc/apt")
NAME = f"window/{SUITE}-{places.key(*PACKAGES)}"
SEARCH_PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


def locate() -> Path | None:
    """Root of the chroot, when it has been made."""
    root = places.cache_directory() / NAME
    return root if _has_blender(root) else None


def why_not() -> str:
    """What keeps this machine from making the chroot; empty when nothing does."""
    if not sys.platform.startswith("linux") or not system_packages.can_install():
        return "a window Blender is made only as root on Debian."
    if mirror(APT) is None:
        return "apt's sources name no Debian mirror to take a window Blender from."
    return ""


def provide() -> Path | None:
    """Root of the chroot, made now (a minute or two, 1.5 GB) where that is possible; None, said loudly, where not.

    Raises ToolError where making it fails.
    """
    reason = why_not()
    if reason:
        warn(f"No Blender window: {reason}")
        return None
    existing = locate()
    if existing is None:
        system_packages.provide(system_packages.DEBOOTSTRAP)
    return existing or places.cached(NAME, _has_blender, _make)


def run(
    root: Path, argv: Sequence[str], env: Mapping[str, str] | None = None, timeout: float | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a command inside the chroot and wait for it; stdout (with stderr) as text.

    `env` is added to a small environment of its own. Raises subprocess.TimeoutExpired after `timeout` seconds; the
    command and everything it started is ended then, and when it returns.
    """
    surroundings = {"PATH": SEARCH_PATH, "HOME": "/", "LANG": "C.UTF-8", **(env or {})}
    child = subprocess.Popen(
        [_chroot(), str(root), *argv],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env=surroundings,
        start_new_session=True,
    )
    try:
        output, _ = child.communicate(timeout=timeout)
    finally:
        with contextlib.suppress(ProcessLookupError):  # it had left nothing behind
            os.killpg(child.pid, signal.SIGKILL)
        child.wait()
    return subprocess.CompletedProcess(list(argv), child.returncode, output, "")


def mirror(apt: Path) -> str | None:
    """The Debian archive in apt's configuration folder: the first with a component `main` that is no security archive.

    Reads `sources.list` and both kinds of files in `sources.list.d`. None on another distribution.
    """
    for path in [apt / "sources.list", *sorted((apt / "sources.list.d").glob("*"))]:
        if path.suffix not in {".list", ".sources"} or not path.is_file():
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        entries = _deb822(text) if path.suffix == ".sources" else _one_line(text)
        for address, suite, components in entries:
            if "main" in components and "security" not in address + suite and _is_debian(address):
                return address
    return None


def _one_line(text: str) -> list[tuple[str, str, list[str]]]:
    """(address, suite, components) of `deb [options] address suite components…` lines."""
    lines = (re.sub(r"\[[^]]*\]", "", line.split("#")[0]).split() for line in text.splitlines())
    return [(words[1], words[2], words[3:]) for words in lines if len(words) > 3 and words[0] == "deb"]


def _deb822(text: str) -> list[tuple[str, str, list[str]]]:
    """(address, suites, components) of stanzas of `Field: value` lines."""
    found: list[tuple[str, str, list[str]]] = []
    for stanza in re.split(r"\n\s*\n", text):
        lines = [line for line in stanza.splitlines() if not line.startswith("#")]
        joined = "\n".join(lines)
        fields = {match[1].lower(): match[2] for match in re.finditer(r"(?m)^([\w-]+):((?:.*)(?:\n[ \t].*)*)", joined)}
        is_off = fields.get("enabled", "yes").strip().lower() == "no"
        if "deb" in fields.get("types", "").split() and not is_off:
            components = fields.get("components", "").split()
            suites = fields.get("suites", "")
            found += [(address, suites, components) for address in fields.get("uris", "").split()]
    return found


def _is_debian(address: str) -> bool:
    """Whether a path segment of the archive's address says `debian`: other vendors' archives do not."""
    return address.startswith(("http://", "https://", "file:")) and "debian" in address.rstrip("/").split("/")


def _has_blender(root: Path) -> bool:
    return (root / "usr" / "bin" / "blender").exists()


def _chroot() -> str:
    """The chroot program; it is not always on the PATH of the person who asks."""
    found = shutil.which("chroot", path=f"{os.environ.get('PATH', '')}:{SEARCH_PATH}")
    if found is None:
        raise ToolError("This machine has no chroot: install with `apt-get install coreutils`.")
    return found


def _make(root: Path) -> None:
    """Make the chroot in the empty folder `root`."""
    address = mirror(APT)
    if address is None:
        raise ToolError(why_not())
    root.chmod(0o755)
    run_long(["debootstrap", "--variant=minbase", SUITE, root, address], "Making a Debian for the window Blender")
    (root / "etc" / "apt" / "apt.conf.d" / "99deep-gbuffer").write_text(NO_EXPIRY, encoding="utf-8")
    policy = root / "usr" / "sbin" / "policy-rc.d"
    policy.write_text(NO_SERVICES, encoding="utf-8")
    policy.chmod(0o755)
    for proxy in (APT / "apt.conf.d").glob("*prox*"):
        shutil.copy(proxy, root / "etc" / "apt" / "apt.conf.d")
    quiet = {"DEBIAN_FRONTEND": "noninteractive", "LANG": "C.UTF-8", "PATH": SEARCH_PATH}
    apt = [_chroot(), root, "apt-get"]
    run_long([*apt, "update", "-q"], "Reading its package lists", quiet)
    install = ["install", "-y", "-q", "--no-install-recommends", *PACKAGES]
    run_long([*apt, *install], "Installing the window Blender (1.5 GB, once)", quiet)
    run_long([*apt, "clean"], "Clearing its downloads", quiet)
