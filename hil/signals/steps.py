"""Step sequences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil.errors import SettingError

Array = NDArray[np.float64]


def _both_ways(top: float) -> tuple[float, ...]:
    return 0.0, top, 0.0, -top, 0.0


def _there_and_back(start: float, top: float) -> tuple[float, ...]:
    return start, top, start


# Input steps customary for four-port directional valves, in % of rated signal: (from, to) in sequence.
# ISO 10770-1:1998 has them as table 4; the entries are those in general use, not read from the standard.
CUSTOMARY_STEPS: dict[str, tuple[float, ...]] = {
    "small": _both_ways(10.0),
    "half": _both_ways(50.0),
    "full": _both_ways(100.0),
    "reversal": _there_and_back(-90.0, 90.0),
    "inner": _there_and_back(10.0, 90.0),
    "quarter": _there_and_back(25.0, 75.0),
    "paper": _there_and_back(0.0, 80.0),
}


def step_sequence(levels: Sequence[float], hold_s: float, rate_hz: float) -> Array:
    """Each level held for the same time.

    Raises:
        SettingError: no levels, or less than one sample each.
    """
    samples = round(hold_s * rate_hz)
    if not len(levels) or samples < 1:
        raise SettingError(f"steps: {len(levels)} levels of {samples} samples; at least one of each is needed")
    return np.repeat(np.asarray(levels, dtype=np.float64), samples)
