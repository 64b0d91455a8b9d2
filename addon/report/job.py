# SPDX-License-Identifier: GPL-3.0-or-later
"""Start `measuring` in a Blender of its own; a script for Blender's Python module or for `blender --python`.

The job comes as JSON after `--`; `measuring.run` says what is in it. Its `add_on` names the package that this file
belongs to, which a script does not know, and the folder that the package is in unless Blender finds it.
"""

import importlib
import json
import sys

if __name__ == "__main__":
    add_on = json.loads(sys.argv[sys.argv.index("--") + 1])["add_on"]
    if add_on["folder"]:
        sys.path.append(add_on["folder"])
    report = f"{add_on['package']}.report"
    importlib.import_module(f"{report}.rendering").run_to_end(importlib.import_module(f"{report}.measuring").run)
