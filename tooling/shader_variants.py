# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile every shader variant of the renderer with glslangValidator; runs in the development environment."""

import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parent.parent))

from addon.render.programs import ExpandedSource, all_variants, name_files


def errors(stage: str, source: ExpandedSource) -> str:
    """What the compiler objects to in one variant, with our file names; empty when it is valid."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"variant.{stage}"
        path.write_text(source.text, encoding="utf-8")
        command = ["glslangValidator", "-S", stage, str(path)]
        answer = subprocess.run(command, capture_output=True, text=True, check=False)
    log = (answer.stdout + answer.stderr).replace(str(path), "")
    return name_files(log.strip(), source.files) if answer.returncode else ""


def main() -> int:
    """Compile all; exit code 1 where one is invalid."""
    listed = list(all_variants())
    with ThreadPoolExecutor() as pool:
        logs = list(pool.map(lambda row: errors(row[1], row[2]), listed))
    for (name, _, _), log in zip(listed, logs, strict=True):
        if log:
            print(f"{name}:\n{log}")
    failed = sum(bool(log) for log in logs)
    print(f"{len(listed)} shader variants, {failed} invalid")
    return 1 if failed or not listed else 0


if __name__ == "__main__":
    sys.exit(main())
