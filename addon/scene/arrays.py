# SPDX-License-Identifier: GPL-3.0-or-later
"""Array types of the scene contract, and when two arrays are equal."""

import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]
Int64Array = NDArray[np.int64]
UInt32Array = NDArray[np.uint32]
UInt8Array = NDArray[np.uint8]
BoolArray = NDArray[np.bool_]

Color = tuple[float, float, float]
"""Scene-linear RGB in the scene's working space."""


def same_array(first: NDArray[np.generic] | None, second: NDArray[np.generic] | None) -> bool:
    """Whether two arrays (or Nones) hold the same bits: NaN equals itself, so broken data is not "changed" forever.

    Compared as integers, which is also faster than as floats.
    """
    if first is None or second is None:
        return first is second
    if first is second:
        return True
    if first.shape != second.shape or first.dtype != second.dtype:
        return False
    bits = np.dtype(f"u{first.dtype.itemsize}")
    return bool(np.array_equal(first.view(bits), second.view(bits)))
