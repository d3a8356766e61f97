"""Arrays by what they hold: one name for each type, in every room."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]
