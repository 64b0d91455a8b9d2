# SPDX-License-Identifier: GPL-3.0-or-later
"""Start `measuring` in a Blender of its own; a script for Blender's Python module or for `blender --python`.

The job comes as JSON after `--`; `measuring.run` says what is in it. Its `package` names the add-on that this file
belongs to, which a script does not know. Where that is no add-on that Blender finds, $PYTHONPATH does.
"""

import importlib
import json
import sys

if __name__ == "__main__":
    report = f"{json.loads(sys.argv[sys.argv.index('--') + 1])['package']}.report"
    importlib.import_module(f"{report}.rendering").run_to_end(importlib.import_module(f"{report}.measuring").run)
