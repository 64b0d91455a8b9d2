# SPDX-License-Identifier: GPL-3.0-or-later
"""Where things are: the checkout, and the cache of everything that can be made again."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
REQUIREMENTS = REPOSITORY / "tooling" / "requirements"
TESTS = REPOSITORY / "blender_tests"


def cache_directory() -> Path:
    """The cache: `$DEEP_GBUFFER_CACHE`, else `deep_gbuffer` in the user's cache folder."""
    own = os.environ.get("DEEP_GBUFFER_CACHE")
    if own:
        return Path(own).expanduser().resolve()
    if os.name == "nt":
        base = os.environ.get("LOCALAPPDATA") or str(Path.home() / "AppData" / "Local")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "deep_gbuffer"


def key(*parts: str | bytes) -> str:
    """A short name for this combination of texts, the same everywhere."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        digest.update(f"{len(data)}:".encode() + data)
    return digest.hexdigest()[:12]


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Gives the path of a draft with the suffix of `path`, which takes its place when the block ends well.

    So `path` is never half a file. Makes its folder. Raises OSError where the file system refuses.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{os.getpid()}_{path.name}")
    try:
        yield draft
        draft.replace(path)
    finally:
        with suppress(OSError):
            draft.unlink()


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold an exclusive lock on the file `path` (made when missing) until the block ends or the process dies."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b") as handle:
        if os.name == "nt":
            import msvcrt

            handle.seek(0)
            msvcrt.locking(handle.fileno(), msvcrt.LK_LOCK, 1)  # pyright: ignore[reportAttributeAccessIssue]
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX)
        yield


def cached(name: str, is_whole: Callable[[Path], bool], make: Callable[[Path], None]) -> Path:
    """The folder `name` of the cache, made by `make(folder)` when it is not there.

    It is made under another name and renamed when `make` has returned, so a folder under its own name is always whole;
    a second process waits for the first. `is_whole` says whether an existing folder still works; one that does not
    is made again.
    """
    place = cache_directory() / name
    if place.is_dir() and is_whole(place):
        return place
    with locked(place.with_name(place.name + ".lock")):
        if place.is_dir() and is_whole(place):
            return place
        shutil.rmtree(place, ignore_errors=True)
        draft = Path(tempfile.mkdtemp(prefix=place.name + ".draft-", dir=place.parent))
        try:
            make(draft)
            draft.chmod(0o755)
            draft.rename(place)
        finally:
            shutil.rmtree(draft, ignore_errors=True)
    return place
