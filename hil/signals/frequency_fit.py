"""The four-parameter sine fit: one sine and its level, with the frequency free.

A diagnostic. A commanded frequency is known, and freeing it costs a factor of 2 in the uncertainty of the
phase over several periods and up to 9 over half a period (see `SineFit.bound` of both). It answers whether
generator and recorder agree on the time, and what the frequency of an uncommanded tone is.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hil.errors import SettingError
from hil.signals.sine_basis import sine_basis
from hil.signals.sine_fit import SineFit, finish
from hil.signals.sine_solution import Solved, solve

Array = NDArray[np.float64]
Phasors = NDArray[np.complex128]

_MAX_STEPS = 30
_SETTLED = 1e-8  # steps below this share of a resolution cell change nothing any more
_NEAR = 0.45  # of a resolution cell 1/T: from there the iteration has one optimum to go to


def frequency_fit(time_s: Array, values: Array, frequency_hz: float | None = None) -> SineFit:
    """Fit offset, amplitude, phase and frequency (IEEE Std 1057, four-parameter fit).

    The frequency is the last of the parameters in `covariance` and `bound`, in rad/s.

    Args:
        time_s: stamps, shape (n,), even or not.
        values: samples, shape (n,).
        frequency_hz: where to start; the strongest line of the spectrum when None.

    Raises:
        SettingError: too few samples, or no sine to be found near the start.
    """
    span_s = float(time_s[-1] - time_s[0])
    origin = time_s[0] + span_s / 2.0  # frequency and phase are least entangled in the middle
    shifted = time_s - origin
    start = _strongest(time_s, values) if frequency_hz is None else frequency_hz
    frequency, phasors = _climb(shifted, values, start)
    for _ in range(_MAX_STEPS):
        solved, slope = _linearised(shifted, values, frequency, phasors)
        step_hz = float(np.clip(solved.parameters[-1] / (2.0 * math.pi), -_NEAR / span_s, _NEAR / span_s))
        if abs(step_hz) * span_s < _SETTLED:
            break
        frequency, phasors = frequency + step_hz, solved.phasors
        if not 0.0 < frequency < _nyquist(time_s):
            raise SettingError(f"sine fit: no sine near {start:g} Hz; the frequency ran away")
    cycles = frequency * span_s / (len(time_s) - 1)
    found = finish(solved, values, slope, cycles, frequency, freed=1)
    return _about_zero(found, origin)


def _linearised(shifted: Array, values: Array, frequency: float, phasors: Phasors) -> tuple[Solved, Array]:
    """One least squares with a column for the frequency: the derivative of the sine with respect to ω."""
    basis = sine_basis(shifted, frequency, 1)
    slope = (shifted * basis.synthesise(phasors))[None, :]  # d/dω A·sin(ωt + φ) = A·t·cos(ωt + φ)
    return solve(basis, values, slope, frequency), slope


def _about_zero(fit: SineFit, origin: float) -> SineFit:
    """The phase that referred to `origin` made to refer to the zero of the stamps, uncertainty included."""
    turn = np.exp(-2j * math.pi * fit.frequency_hz * origin)
    phasors = fit.phasors * turn
    by_omega = -1j * origin * phasors[0]
    to_zero = np.eye(len(fit.covariance))
    to_zero[1:3, 1:3] = [[turn.real, -turn.imag], [turn.imag, turn.real]]
    to_zero[1:3, -1] = by_omega.real, by_omega.imag
    covariance = to_zero @ fit.covariance @ to_zero.T
    return replace(
        fit, phasors=phasors, covariance=covariance, bound=to_zero @ fit.bound @ to_zero.T,
        frequency_std_hz=math.sqrt(covariance[-1, -1]) / (2.0 * math.pi),
    )  # fmt: skip


def _strongest(time_s: Array, values: Array) -> float:
    """The frequency of the largest line, stamps taken as even; half a period counts as a line too."""
    n = len(values)
    even = np.interp(np.linspace(time_s[0], time_s[-1], n), time_s, values)
    spectrum = np.abs(np.fft.rfft(even - even.mean()))
    return max(int(np.argmax(spectrum[1:])) + 1, 0.5) / float(time_s[-1] - time_s[0])


def _climb(shifted: Array, values: Array, start: float) -> tuple[float, Phasors]:
    """The best of a few frequencies around a start, so that the iteration begins inside the main lobe."""
    resolution, top = 1.0 / float(shifted[-1] - shifted[0]), _nyquist(shifted)
    offered = [f for f in start + resolution * np.arange(-1.0, 1.25, 0.25) if 0.2 * resolution <= f < top]
    if not offered:
        raise SettingError(f"sine fit: {start:g} Hz is beyond half the sample rate ({top:g} Hz)")
    nothing = np.empty((0, len(values)))
    tried = [(solve(sine_basis(shifted, f, 1), values, nothing, f), float(f)) for f in offered]
    best, frequency = max(tried, key=lambda pair: pair[0].explained)
    return frequency, best.phasors


def _nyquist(time_s: Array) -> float:
    return 0.5 * (len(time_s) - 1) / float(time_s[-1] - time_s[0])
