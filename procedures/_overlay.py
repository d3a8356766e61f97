"""A stretch of a measured sine with its fit, to be looked at."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hil.identification.frequency.sine_segments import Segment
from hil.record.recording import Array, Recording
from hil.signals.sine_fit import SineFit, sine_fit
from procedures._recorded import roles_of

HARMONICS = 5
_PERIODS = 2.0
_MOST_POINTS = 1000


def overlay(recording: Recording, segment: Segment) -> dict[str, Any]:
    """The first two periods of a segment, measured and fitted; copies, since a view keeps its whole recording."""
    command, response = roles_of(recording)
    rows = segment.samples
    time_s, measured = recording.time_s[rows], response.values[rows]
    fit = sine_fit(time_s, measured, segment.frequency_hz, harmonics=HARMONICS)
    shown = slice(0, shown_samples(time_s, segment.frequency_hz), None)
    every = thinning(shown.stop)
    picked = slice(0, shown.stop, every)
    return {
        "frequency_hz": segment.frequency_hz,
        "time_s": time_s[picked] - time_s[0],
        "measured": measured[picked].copy(),
        "fitted": synthesised(fit, time_s[picked]),
        "command": command.values[rows][picked].copy(),
    }


def shown_samples(time_s: Array, frequency_hz: float) -> int:
    """How many samples are two periods, or all."""
    return int(np.searchsorted(time_s, time_s[0] + _PERIODS / frequency_hz))


def thinning(samples: int) -> int:
    """Every how many samples one is drawn."""
    return max(1, math.ceil(samples / _MOST_POINTS))


def synthesised(fit: SineFit, time_s: Array) -> Array:
    """Offset, fundamental and harmonics at stamps, shape (n,)."""
    turn = 2.0 * math.pi * fit.frequency_hz * np.outer(np.arange(1, len(fit.phasors) + 1), time_s)
    return fit.offset + (fit.phasors[:, None] * np.exp(1j * turn)).imag.sum(axis=0)
