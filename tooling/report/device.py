# SPDX-License-Identifier: GPL-3.0-or-later
"""What our engine draws with here, asked in a process of its own."""

import subprocess
import sys

from addon.render import DeviceError, gl_thread, stop_gl_thread
from tooling import places


def name() -> str:
    """Renderer and version as OpenGL calls them; "" where there is none."""
    command = [sys.executable, "-m", "tooling.report.device"]
    return subprocess.run(command, cwd=places.REPOSITORY, capture_output=True, text=True, check=False).stdout.strip()


if __name__ == "__main__":
    try:
        print(gl_thread().submit(lambda device: device.name).result())
    except DeviceError:
        sys.exit(1)
    finally:
        stop_gl_thread()
