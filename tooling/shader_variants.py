# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile every shader variant of the renderer with glslangValidator; runs in the development environment."""

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parent.parent))

from addon.render.programs import ExpandedSource, all_variants, name_files

Variant = tuple[str, str, ExpandedSource]
"""Name, stage and source."""


BATCH = 50
"""Variants per process: starting one costs more than compiling one."""


def compile_batch(batch: Sequence[Variant]) -> list[str]:
    """What the compiler objects to in each variant, with our file names; empty where it is valid."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"{index}.{stage}" for index, (_, stage, _) in enumerate(batch)]
        for path, (_, _, source) in zip(paths, batch, strict=True):
            path.write_text(source.text, encoding="utf-8")
        if not compiler_log(paths):
            return [""] * len(batch)
        logs = [compiler_log([path]).replace(str(path), "") for path in paths]
    return [name_files(log.strip(), source.files) for log, (_, _, source) in zip(logs, batch, strict=True)]


def compiler_log(paths: Sequence[Path]) -> str:
    """The compiler's log of files that are not all valid; empty where they are."""
    command = ["glslangValidator", *map(str, paths)]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    return answer.stdout + answer.stderr if answer.returncode else ""


def main() -> int:
    """Compile all; exit code 1 where one is invalid."""
    listed = list(all_variants())
    batches = [listed[start : start + BATCH] for start in range(0, len(listed), BATCH)]
    with ThreadPoolExecutor() as pool:
        logs = [log for answers in pool.map(compile_batch, batches) for log in answers]
    for (name, _, _), log in zip(listed, logs, strict=True):
        if log:
            print(f"{name}:\n{log}")
    failed = sum(bool(log) for log in logs)
    print(f"{len(listed)} shader variants, {failed} invalid")
    return 1 if failed or not listed else 0


if __name__ == "__main__":
    sys.exit(main())
