"""Step sequences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.arrays import Array
from hil.errors import SettingError

# Input steps customary for four-port directional valves, in % of rated signal: (from, to) in sequence.
# ISO 10770-1:1998 has them as table 4; the entries are those in general use, not read from the standard.
CUSTOMARY_STEPS: dict[str, tuple[float, ...]] = {
    "small": (0.0, 10.0, 0.0, -10.0, 0.0),
    "half": (0.0, 50.0, 0.0, -50.0, 0.0),
    "full": (0.0, 100.0, 0.0, -100.0, 0.0),
    "reversal": (-90.0, 90.0, -90.0),
    "inner": (10.0, 90.0, 10.0),
    "quarter": (25.0, 75.0, 25.0),
    "paper": (0.0, 80.0, 0.0),
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
