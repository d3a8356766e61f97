"""The uncertainty of a figure from recordings that are drawn again.

A figure is read from an estimate of the response without noise. The estimate, with noise of the size and colour that
was found, makes recordings like the one at hand; what the same evaluation reads from them scatters as the figure does,
and lies off by as much as the evaluation itself is off.
"""

from __future__ import annotations

import math

import numpy as np

from hil.record.recording import Array

DRAWS = 64
_HIDDEN = 2.0  # times the offset: the estimate that they are drawn from has been smoothed before, and lost less


def about(redrawn: Array, value: float) -> float:
    """Standard uncertainty of a value: spread of the redrawn ones and their offset from it, together.

    Infinite where some of them do not exist.
    """
    if not (math.isfinite(value) and np.all(np.isfinite(redrawn))):
        return math.inf
    return math.hypot(float(np.std(redrawn)), _HIDDEN * (float(np.mean(redrawn)) - value))
