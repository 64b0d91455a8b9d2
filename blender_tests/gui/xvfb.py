# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a command with a virtual screen of its own: python3 xvfb.py COMMAND ARGUMENT…; its exit code is ours."""

import os
import subprocess
import sys

SCREEN = "1280x800x24"


def main() -> int:
    """Start Xvfb on a free display, run the command on it, stop Xvfb."""
    reading, writing = os.pipe()
    options = ["-displayfd", str(writing), "-screen", "0", SCREEN, "+extension", "GLX", "-nolisten", "tcp"]
    screen = subprocess.Popen(["Xvfb", *options], pass_fds=[writing], stderr=subprocess.DEVNULL)
    os.close(writing)
    try:
        with os.fdopen(reading) as display:
            number = display.readline().strip()
        if not number:
            print("Xvfb did not start", file=sys.stderr)
            return 1
        return subprocess.run(sys.argv[1:], env={**os.environ, "DISPLAY": f":{number}"}, check=False).returncode
    finally:
        screen.terminate()
        screen.wait()


if __name__ == "__main__":
    sys.exit(main())
