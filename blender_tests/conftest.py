# SPDX-License-Identifier: GPL-3.0-or-later
"""What every kind of test shares: the checkout on the import path, the software rasteriser, the shared scenes."""

import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

REPOSITORY = Path(__file__).resolve().parent.parent
SHARED_SCENES = REPOSITORY.parent / "shared" / "scenes"

sys.path.append(str(REPOSITORY))
settings.register_profile("no clock", deadline=None)  # how busy a machine is must not fail a test
settings.load_profile("no clock")
os.environ["LIBGL_ALWAYS_SOFTWARE"] = "1"  # reference pictures are the software rasteriser's


@pytest.fixture(scope="session")
def repository() -> Path:
    """Root of the checkout."""
    return REPOSITORY


@pytest.fixture(scope="session")
def shared_scenes() -> Path:
    """The folder of the shared test scenes; skips where it is not beside the checkout."""
    if not SHARED_SCENES.is_dir():
        pytest.skip("../shared/scenes is not beside this checkout")
    return SHARED_SCENES
