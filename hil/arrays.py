"""Arrays by what they hold, one name for each type in every room; and how well arithmetic repeats itself."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]

ROUNDING = 1e-9
"""Relative: two computations of one number agree better than that, on any processor; beyond it is intent."""

LEAST = 1e-300
"""Less than any size that means something: what a ratio or a logarithm needs to be finite."""
