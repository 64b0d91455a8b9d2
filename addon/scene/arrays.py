# SPDX-License-Identifier: GPL-3.0-or-later
"""Array types of the scene contract."""

import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]
Int64Array = NDArray[np.int64]
Int64Array = NDArray[np.int64]
UInt32Array = NDArray[np.uint32]
UInt8Array = NDArray[np.uint8]
BoolArray = NDArray[np.bool_]

Color = tuple[float, float, float]
"""Scene-linear RGB in the scene's working space."""
