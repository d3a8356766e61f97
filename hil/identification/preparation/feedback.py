"""Was a command made from the output? Seen in what neither could have known of the other in an open loop.

Both are predicted from their common past by least squares. What is new in the output is noise; a command that was
decided beforehand knows nothing of it, one that a controller made from the same sample follows it (instantaneous
causality; Caines and Chan, IEEE Trans. Autom. Control 20(4), 1975).
"""

from __future__ import annotations

import numpy as np

from hil.identification.uncertainty.noise import MEDIAN_SHARE, white_floor
from hil.record.recording import Array

_PAST = 12
_LEAST_SAMPLES, _MOST_SAMPLES = 300, 20_000
_FOLLOWS = 0.3  # correlation of what is new in both
_MOSTLY_NOISE = 2.0  # times the white floor, up to which what is new in the output is its noise
_DECIDED = 1e-6  # of its span: a command whose next value is known beforehand


def runs_in_a_loop(command: Array, output: Array) -> bool:
    """Whether the command follows the noise of the output, sample by sample; both of shape (n,), evenly spaced."""
    u, y = command[:_MOST_SAMPLES], output[:_MOST_SAMPLES]
    floor = white_floor(y)
    if len(y) < _LEAST_SAMPLES or floor <= 0.0 or np.ptp(u) == 0.0:
        return False
    lags = [np.roll(values, k)[_PAST:] for values in (u, y) for k in range(1, _PAST + 1)]
    past = np.column_stack([*lags, np.ones(len(u) - _PAST)])
    past = past / np.maximum(np.abs(past).max(axis=0), 1e-300)
    new = [now[_PAST:] - past @ np.linalg.lstsq(past, now[_PAST:], rcond=1e-10)[0] for now in (u, y)]
    sizes = [float(np.std(values)) for values in new]
    if sizes[0] < _DECIDED * float(np.ptp(u)) or not 0.0 < sizes[1] < _MOSTLY_NOISE * floor:
        return False
    # a few jumps of a command outweigh everything else: each sample has one voice of limited size
    voices = [
        np.clip(values / (np.median(np.abs(values)) / MEDIAN_SHARE or size), -3.0, 3.0)
        for values, size in zip(new, sizes, strict=True)
    ]
    return bool(abs(float(np.corrcoef(*voices)[0, 1])) > _FOLLOWS)
