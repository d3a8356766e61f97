"""The uncertainty of a figure from recordings that are drawn again.

A figure is read from an estimate of the response without noise. The estimate, with noise of the size and colour that
was found, makes recordings like the one at hand; what the same evaluation reads from them scatters as the figure does,
and lies off by as much as the evaluation itself is off.
"""

from __future__ import annotations

import math
import zlib

import numpy as np

from hil.record.recording import Array, Complex

DRAWS = 64
_HIDDEN = 2.0  # times the offset: the estimate that they are drawn from has been smoothed before, and lost less
_PARTS = 1e6  # parts of the largest that seed the draws: the last bits of a calculation differ between processors


def draws_of(samples: Array | Complex) -> np.random.Generator:
    """What draws recordings again of these samples.

    The same samples give the same draws, so results repeat. Draws that are alike for all recordings would make an
    interval too narrow, or too wide, by the same chance in every run: a few dozen know a spread to a tenth.
    """
    parts = np.nan_to_num(np.ascontiguousarray(samples).view(np.float64))
    largest = float(np.max(np.abs(parts), initial=0.0))
    whole_parts = np.rint(parts * (_PARTS / largest)).astype(np.int64) if largest else parts
    return np.random.default_rng(zlib.crc32(whole_parts.tobytes()))


def about(resampled: Array, value: float) -> float:
    """Standard uncertainty of a value: spread of the resampled ones and their offset from it, together.

    Infinite where some of them do not exist.
    """
    if not (math.isfinite(value) and np.all(np.isfinite(resampled))):
        return math.inf
    return math.hypot(float(np.std(resampled, ddof=1)), _HIDDEN * (float(np.mean(resampled)) - value))
