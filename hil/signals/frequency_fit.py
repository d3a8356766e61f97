"""The frequency of a sine that nobody commanded: the four-parameter fit of IEEE Std 1057, without uncertainty."""

from __future__ import annotations

import math

import numpy as np

from hil.arrays import Array, Complex
from hil.errors import SettingError
from hil.signals.sine_basis import sine_basis
from hil.signals.sine_solution import solve

_MAX_STEPS = 30
_SETTLED = 1e-8  # steps below this share of a resolution cell change nothing any more
_NEAR = 0.45  # of a resolution cell 1/T: from there the iteration has one optimum to go to


def frequency_of(time_s: Array, values: Array) -> float:
    """The frequency, in Hz, of the sine and the level that leave least of samples, both of shape (n,), even or not.

    Raises:
        SettingError: no sine is to be found near the strongest line of the spectrum.
    """
    span_s = float(time_s[-1] - time_s[0])
    shifted = time_s - (time_s[0] + span_s / 2.0)  # frequency and phase are least entangled in the middle
    start = _strongest(time_s, values)
    frequency, phasors = _climb(shifted, values, start)
    for _ in range(_MAX_STEPS):
        basis = sine_basis(shifted, frequency, 1)
        slope = (shifted * basis.synthesise(phasors))[None, :]  # d/dω A·sin(ωt + φ) = A·t·cos(ωt + φ)
        solved = solve(basis, values, slope, frequency)
        step_hz = float(np.clip(solved.parameters[-1] / (2.0 * math.pi), -_NEAR / span_s, _NEAR / span_s))
        if abs(step_hz) * span_s < _SETTLED:
            break
        frequency, phasors = frequency + step_hz, solved.phasors
        if not 0.0 < frequency < _nyquist(time_s):
            raise SettingError(f"sine fit: no sine near {start:g} Hz; the frequency ran away")
    return frequency


def _strongest(time_s: Array, values: Array) -> float:
    """The frequency of the largest line, stamps taken as even; half a period counts as a line too."""
    n = len(values)
    even = np.interp(np.linspace(time_s[0], time_s[-1], n), time_s, values)
    spectrum = np.abs(np.fft.rfft(even - even.mean()))
    return max(int(np.argmax(spectrum[1:])) + 1, 0.5) / float(time_s[-1] - time_s[0])


def _climb(shifted: Array, values: Array, start: float) -> tuple[float, Complex]:
    """The best of a few frequencies around a start, so that the iteration begins inside the main lobe."""
    resolution, top = 1.0 / float(shifted[-1] - shifted[0]), _nyquist(shifted)
    offered = [f for f in start + resolution * np.arange(-1.0, 1.25, 0.25) if 0.2 * resolution <= f < top]
    nothing = np.empty((0, len(values)))
    tried = [(solve(sine_basis(shifted, f, 1), values, nothing, f), float(f)) for f in offered]
    best, frequency = max(tried, key=lambda pair: pair[0].explained)
    return frequency, best.phasors


def _nyquist(time_s: Array) -> float:
    return 0.5 * (len(time_s) - 1) / float(time_s[-1] - time_s[0])
