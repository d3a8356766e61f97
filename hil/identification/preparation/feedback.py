"""Was a command made from the output? Seen in what neither could have known of the other in an open loop.

Both are predicted from their common past by least squares. What is new in the output is noise; a command that was
decided beforehand knows nothing of it, one that a controller made from the same sample follows it (instantaneous
causality; Caines and Chan, IEEE Trans. Autom. Control 20(4), 1975).
"""

from __future__ import annotations

import numpy as np

from hil.arrays import LEAST
from hil.identification.preparation.criteria import CRITERIA, EFFORT
from hil.identification.uncertainty.noise import MEDIAN_SHARE, white_floor
from hil.record.recording import Array


def runs_in_a_loop(command: Array, output: Array) -> bool:
    """Whether the command follows the noise of the output, sample by sample; both of shape (n,), evenly spaced."""
    u, y = command[: EFFORT.loop_samples], output[: EFFORT.loop_samples]
    floor = white_floor(y)
    if len(y) < CRITERIA.loop_samples or floor <= 0.0 or np.ptp(u) == 0.0:
        return False
    lags = [np.roll(values, k)[EFFORT.past :] for values in (u, y) for k in range(1, EFFORT.past + 1)]
    past = np.column_stack([*lags, np.ones(len(u) - EFFORT.past)])
    past = past / np.maximum(np.abs(past).max(axis=0), LEAST)
    new = [now[EFFORT.past :] - past @ np.linalg.lstsq(past, now[EFFORT.past :], rcond=1e-10)[0] for now in (u, y)]
    sizes = [float(np.std(values)) for values in new]
    if sizes[0] < CRITERIA.decided * float(np.ptp(u)) or not 0.0 < sizes[1] < CRITERIA.mostly_noise * floor:
        return False
    # a few jumps of a command outweigh everything else: each sample has one voice of limited size
    voices = [
        np.clip(values / (np.median(np.abs(values)) / MEDIAN_SHARE or size), -3.0, 3.0)
        for values, size in zip(new, sizes, strict=True)
    ]
    return bool(abs(float(np.corrcoef(*voices)[0, 1])) > CRITERIA.follows)
