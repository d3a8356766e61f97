"""A measured sine: its figures, and a stretch of it with its fit, to be looked at."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from hil.identification.frequency.sine_segments import Segment
from hil.record.measurement import Measured, Measurement
from hil.record.recording import Recording
from hil.signals.sine_fit import SineFit, sine_fit
from procedures._definitions import SINES, defined
from procedures._recorded import calibration_share, calibration_std, roles_of
from procedures._statistics import extreme

HARMONICS = 5
_PERIODS = 2.0
_MOST_POINTS = 1000

AMPLITUDE = Measurement("amplitude", "", "amplitude of the response's fundamental")
PHASE = Measurement("phase", "deg", "phase of the response's fundamental against the command")
OFFSET = Measurement("offset", "", "mean of the response")
THD = Measurement("thd", "%", "harmonics 2 to 5 over the fundamental")
MEASURED = defined(SINES, AMPLITUDE, PHASE, OFFSET, THD)


def figures(
    recording: Recording, place: str, given: SineFit, answer: SineFit, rounding: float = 0.0, crept: float = 0.0
) -> Iterator[Measured]:
    """The quantities of `MEASURED`.

    Args:
        recording: of the sine.
        place: of the quantities.
        given: fit of the command.
        answer: fit of the response.
        rounding: what the converter leaves in amplitude and mean, as a standard uncertainty, beyond the fit's own.
        crept: by how much a drift may have moved the mean.
    """
    _, response = roles_of(recording)
    turned = answer.phasor / given.phasor
    harmonic_std = math.sqrt(float(np.trace(answer.phasor_covariance())) / 2.0)
    yield AMPLITUDE.at(place, response.unit).of(
        answer.amplitude, math.hypot(answer.amplitude_std, rounding),
        calibration=calibration_share(response) * answer.amplitude,
    )  # fmt: skip
    yield PHASE.at(place).of(
        math.degrees(cmath.phase(turned)),
        math.degrees(math.hypot(given.phase_std_rad, answer.phase_std_rad)),
    )
    offset_std = math.hypot(answer.offset_std, rounding, crept / math.sqrt(3.0))
    yield OFFSET.at(place, response.unit).of(answer.offset, offset_std, calibration=calibration_std(response))
    thd_std = math.hypot(harmonic_std, rounding) / answer.amplitude
    yield extreme(THD.at(place), 100.0 * answer.distortion, 100.0 * thd_std)


def shown(recording: Recording, rows: slice, fit: SineFit) -> dict[str, Any]:
    """The first two periods of a sine, measured and fitted; copies, since a view keeps its whole recording."""
    command, response = roles_of(recording)
    time_s = recording.time_s[rows]
    count = int(np.searchsorted(time_s, time_s[0] + _PERIODS / fit.frequency_hz))
    picked = slice(0, count, max(1, math.ceil(count / _MOST_POINTS)))
    return {
        "frequency_hz": fit.frequency_hz, "time_s": time_s[picked] - time_s[0],
        "command": command.values[rows][picked].copy(), "measured": response.values[rows][picked].copy(),
        "fitted": fit.at(time_s)[picked].copy(),
    }  # fmt: skip


def overlay(recording: Recording, segment: Segment) -> dict[str, Any]:
    """What is shown of a segment, with its fit."""
    _, response = roles_of(recording)
    rows = segment.samples
    fit = sine_fit(recording.time_s[rows], response.values[rows], segment.frequency_hz, harmonics=HARMONICS)
    return shown(recording, rows, fit)


def curve(recording: Recording, rows: slice, segment: Segment, label: str, answer: SineFit) -> dict[str, Any]:
    """An entry of `large_sines` (docs/reference/procedures.md)."""
    command, response = roles_of(recording)
    return {
        "label": label, "amplitude": segment.amplitude, "bias": segment.bias,
        "command_unit": command.unit, "response_unit": response.unit, **shown(recording, rows, answer),
        "harmonics_percent": 100.0 * np.abs(answer.phasors[1:]) / answer.amplitude,
    }  # fmt: skip
